"""What acts on a vehicle as weights of terms, each of the motion times one of the rotors: what simulators are made of.

Polynomials are numbers that the vehicle is evaluated with (`cpfls_cli.vehicle.values`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cache
from itertools import combinations_with_replacement, product

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.export.acting import parts_of
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.vehicle.motion import Acting
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.tracing import SYMBOLS
from cpfls_cli.vehicle.values import Each, Functions, NoPolynomialError, Polynomial, Value, Vector

_AXES = "uvwpqr"
_PAIRS = (
    *combinations_with_replacement("uvw", 2),
    *product("uvw", "pqr"),
    *combinations_with_replacement("pqr", 2),
)
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


_FUNCTIONS = Functions(
    *(_root, _none, _none, _none, _none, _none, _size, _none, _none, _none, Each, SYMBOLS.total),
)


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


def weights_of_model(model: VehicleModel) -> Array:
    """Weigh the terms of all that is a sum of weights, shape (6, terms, 1 + 4 rotors)."""
    return np.asarray(sum(weights_of(model.parts, model.vehicle).values()))


def motion_terms(air: Array, rate: Array) -> Array:
    """Evaluate the terms of the motion, shape (time, terms), of velocity through the air and rate, body frame, SI."""
    sizes = {f"|{axis}|": np.abs(own) for axis, own in zip("pqr", rate.T, strict=True)}
    values = dict(zip(_AXES, [*air.T, *rate.T], strict=True)) | sizes | {"|u|": np.linalg.norm(air, axis=1)}
    return np.stack(
        [math.prod((values[each] for each in factors), start=np.ones(len(air))) for factors in TERMS], axis=1
    )
