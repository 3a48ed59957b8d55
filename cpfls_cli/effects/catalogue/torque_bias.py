"""A constant torque: bent arms, tilted motors."""

import numpy as np

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Columns, Effect, of_axes

EFFECT = Effect(
    name="torque_bias",
    order=210,
    title="constant torque",
    kind="wrench",
    formula="M = (M_x, M_y, M_z)",
    sentence="Something always turns the vehicle to the same side, as a bent arm or a tilted motor does.",
    coefficients=of_axes("M_{}", "N m", -0.15, 0.15, "torque about {}", scales.arm_weight),
    needs=frozenset(),
    excitation="none: it is always there",
    rivals={
        "com_offset": "change the thrust: a bias stays, the torque of an offset grows with thrust",
        "rotor_mismatch": "change the thrust and apply yaw effort",
        "wind": "turn in yaw: a bias turns with the vehicle, the wind does not",
        "euler_axis_torque": "tilt: the wrong convention vanishes in level flight",
    },
    source="SkyFlow (thrust axis misalignment)",
    columns=lambda signals, _: Columns(np.tile(np.eye(6)[:, :3], (len(signals), 1, 1))),
)
