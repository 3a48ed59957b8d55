"""A constant torque: bent arms, tilted motors."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Columns, Effect
from cpfls_cli.effects.signals import Signals


def _columns(signals: Signals, _shape: Mapping[str, float]) -> Columns:
    return Columns(np.tile(np.eye(6)[:, :3], (len(signals), 1, 1)))


EFFECT = Effect(
    name="torque_bias",
    order=210,
    title="constant torque",
    kind="wrench",
    formula="M = (M_x, M_y, M_z)",
    sentence="Something turns the vehicle all the time to the same side, as a bent arm or a tilted motor does.",
    coefficients=tuple(
        Coefficient(f"M_{letter}", "N m", -0.15, 0.15, f"torque about {letter}", scales.arm_weight) for letter in "xyz"
    ),
    needs=frozenset(),
    excitation="none: it is always there",
    rivals={
        "com_offset": "change the thrust: a bias stays, the torque of an offset grows with thrust",
        "rotor_mismatch": "change the thrust and make yaw effort",
        "wind": "turn in yaw: a bias turns with the vehicle, the wind does not",
        "euler_axis_torque": "tilt: the wrong convention vanishes in level flight",
    },
    source="SkyFlow (thrust axis misalignment)",
    columns=_columns,
)
