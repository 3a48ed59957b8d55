"""Steady wind: the rotor drag of a vehicle that does not move over the ground, and the air that all others meet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Columns, Effect, Shape, hub_wrench, stack
from cpfls_cli.effects.signals import Signals

_IN_PLANE = np.array([1.0, 1.0, 0.0])


_STRONGEST = 15.0


def _columns(signals: Signals, _shape: Mapping[str, float]) -> Columns:
    still = signals if signals.wind is None else replace(signals, wind=None)
    speed = signals.speed[..., None]
    still_air = -speed * still.hub_velocity * _IN_PLANE
    pushed = [speed * (signals.rotation[:, axis] * _IN_PLANE)[:, None] for axis in (0, 1)]
    return Columns(stack(*(hub_wrench(signals.hubs, force) for force in (still_air, *pushed))))


def _physical(linear: Array) -> Array:
    drag = linear[0]
    return np.array([drag, *(linear[1:] / drag if drag > 0 else (np.nan, np.nan))])


def _linear(physical: Array) -> Array:
    drag, x, y = physical
    return np.array([drag, drag * x, drag * y])


def _blowing(signals: Signals, shape: Mapping[str, float]) -> Signals:
    return replace(signals, wind=np.array([shape["W_x"], shape["W_y"], 0.0]))


def _drag(signals: Signals, shape: Mapping[str, float]) -> Columns:
    in_plane = _blowing(signals, shape).hub_velocity * _IN_PLANE
    return Columns(stack(hub_wrench(signals.hubs, -signals.speed[..., None] * in_plane)))


_EFFECT = Effect(
    name="wind",
    order=120,
    title="steady wind",
    kind="wrench",
    formula="F_i = -k_d w_i (u_i - R^T W) in the rotor plane,  M = sum r_i x F_i",
    sentence="A steady wind pushes the vehicle to one side of the world, whichever way it points.",
    coefficients=(
        Coefficient(
            "k_d", "N s^2/(m rad)", 0.0, 5.0, "drag per rotor, rotor speed and air speed", scales.drag_per_rotor_speed
        ),
        Coefficient("W_x", "m/s", -_STRONGEST, _STRONGEST, "wind along x of the world"),
        Coefficient("W_y", "m/s", -_STRONGEST, _STRONGEST, "wind along y of the world"),
    ),
    needs=frozenset({"velocity", "rotor_speed"}),
    excitation="legs in opposite directions, and yaw turns in place",
    rivals={
        "torque_bias": "turn in yaw: a bias turns with the vehicle, the wind does not",
        "com_offset": "turn in yaw, and change the thrust",
        "rotor_drag": "fly legs in opposite directions",
        "products_of_inertia": "turn in yaw without rolling or pitching",
    },
    source="RotorPy multirotor.py (wind state); PX4 sih.cpp (v_apparent)",
    columns=_columns,
    physical=_physical,
    linear=_linear,
    holds=frozenset({"rotor_drag"}),
)

_DRAG, *_WIND = _EFFECT.coefficients
_EXACT = replace(
    _EFFECT,
    coefficients=(_DRAG,),
    shapes=tuple(Shape(each.name, each.unit, (each.low, 0.0, each.high), each.meaning) for each in _WIND),
    columns=_drag,
    physical=None,
    linear=None,
    apply=_blowing,
    still="rotor_drag",
)
EFFECT = replace(_EFFECT, exact=_EXACT)
