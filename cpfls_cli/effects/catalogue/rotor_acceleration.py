"""Reaction to rotors that speed up or slow down."""

from __future__ import annotations

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Effect
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench


def _acts(see: Instant, p: Numbers) -> Wrench:
    return Wrench(momentum=(0, 0, -p["J_r"] * see.functions.total(see.spins * see.rotor_speed)))


EFFECT = Effect(
    name="rotor_acceleration",
    order=140,
    title="reaction to rotor acceleration",
    kind="wrench",
    formula="M_z = -d/dt (J_r S),  S = sum s_i w_i",
    sentence="A rotor that speeds up pushes the body the other way, so yaw responds at once and then less.",
    coefficients=(Coefficient("J_r", "kg m^2", 0.0, 0.01, "inertia of one rotor about its axis", scales.MOMENTS[0]),),
    needs=frozenset({"body_rate", "rotor_speed"}),
    excitation="yaw steps, and a yaw sweep from 0.3 to 2 Hz, with rotor speeds logged at 100 Hz or more",
    rivals={
        "parameter_error": "compare slow with fast yaw: a wrong Izz acts in both",
        "motor_lag": "log measured rotor speeds; lag delays roll and pitch as well",
        "rotor_gyroscopic": "yaw without rolling or pitching; J_r must be the same in both",
    },
    source="Bouabdallah 2007, OS4 (inertial counter torque)",
    acts=_acts,
)
