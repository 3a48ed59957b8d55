"""An IMU that is turned against the body."""

from __future__ import annotations

from cpfls_cli.effects.effect import Coefficient, Effect

EFFECT = Effect(
    name="imu_misalignment",
    title="misaligned IMU",
    kind="sensor",
    formula="gyro = omega - delta x omega",
    sentence="The IMU is mounted askew, so that turning about one axis shows on another.",
    coefficients=tuple(
        Coefficient(f"delta_{letter}", "rad", -0.35, 0.35, f"turn of the IMU about {letter}") for letter in "xyz"
    ),
    needs=frozenset({"attitude"}),
    excitation="large turns about each axis; the attitude must not come from the gyro alone",
    rivals={
        "products_of_inertia": "compare roll on pitch with pitch on roll: products have one sign, misalignment has two",
        "gyro_bias": "roll, pitch and yaw: a bias stays the same at every rate",
        "rotor_gyroscopic": "repeat the roll rates with the yaw effort reversed: misalignment stays",
    },
    source="definition; comparison of the gyro with the derivative of the attitude",
    columns=None,
)
