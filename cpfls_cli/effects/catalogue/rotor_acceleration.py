"""Reaction to rotors that speed up or slow down."""

from collections.abc import Mapping

import numpy as np

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Columns, Effect
from cpfls_cli.effects.signals import Signals


def _columns(signals: Signals, _shape: Mapping[str, float]) -> Columns:
    momentum = np.zeros((len(signals), 6, 1))
    momentum[:, 2, 0] = -(signals.speed @ signals.spins)
    return Columns(np.zeros_like(momentum), momentum)


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
    columns=_columns,
)
