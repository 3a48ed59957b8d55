"""A gyro that reads a rate at rest."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Coefficient, Effect
from cpfls_cli.effects.hooks import ReadingError, SensorLog, SensorTest, TrueMotion


def _log(signals: Mapping[str, Array], _motion: TrueMotion, values: Mapping[str, float]) -> dict[str, Array]:
    return {"body_rate": np.asarray(signals["body_rate"] + np.array(list(values.values())))}


EFFECT = Effect(
    name="gyro_bias",
    order=240,
    title="gyro bias",
    kind="sensor",
    formula="gyro = omega + b",
    sentence="The gyro reports a slow rotation that does not happen.",
    coefficients=tuple(Coefficient(f"b_{letter}", "rad/s", -0.3, 0.3, f"bias about {letter}") for letter in "xyz"),
    needs=frozenset({"attitude"}),
    excitation="any flight of some minutes; the attitude must not come from the gyro alone",
    rivals={"imu_misalignment": "roll, pitch and yaw: a bias stays the same at every rate"},
    source="definition; comparison of the gyro with the derivative of the attitude",
    columns=None,
    log=SensorLog(change=_log),
    test=SensorTest(
        estimate="bias",
        labels=("x", "y", "z"),
        smallest=0.0015,
        number=lambda axis, value: f"{value:+.4f} rad/s about {axis}",
        found="The gyroscope shows a rate where there is none: {}.",
        nothing="No constant error of the gyroscope that matters.",
        error=lambda values: ReadingError(offset=values),
    ),
)
