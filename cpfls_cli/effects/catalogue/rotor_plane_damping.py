"""Damping of roll and pitch by the rotor discs, whose planes lag behind the body."""

from __future__ import annotations

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Effect
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench


def _acts(see: Instant, p: Numbers) -> Wrench:
    rate_x, rate_y, _ = see.body_rate
    x, y, _ = (see.functions.total(see.rotor_speed * hub) for hub in see.hubs)
    total = see.functions.total(see.rotor_speed)
    # Thrust that leans with the disc; its lever about roll and pitch is part of the damping already.
    torque = (-p["k_w"] * total * rate_x, -p["k_w"] * total * rate_y, p["k_F"] * (x * rate_x + y * rate_y))
    return Wrench(torque, force=(-p["k_F"] * total * rate_y, p["k_F"] * total * rate_x, 0))


EFFECT = Effect(
    name="rotor_plane_damping",
    order=30,
    title="rotor-plane damping",
    kind="wrench",
    formula="M = -k_w sum(w_i) (p, q, 0),  F_i = k_F w_i (-q, p, 0)",
    sentence="The rotor discs tilt later than a rolling or pitching body, and brake it more the faster they spin.",
    coefficients=(
        Coefficient(
            "k_w", "N m s^2/rad^2", 0.0, 3.0, "damping per rotor speed and rate", scales.inertia_per_rotor_speed
        ),
        Coefficient(
            "k_F",
            "N s^2/rad^2",
            0.0,
            20.0,
            "sideways force of the leaning thrust; only the force balance shows it",
            scales.lean_per_rotor_speed,
        ),
    ),
    needs=frozenset({"rotor_speed"}),
    excitation="roll and pitch rate sweeps while climbing and while descending",
    rivals={
        "linear_damping": "repeat the rate sweep at two thrusts: in hover the two are one column",
        "quadratic_damping": "repeat the same rate sweep at twice the amplitude",
        "inflow": "climb and descend at constant attitude: only inflow changes the thrust",
    },
    source="Corke, Robotics Toolbox quadrotor_dynamics.m (a1s -= 16/(gamma |w|) q); NASA TP-1285",
    acts=_acts,
)
