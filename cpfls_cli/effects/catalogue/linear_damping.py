"""Rotational damping in proportion to the rate."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Columns, Effect
from cpfls_cli.effects.signals import Signals


def _columns(signals: Signals, _shape: Mapping[str, float]) -> Columns:
    direct = np.zeros((len(signals), 6, 3))
    direct[:, :3] = -signals.body_rate[:, :, None] * np.eye(3)
    return Columns(direct)


def _damping(axis: int) -> Coefficient:
    letter = "xyz"[axis]
    return Coefficient(f"d_{letter}", "N m s/rad", 0.0, 3.0, f"damping about {letter}", scales.moment_of_inertia(axis))


EFFECT = Effect(
    name="linear_damping",
    order=10,
    title="linear rotational damping",
    kind="wrench",
    formula="M = -(d_x p, d_y q, d_z r)",
    sentence="The air brakes rotation in proportion to the rate.",
    coefficients=(_damping(0), _damping(1), _damping(2)),
    needs=frozenset(),
    excitation="roll, pitch and yaw rate sweeps from 0.3 to 2 Hz at several amplitudes",
    rivals={
        "quadratic_damping": "repeat the same rate sweep at twice the amplitude",
        "rotor_plane_damping": "repeat the rate sweep at two thrusts: in hover the two are one column",
        "inflow": "climb and descend at constant attitude: only inflow changes the thrust",
        "rotor_drag": "fly forward and sideways, and log velocity: at the hubs drag brakes yaw like a damping",
        "motor_lag": "log measured rotor speeds; lag looks like damping below zero",
        "command_delay": "log measured rotor speeds; a delay looks like damping below zero",
    },
    source="PX4 sih.cpp (Ma = -KDW omega); simulator of ArduPilot (terminal rotation rate)",
    columns=_columns,
)
