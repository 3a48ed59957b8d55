"""Steady wind: the rotor drag of a vehicle that does not move over the ground, and the air that all others meet."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.catalogue.rotor_drag import EFFECT as ROTOR_DRAG
from cpfls_cli.effects.catalogue.rotor_drag import drag_at_hubs
from cpfls_cli.effects.effect import Coefficient, Columns, Effect, Shape, columns_of, hub_wrench, stack
from cpfls_cli.effects.hooks import PhysicalNumbers, VehicleParts
from cpfls_cli.effects.signals import Signals

_STRONGEST = 15.0  # Bound of either component in m/s, 7 Beaufort: nobody flies a multirotor to learn from in more.


def _columns(signals: Signals, shape: Mapping[str, float]) -> Columns:
    still = signals if signals.wind is None else replace(signals, wind=None)
    in_plane = np.array([1.0, 1.0, 0.0])
    pushed = [signals.speed[..., None] * (signals.rotation[:, axis] * in_plane)[:, None] for axis in (0, 1)]
    blown = stack(*(hub_wrench(signals.hubs, force) for force in pushed))
    return Columns(np.concatenate([_drag(still, shape).direct, blown], axis=2))


_drag = columns_of(drag_at_hubs, ["k_d"])
"""Drag of all rotors for a unit of k_d."""


def _physical(linear: Array) -> Array:
    per_speed = linear[0]
    return np.array([per_speed, *(linear[1:] / per_speed if per_speed > 0 else (np.nan, np.nan))])


def _linear(physical: Array) -> Array:
    per_speed, x, y = physical
    return np.array([per_speed, per_speed * x, per_speed * y])


def _blowing(signals: Signals, shape: Mapping[str, float]) -> Signals:
    return replace(signals, wind=np.array([shape["W_x"], shape["W_y"], 0.0]))


def _in_vehicle(parts: VehicleParts, shape: Mapping[str, float], linear: Array) -> VehicleParts:
    """Take the wind apart: found in still air, it is no part of the vehicle, and what it blows against is one."""
    wind = shape["W_x"], shape["W_y"], 0.0
    return parts._replace(wind=wind, effects=(*parts.effects, (ROTOR_DRAG.name, {}, linear)))


_EFFECT = Effect(
    name="wind",
    order=120,
    title="steady wind",
    kind="wrench",
    formula="F_i = -k_d w_i (u_i - R^T W) in the rotor plane,  M = sum r_i x F_i",
    sentence="A steady wind pushes the vehicle to one side of the world, whichever way it points.",
    coefficients=(
        *ROTOR_DRAG.coefficients,
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
    physical=PhysicalNumbers(_physical, _linear),
    holds=frozenset({ROTOR_DRAG.name}),
)

_DRAG, *_WIND = _EFFECT.coefficients
_EXACT = replace(
    _EFFECT,
    coefficients=(_DRAG,),
    shapes=tuple(Shape(each.name, each.unit, (each.low, 0.0, each.high), each.meaning) for each in _WIND),
    columns=lambda signals, shape: _drag(_blowing(signals, shape), shape),
    physical=None,
    acts=drag_at_hubs,
    air=lambda values: (values["W_x"], values["W_y"], 0.0),
    apply=_blowing,
    in_vehicle=_in_vehicle,
)
EFFECT = replace(_EFFECT, exact=_EXACT)
