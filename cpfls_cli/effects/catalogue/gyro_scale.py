"""A gyro that reads too much or too little of each rate."""

import numpy as np

from cpfls_cli.effects.effect import Effect, of_axes
from cpfls_cli.effects.hooks import ReadingError, SensorTest, gyroscope_log

EFFECT = Effect(
    name="gyro_scale",
    order=250,
    title="gyro scale",
    kind="sensor",
    formula="gyro = (1 + e) omega on each axis",
    sentence="The gyro reports every rotation too fast or too slow.",
    coefficients=of_axes("e_{}", "1", -0.25, 0.25, "scale error about {}"),
    needs=frozenset({"attitude"}),
    excitation="large turns about each axis; the attitude must not come from the gyro alone",
    rivals={"parameter_error": "compare the gyro with the attitude: a wrong inertia leaves them equal"},
    source="definition; comparison of the gyro with the derivative of the attitude",
    log=gyroscope_log(lambda rate, scale: (1 + scale) * rate),
    test=SensorTest(
        estimate="scale",
        smallest=0.003,
        number=lambda axis, value: f"{100 * abs(value):.2g} % too {'much' if value > 0 else 'little'} about {axis}",
        found="The gyroscope reads {}.",
        nothing="The gyroscope's scale agrees with the attitude.",
        error=lambda values: ReadingError(matrix=np.diag(1.0 + values)),
        integrated=True,
    ),
)
