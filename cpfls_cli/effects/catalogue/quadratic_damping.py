"""Rotational damping that grows with the square of the rate."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Columns, Effect
from cpfls_cli.effects.signals import Signals


def _columns(signals: Signals, _shape: Mapping[str, float]) -> Columns:
    direct = np.zeros((len(signals), 6, 3))
    direct[:, :3] = -(np.abs(signals.body_rate) * signals.body_rate)[:, :, None] * np.eye(3)
    return Columns(direct)


def _damping(axis: int) -> Coefficient:
    letter = "xyz"[axis]
    return Coefficient(
        f"d_{letter}", "N m s^2/rad^2", 0.0, 1.0, f"damping about {letter}", scales.moment_of_inertia(axis)
    )


EFFECT = Effect(
    name="quadratic_damping",
    order=20,
    title="quadratic rotational damping",
    kind="wrench",
    formula="M = -(d_x |p| p, d_y |q| q, d_z |r| r)",
    sentence="The air brakes fast rotation more than slow rotation, as it does a flat plate.",
    coefficients=(_damping(0), _damping(1), _damping(2)),
    needs=frozenset(),
    excitation="roll, pitch and yaw rate sweeps at a small and at a large amplitude",
    rivals={
        "linear_damping": "repeat the same rate sweep at twice the amplitude",
        "rotor_plane_damping": "repeat the same rate sweep at twice the amplitude",
    },
    source="OS4 dinamica.m (friction torque of the body); flat-plate estimate",
    columns=_columns,
)
