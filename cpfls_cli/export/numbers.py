"""Simulators with numbers of their own: their published equations as weights, and the numbers that come nearest."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.effects.scales import arm, hover_speed
from cpfls_cli.export.polynomials import TERMS, motion_terms, weights_of, weights_of_model
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.rotations import rotation_matrix
from cpfls_cli.vehicle.motion import Acting, Acts, Instant, Wrench
from cpfls_cli.vehicle.rotors import allocation_matrix
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.values import Each

_ROLL, _PITCH, _YAW, _UP = 0, 1, 2, 5
_PROBES = 900


@dataclass(frozen=True)
class Numbers:
    """A simulator's numbers, each with the torque and force that it gives per unit.

    `tables`: shape (number, 6, terms, 1 + 4 rotors); `size`: natural size of what one weight does.
    """

    names: tuple[str, ...]
    tables: Array
    size: Array

    @cached_property
    def _inverse(self) -> Array:
        """From weights in their sizes to the numbers."""
        rows = (self.tables * self.size).reshape(len(self.names), -1)
        length = np.linalg.norm(rows, axis=1)
        return np.asarray(np.linalg.pinv((rows / length[:, None]).T) / length[:, None])

    def of(self, weights: Array) -> dict[str, float]:
        """Find the numbers whose torque and force come nearest to those of a table of weights."""
        return dict(zip(self.names, (self._inverse @ (weights * self.size).ravel()).tolist(), strict=True))

    def holds(self, weights: Array) -> Array:
        """Give the weights of the nearest numbers, shape (6, terms, 1 + 4 rotors)."""
        return np.asarray(np.tensordot(list(self.of(weights).values()), self.tables, axes=1))


Wrenches = Callable[[Instant], Mapping[str, Wrench]]
"""From what is seen to torque and force per unit of numbers."""


def numbers_of(model: VehicleModel, wrenches: Wrenches, *, alike: bool) -> Numbers:
    """Arrange the numbers of a simulator whose rotors give thrust and yaw torque by their squared speeds.

    `wrenches` is what it knows besides these; `alike` asks for one thrust and one torque factor of all rotors.
    """
    rotors, hubs = model.rotors, places(model, alike=alike)
    moved = tuple(replace(rotor, position_m=tuple(hub)) for rotor, hub in zip(model.vehicle.rotors, hubs, strict=True))
    vehicle = replace(model.vehicle, rotors=moved)
    names = wrenches(Instant(vehicle, Each([1.0] * rotors), (1.0,) * 3, (1.0,) * 3))
    acting = [Acting(name, _one_of(wrenches, name)) for name in names]
    tables = _squares(model.vehicle, alike) | weights_of(acting, vehicle)
    row = np.repeat([1 / arm(model.vehicle), 1.0], 3)
    hover = hover_speed(model.vehicle)
    # All rotors count alike, so that numbers of all rotors are means.
    turning = np.concatenate([[1.0], np.repeat([hover, hover**2, hover, hover**2], rotors)])
    size = row[:, None, None] * _sizes(rotors)[:, None] * turning
    return Numbers(tuple(tables), np.array(list(tables.values())), size)


def _one_of(wrenches: Wrenches, name: str) -> Acts:
    return lambda see, _p: wrenches(see)[name]


@cache
def _sizes(rotors: int) -> Array:
    """Size the terms of the motion by motions at random, shape (terms,)."""
    rng = np.random.default_rng(0)
    rng.uniform(0.5, 1.5, (_PROBES, rotors))
    rate, attitude, velocity = (rng.uniform(-size, size, (_PROBES, 3)) for size in (2.0, 1.0, 3.0))
    air = np.einsum("tji,tj->ti", rotation_matrix(attitude), velocity)
    return np.asarray(np.sqrt((motion_terms(air, rate) ** 2).mean(axis=0)))


def places(model: VehicleModel, *, alike: bool) -> Array:
    """Find where rotors have to stand so that their thrust gives the torque of the model, shape (rotor, 3), m."""
    squares = weights_of_model(model)[:, 0, 1 + model.rotors : 1 + 2 * model.rotors]
    thrust = np.full(model.rotors, squares[_UP].mean()) if alike else squares[_UP]
    hubs = np.array([rotor.position_m for rotor in model.vehicle.rotors], dtype=float)
    return np.column_stack([-squares[_PITCH] / thrust, squares[_ROLL] / thrust, hubs[:, 2]])


def spins(vehicle: VehicleSettings) -> Array:
    """Give the sign of the yaw torque of each rotor, shape (rotor,)."""
    return np.asarray(np.sign(allocation_matrix(vehicle)[3]), dtype=float)


def cross_order(vehicle: VehicleSettings, autopilot: str) -> IntArray | None:
    """Give the rotor of the config that is each motor of an autopilot's X; None where rotors are not in an X."""
    sides = [tuple(np.sign(np.round(rotor.position_m[:2], 4)).astype(int).tolist()) for rotor in vehicle.rotors]
    wanted = [each[:2] for each in AUTOPILOTS[autopilot].cross]
    return np.array([sides.index(each) for each in wanted]) if sorted(sides) == sorted(wanted) else None


def _squares(vehicle: VehicleSettings, alike: bool) -> dict[str, Array]:
    """Give the weights of thrust, yaw torque and levers by squared speeds."""
    rotors, turns = len(vehicle.rotors), spins(vehicle)
    tables: dict[str, Array] = {}
    groups: Sequence[tuple[str, list[int]]] = [(f"_{i + 1}", [i]) for i in range(rotors)]
    for suffix, own in [("", list(range(rotors)))] if alike else groups:
        for name, row, signs in ((f"thrust{suffix}", _UP, np.ones(rotors)), (f"yaw{suffix}", _YAW, turns)):
            tables[name] = np.zeros((6, len(TERMS), 1 + 4 * rotors))
            tables[name][row, 0, [1 + rotors + i for i in own]] = signs[own]
    for suffix, own in groups:
        for name, row in (("roll", _ROLL), ("pitch", _PITCH)):
            tables[f"{name}{suffix}"] = np.zeros((6, len(TERMS), 1 + 4 * rotors))
            tables[f"{name}{suffix}"][row, 0, 1 + rotors + own[0]] = 1.0
    return tables
