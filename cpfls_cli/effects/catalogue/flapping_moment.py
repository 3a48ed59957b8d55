"""Moment at the hubs that flapping blades give in translation; its sign is open."""

from collections.abc import Mapping

import numpy as np

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Columns, Effect, torque_column
from cpfls_cli.effects.signals import Signals


def _columns(signals: Signals, _shape: Mapping[str, float]) -> Columns:
    x, y, _ = np.moveaxis((signals.speed[..., None] * signals.hub_velocity).sum(axis=1), 1, 0)
    return torque_column(-np.column_stack([y, -x, np.zeros_like(x)]))


EFFECT = Effect(
    name="flapping_moment",
    order=50,
    title="flapping hub moment",
    kind="wrench",
    formula="M = -k_f sum w_i (u_iy, -u_ix, 0)",
    sentence="In forward flight the blades flap and tilt the nose up or down, without a force of their own.",
    coefficients=(Coefficient("k_f", "kg m/rad", -1.0, 1.0, "moment per rotor speed and air speed", scales.arm_drag),),
    needs=frozenset({"velocity", "rotor_speed"}),
    excitation="forward and sideways flight at several speeds",
    rivals={
        "rotor_drag": "log acceleration, so that the force is seen; or turn in yaw while flying fast",
        "wind": "fly legs in opposite directions",
        "parasitic_drag": "fly legs at two speeds, one twice the other",
    },
    source="RotorPy multirotor.py (M_flap, nose down); Bauersfeld et al. 2021, NeuroBEM, eq. 17 (nose up)",
    columns=_columns,
)
