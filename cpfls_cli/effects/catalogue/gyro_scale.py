"""A gyro that reads too much or too little of each rate."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Coefficient, Effect
from cpfls_cli.effects.hooks import ReadingError, SensorLog, SensorTest, TrueMotion


def _log(signals: Mapping[str, Array], _motion: TrueMotion, values: Mapping[str, float]) -> dict[str, Array]:
    return {"body_rate": np.asarray((1 + np.array(list(values.values()))) * signals["body_rate"])}


def _number(axis: str, value: float) -> str:
    return f"{100 * abs(value):.2g} % too {'much' if value > 0 else 'little'} about {axis}"


EFFECT = Effect(
    name="gyro_scale",
    order=250,
    title="gyro scale",
    kind="sensor",
    formula="gyro = (1 + e) omega on each axis",
    sentence="The gyro reports every rotation too fast or too slow.",
    coefficients=tuple(Coefficient(f"e_{letter}", "1", -0.25, 0.25, f"scale error about {letter}") for letter in "xyz"),
    needs=frozenset({"attitude"}),
    excitation="large turns about each axis; the attitude must not come from the gyro alone",
    rivals={"parameter_error": "compare the gyro with the attitude: a wrong inertia leaves them equal"},
    source="definition; comparison of the gyro with the derivative of the attitude",
    columns=None,
    log=SensorLog(change=_log),
    test=SensorTest(
        estimate="scale",
        labels=("x", "y", "z"),
        smallest=0.003,
        number=_number,
        found="The gyroscope reads {}.",
        nothing="The gyroscope's scale agrees with the attitude.",
        error=lambda values: ReadingError(matrix=np.diag(1.0 + values)),
        integrated=True,
    ),
)
