"""Simulators with numbers of their own: their equations as weights, the numbers that come nearest, as polynomials.

What acts on a vehicle is weights of terms, each of the motion times one of the rotors. Polynomials are numbers that the
vehicle is evaluated with (`cpfls_cli.vehicle.values`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from itertools import combinations_with_replacement, product
from types import MappingProxyType

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.effects.scales import arm, hover_speed
from cpfls_cli.export.points import parts_of
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.rotations import rotation_matrix
from cpfls_cli.vehicle.motion import Acting, Acts, Instant, Wrench
from cpfls_cli.vehicle.rotors import allocation_matrix
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.tracing import SYMBOLS
from cpfls_cli.vehicle.values import Each, Functions, NoPolynomialError, Polynomial, Value, Vector

_AXES = "uvwpqr"
_PAIRS = (*combinations_with_replacement("uvw", 2), *product("uvw", "pqr"), *combinations_with_replacement("pqr", 2))
_PRODUCTS = ((), *((axis,) for axis in _AXES), *_PAIRS)
_SIGNED = (*(("|u|", axis) for axis in "uvw"), *((f"|{axis}|", axis) for axis in "pqr"))
TERMS = (*(tuple(each) for each in _PRODUCTS), *_SIGNED)
"""Factors of each term of the motion: air velocity u v w, of the length |u|, and body rate p q r."""
_PLACES = {tuple(sorted(factors)): place for place, factors in enumerate(TERMS)}


def _root(x: Value) -> Value:
    if not isinstance(x, Polynomial):
        return math.sqrt(x)
    if {factors: value for factors, value in x.terms.items() if value} != {(axis, axis): 1.0 for axis in "uvw"}:
        raise NoPolynomialError
    return Polynomial({("|u|",): 1.0})


def _size(x: Value) -> Value:
    if not isinstance(x, Polynomial):
        return abs(x)
    ((factors, value),) = x.terms.items()
    if len(factors) != 1 or factors[0] not in "pqr":
        raise NoPolynomialError
    return Polynomial({(f"|{factors[0]}|",): abs(value)})


def _none(*_given: Value) -> Value:
    raise NoPolynomialError


_FUNCTIONS = Functions(*(_root, _none, _none, _none, _none, _none, _size, _none, _none, _none, Each, SYMBOLS.total))


def _symbols(names: Iterable[str]) -> tuple[Polynomial, ...]:
    return tuple(map(Polynomial.number, names))


@cache
def _of_rotors(rotors: int) -> dict[tuple[str, ...], int]:
    forms = (("w{0}",), ("w{0}", "w{0}"), ("a{0}",), ("z{0}",))
    found: list[tuple[str, ...]] = [()]
    found += [tuple(each.format(rotor) for each in form) for form in forms for rotor in range(rotors)]
    return {factors: place for place, factors in enumerate(found)}


def weights_of(acting: Iterable[Acting], vehicle: VehicleSettings) -> dict[str, Array]:
    """Weigh the terms of each part alone, shape (6, terms, 1 + 4 rotors); without what is no sum of weights.

    Rows are torque and force, N m and N, body frame; terms of rotors those of `RotorResponse.terms_by_step`.
    """
    acting, count = tuple(acting), len(vehicle.rotors)
    speed, turning, late = (_symbols(f"{name}{rotor}" for rotor in range(count)) for name in "waz")
    slow = Each(z + w * w for z, w in zip(late, speed, strict=True))
    motion = (_symbols("uvw"), _symbols("pqr"), Each(speed), Each(turning), slow)
    known = [one for one in acting if _is_polynomial(one, vehicle, motion)]
    return {name: _weighed(wrench, count) for name, wrench in parts_of(known, vehicle, motion, _FUNCTIONS)}


def _is_polynomial(one: Acting, vehicle: VehicleSettings, motion: Sequence[Value]) -> bool:
    try:
        for _, wrench in parts_of([one], vehicle, motion, _FUNCTIONS):
            _weighed(wrench, len(vehicle.rotors))
    except NoPolynomialError:
        return False
    return True


def _weighed(wrench: Vector, rotors: int) -> Array:
    weights, of_rotors = np.zeros((6, len(TERMS), 1 + 4 * rotors)), _of_rotors(rotors)
    for row, component in zip(weights, wrench, strict=True):
        for factors, value in Polynomial.of(component).terms.items():
            moving = tuple(each for each in factors if each in _MOVING)
            turning = tuple(each for each in factors if each not in _MOVING)
            if value and not (moving in _PLACES and turning in of_rotors):
                raise NoPolynomialError
            if value:
                row[_PLACES[moving], of_rotors[turning]] += value
    return weights


_MOVING = {each for factors in TERMS for each in factors}
_FACTOR_NAMES = ("", *_AXES, "|u|", "|p|", "|q|", "|r|")
_FACTORS = np.transpose(
    [[_FACTOR_NAMES.index(each) for each in (*factors, *[""] * (2 - len(factors)))] for factors in TERMS]
)
"""Places of both factors of each term; of one, or of none, others are 1."""


@lru_cache(maxsize=8)
def weights_by_part(model: VehicleModel) -> Mapping[str, Array]:
    """Weigh the terms of all parts of a model, see `weights_of`; cached, because each target asks for it several times.

    Nobody may write to it.
    """
    weights = weights_of(model.parts, model.vehicle)
    for each in weights.values():
        each.setflags(write=False)
    return MappingProxyType(weights)


def weights_of_model(model: VehicleModel) -> Array:
    """Weigh the terms of all that is a sum of weights, shape (6, terms, 1 + 4 rotors)."""
    return np.asarray(sum(weights_by_part(model).values()))


def motion_terms(air: Array, rate: Array) -> Array:
    """Evaluate the terms of the motion, shape (time, terms), of velocity through the air and rate, body frame, SI."""
    known = [np.ones(len(air)), *air.T, *rate.T, np.linalg.norm(air, axis=1), *np.abs(rate.T)]
    first, second = np.stack(known)[_FACTORS]
    return np.asarray(first * second).T


_ROLL, _PITCH, _YAW, _UP = 0, 1, 2, 5
_PROBES, _LEAST = 900, 1e-6


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
        """Find the numbers whose torque and force come nearest to those of a table of weights.

        What is linear in the speeds is as much by their squares in hover where no number is, so that it hovers as fast.
        """
        sized, rotors = weights * self.size, (weights.shape[2] - 1) // 4
        linear, squares = slice(1, 1 + rotors), slice(1 + rotors, 1 + 2 * rotors)
        rows = ~self.tables[:, :, 0, linear].any(axis=(0, 2))
        sized[rows, 0, squares] += sized[rows, 0, linear]
        return dict(zip(self.names, (self._inverse @ sized.ravel()).tolist(), strict=True))

    def holds(self, weights: Array) -> Array:
        """Give the weights of the nearest numbers, shape (6, terms, 1 + 4 rotors)."""
        return np.asarray(np.tensordot(list(self.of(weights).values()), self.tables, axes=1))


Wrenches = Callable[[Instant], Mapping[str, Wrench]]
"""From what is seen to torque and force per unit of numbers."""


def numbers_of(model: VehicleModel, wrenches: Wrenches, *, alike: bool, lines: bool = False) -> Numbers:
    """Arrange the numbers of a simulator whose rotors give thrust and yaw torque by their squared speeds.

    `wrenches` is what it knows besides these, and `lines` whether thrust that is linear in the speeds is among it;
    `alike` asks for one thrust and one torque factor of all rotors.
    """
    rotors, hubs = model.rotors, places(model, alike=alike, lines=lines)
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


def places(model: VehicleModel, *, alike: bool, lines: bool = False) -> Array:
    """Find where rotors have to stand so that their thrust gives the torque of the model, shape (rotor, 3), m."""
    _, linear, squares, *_ = np.split(weights_of_model(model)[:, 0], 1 + model.rotors * np.arange(4), axis=1)
    whole = squares + linear / hover_speed(model.vehicle)
    # Where next to nothing is a square the lines are all that has a lever.
    squares = squares if lines and (np.abs(squares[_UP]) > _LEAST * np.abs(whole[_UP])).all() else whole
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
