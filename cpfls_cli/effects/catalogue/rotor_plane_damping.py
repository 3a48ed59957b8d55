"""Damping of roll and pitch by the rotor discs, whose planes lag behind the body."""

from __future__ import annotations

from collections.abc import Mapping

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Columns, Effect, stack, wrench
from cpfls_cli.effects.signals import Signals


def _columns(signals: Signals, _shape: Mapping[str, float]) -> Columns:
    total = signals.speed.sum(axis=1, keepdims=True)
    return Columns(stack(wrench(-total * signals.body_rate * [1.0, 1.0, 0.0])))


EFFECT = Effect(
    name="rotor_plane_damping",
    title="rotor-plane damping",
    kind="wrench",
    formula="M = -k_w sum(w_i) (p, q, 0)",
    sentence="The rotor discs tilt late behind a rolling or pitching body, and brake it the more the faster they spin.",
    coefficients=(
        Coefficient(
            "k_w", "N m s^2/rad^2", 0.0, 1.0, "damping per rotor speed and rate", scales.inertia_per_rotor_speed
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
    columns=_columns,
)
