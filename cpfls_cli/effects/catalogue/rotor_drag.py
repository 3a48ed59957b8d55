"""Rotor drag: blade flapping, induced, translational and profile drag, which act in the rotor plane."""

from __future__ import annotations

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Effect
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench


def drag_at_hubs(see: Instant, p: Numbers) -> Wrench:
    """Drag the hubs in their plane."""
    x, y, _ = see.hub_velocity
    drag = -p["k_d"] * see.rotor_speed
    return Wrench(at_hubs=(drag * x, drag * y, 0))


EFFECT = Effect(
    name="rotor_drag",
    order=40,
    title="rotor drag (H-force)",
    quantity="drag",
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
    acts=drag_at_hubs,
)
