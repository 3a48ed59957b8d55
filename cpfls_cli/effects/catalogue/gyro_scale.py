"""A gyro that reads too much or too little of each rate."""

from __future__ import annotations

from cpfls_cli.effects.effect import Coefficient, Effect

EFFECT = Effect(
    name="gyro_scale",
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
)
