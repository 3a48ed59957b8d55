"""Centre of mass off the point that the hub positions are measured from."""

from dataclasses import replace

import numpy as np

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Columns, Effect, a_few_percent
from cpfls_cli.effects.signals import Signals
from cpfls_cli.rotations import cross

_AXES = np.eye(3)[None]


def _levers(signals: Signals, axes: int) -> Columns:
    direct = np.zeros((len(signals), 6, axes))
    direct[:, :3] = -cross(_AXES[:, :axes], signals.force[:, None]).swapaxes(1, 2)
    return Columns(direct)


_EFFECT = Effect(
    name="com_offset",
    order=180,
    title="offset of the centre of mass",
    kind="wrench",
    formula="M = -c x F,  F the force without weight, as measured, or else the thrust",
    sentence="The centre of mass is not where the model has it, so thrust tilts the vehicle.",
    coefficients=(
        Coefficient("c_x", "m", -0.4, 0.4, "true centre of mass, forward of that of the model", scales.arm),
        Coefficient("c_y", "m", -0.4, 0.4, "true centre of mass, left of that of the model", scales.arm),
    ),
    needs=frozenset({"thrust"}),
    excitation="changes of thrust: climbs, descents, hard stops",
    rivals={
        "torque_bias": "change the thrust: a bias stays, the torque of an offset grows with thrust",
        "rotor_mismatch": "apply yaw effort: it loads one pair of rotors more than the other",
        "wind": "turn in yaw, and change the thrust",
    },
    source="geometry; RotorPy (hub positions relative to the centre of mass)",
    columns=lambda signals, _shape: _levers(signals, 2),
    of_all_forces=True,
    accounts=a_few_percent,
)

# Height alone is the moment of a flapping disc; with the other two it is the third number of one cause.
_HEIGHT = Coefficient(
    "c_z", "m", -0.4, 0.4, "true centre of mass, above that of the model; shown by forces across the rotors", scales.arm
)
EFFECT = replace(
    _EFFECT,
    exact=replace(
        _EFFECT, coefficients=(*_EFFECT.coefficients, _HEIGHT), columns=lambda signals, _shape: _levers(signals, 3)
    ),
)
