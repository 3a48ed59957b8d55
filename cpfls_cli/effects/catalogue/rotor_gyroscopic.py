"""Gyroscopic torque of the rotors when their spins do not cancel."""

from __future__ import annotations

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Effect
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench


def _acts(see: Instant, p: Numbers) -> Wrench:
    spin = p["J_r"] * see.functions.total(see.spins * see.rotor_speed)
    return Wrench((-spin * see.body_rate[1], spin * see.body_rate[0], 0))


EFFECT = Effect(
    name="rotor_gyroscopic",
    order=130,
    title="gyroscopic torque of the rotors",
    kind="wrench",
    formula="M = -omega x J_r S z = J_r S (-q, p, 0),  S = sum s_i w_i",
    sentence="With yaw effort the rotors are a gyroscope: rolling then pitches the vehicle, and pitching rolls it.",
    coefficients=(Coefficient("J_r", "kg m^2", 0.0, 0.01, "inertia of one rotor about its axis", scales.MOMENTS[0]),),
    needs=frozenset({"rotor_speed"}),
    excitation="roll and pitch rates during yaw effort to both sides",
    rivals={
        "products_of_inertia": "repeat the roll rates with the yaw effort reversed: only the gyroscope reverses",
        "imu_misalignment": "repeat the roll rates with the yaw effort reversed",
        "rotor_acceleration": "hold the yaw effort constant while rolling; J_r must be the same in both",
    },
    source="Bouabdallah 2007, OS4 (RgP, PgP)",
    acts=_acts,
)
