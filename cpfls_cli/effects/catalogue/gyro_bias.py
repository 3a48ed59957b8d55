"""A gyro that reads a rate at rest."""

from __future__ import annotations

from cpfls_cli.effects.effect import Coefficient, Effect

EFFECT = Effect(
    name="gyro_bias",
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
)
