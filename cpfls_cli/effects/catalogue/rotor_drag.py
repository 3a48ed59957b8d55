"""Rotor drag: blade flapping, induced, translational and profile drag, which act in the rotor plane."""

from collections.abc import Mapping

import numpy as np

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Columns, Effect, hub_wrench, stack
from cpfls_cli.effects.signals import Signals

IN_PLANE = np.array([1.0, 1.0, 0.0])  # What of a vector lies in the rotor plane, body axes.


def drag(signals: Signals, _shape: Mapping[str, float]) -> Columns:
    """Compute the drag of all rotors for a unit of k_d, as a column."""
    return Columns(stack(hub_wrench(signals.hubs, -signals.speed[..., None] * (signals.hub_velocity * IN_PLANE))))


EFFECT = Effect(
    name="rotor_drag",
    order=40,
    title="rotor drag (H-force)",
    kind="wrench",
    formula="F_i = -k_d w_i (u_ix, u_iy, 0) at hub i,  M = sum r_i x F_i",
    sentence="The spinning rotors hold the vehicle back in proportion to its speed through the air.",
    coefficients=(
        Coefficient(
            "k_d", "N s^2/(m rad)", 0.0, 5.0, "drag per rotor, rotor speed and air speed", scales.drag_per_rotor_speed
        ),
    ),
    needs=frozenset({"velocity", "rotor_speed"}),
    excitation="forward and sideways flight at several speeds, with yaw turns",
    rivals={
        "flapping_moment": "log acceleration, so that the force is seen; or turn in yaw while flying fast",
        "parasitic_drag": "fly legs at two speeds, one twice the other",
        "wind": "fly legs in opposite directions",
    },
    source="RotorPy multirotor.py; Martin and Salaun 2010; OS4 aero.m (induced and profile parts in one column)",
    columns=drag,
)
