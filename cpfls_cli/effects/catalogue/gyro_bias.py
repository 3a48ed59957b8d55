"""A gyro that reads a rate at rest."""

from cpfls_cli.effects.effect import Effect, of_axes
from cpfls_cli.effects.hooks import ReadingError, SensorTest, gyroscope_log

EFFECT = Effect(
    name="gyro_bias",
    order=240,
    title="gyro bias",
    kind="sensor",
    formula="gyro = omega + b",
    sentence="The gyro reports a slow rotation that does not happen.",
    coefficients=of_axes("b_{}", "rad/s", -0.3, 0.3, "bias about {}"),
    needs=frozenset({"attitude"}),
    excitation="any flight of some minutes; the attitude must not come from the gyro alone",
    rivals={"imu_misalignment": "roll, pitch and yaw the vehicle: a bias stays the same at every rate"},
    source="definition; comparison of the gyro with the derivative of the attitude",
    log=gyroscope_log(lambda rate, bias: rate + bias),
    test=SensorTest(
        estimate="bias",
        smallest=0.0015,
        number=lambda axis, value: f"{value:+.4f} rad/s about {axis}",
        found="The gyroscope shows a rate where there is none: {}.",
        nothing="The gyroscope has no constant error that matters.",
        error=lambda values: ReadingError(offset=values),
    ),
)
