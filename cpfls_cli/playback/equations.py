"""Balances of torque and force along flights, which the vehicle writes itself: polynomials of its numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, pairwise
from math import prod
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.playback.evaluation import DRAG_OVER_THRUST, TIMES, VehicleAt, acting_numbers, inertia_entries
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.parameters import DRAG, LEARNED, LOG_MASS, SLOW, THRUST
from cpfls_cli.playback.rotors import TimeOfResponse
from cpfls_cli.playback.windows import Rotors
from cpfls_cli.vehicle.values import (
    ARRAYS,
    Polynomial,
    Tangent,
    Value,
    Vector,
    apply,
    cross,
    scaled,
    subtract,
    transposed,
    value_of,
)

_MASS = "mass"
_BODY = (*INERTIA_PARAMETERS, _MASS)
"""Numbers of the body that is moved."""


class Column(NamedTuple):
    """What balances are linear in: a product of numbers of the vehicle, along an axis.

    `by` names the time of the rotors' response by which it is differentiated; empty for none.
    """

    axis: int
    factors: tuple[str, ...]
    by: str


class Signals(NamedTuple):
    """What is balanced along a flight: what changes, whose derivative is taken, and what acts; (time, column) each."""

    changing: Array
    acting: Array


class Form(NamedTuple):
    """Columns of a balance of torque or of force, those of one axis after those of another.

    `changing` are those in which something changes, `acting` those in which something acts.
    """

    columns: tuple[Column, ...]
    changing: IntArray
    acting: IntArray

    @property
    def slices(self) -> list[slice]:
        """Columns of each axis."""
        ends = np.searchsorted([column.axis for column in self.columns], range(4)).tolist()
        return [slice(*pair) for pair in pairwise(ends)]


@dataclass(frozen=True)
class Equations:
    """Balances of torque and force of a vehicle at values of its numbers.

    They are evaluated as polynomials of the numbers, so that they follow at other values too.
    """

    at: VehicleAt

    def hold(self, other: Equations) -> bool:
        """Check whether those of another vehicle follow: its rotors respond alike, and it has no other numbers."""
        own, free = self.at.free, other.at.free
        # Numbers of a remainder mean something else with other rules; those of no remainder have none.
        rules = own.key[2:] == free.key[2:] or LEARNED.keys().isdisjoint(free.blocks)
        alike = own.vehicle == free.vehicle and rules and self.at.response == other.at.response
        # Only what is not 0 is differentiated by times of the response.
        return alike and {*free.index} <= {*own.index} and (not other.at.times or other._in_use <= self._in_use)

    @property
    def _in_use(self) -> set[str]:
        return {name for name, value in zip(self.at.free.index, self.at.values.tolist(), strict=True) if value}

    @cached_property
    def known(self) -> Mapping[str, Value]:
        """Numbers as they act, those of the body among them, with derivatives by the free numbers, by place."""
        at, index = self.at, self.at.free.index
        number = acting_numbers(at.free, lambda name: Tangent(at.get(name, 0.0), {index[name]: 1.0}))
        known = {name: number(name) for name in (*index, DRAG_OVER_THRUST)}
        known |= dict(zip(INERTIA_PARAMETERS, inertia_entries(at.free, number, ARRAYS), strict=True))
        return known | {_MASS: Tangent(at.mass, {index[LOG_MASS]: at.mass} if LOG_MASS in index else {})}

    def product(self, factors: Sequence[str]) -> Value:
        """Multiply `known` numbers; those that are not there are what they are in a model without them."""
        return prod((self.known.get(name, float(name in (THRUST, DRAG))) for name in factors), start=1.0)

    def along(self, flight: PlaybackFlight, translates: bool) -> tuple[list[Form], list[Signals]]:
        """Evaluate the balance of torque, and of force if asked for, along a flight."""
        forms, signals = [], []
        for balance in self._balances(flight, translates):
            parts = [
                {
                    Column(axis, factors, by): values
                    for axis, component in enumerate(vector)
                    for factors, by, values in self._terms(component)
                }
                for vector in balance
            ]
            columns = sorted(dict.fromkeys(chain(*parts)), key=lambda column: column.axis)
            filled = [np.empty((len(flight), len(part))) for part in parts]
            for out, part in zip(filled, parts, strict=True):
                for row, values in zip(out.T, part.values(), strict=True):
                    row[:] = values
            forms.append(Form(tuple(columns), *(np.array([columns.index(each) for each in part]) for part in parts)))
            signals.append(Signals(*filled))
        return forms, signals

    def weights(self, columns: Sequence[Column]) -> Array:
        """Weigh columns so that they give the residual, its derivatives by each number, and what the motion takes.

        Returns
        -------
        array, shape (column, 2 + number)
            Derivatives by numbers in their natural sizes.
        """
        index, scales = self.at.free.index, [number.scale for number in self.at.free.numbers]
        weights = np.zeros((len(columns), 2 + len(scales)))
        for row, (_, factors, by) in zip(weights, columns, strict=True):
            value = self.product(factors)
            slopes: Mapping[int, float] = value.by if isinstance(value, Tangent) else {}
            if by:
                slopes = {index[by]: value_of(value)} if by in index else {}
            else:
                row[0] = value_of(value)
                row[-1] = row[0] if any(name in _BODY for name in factors) else 0.0
            for place, slope in slopes.items():
                row[1 + place] = scales[place] * slope
        return weights

    def _balances(self, flight: PlaybackFlight, translates: bool) -> Iterator[tuple[Vector, Vector]]:
        """Write the balance of torque, body axes, then of force, world axes: what changes, and what acts against it."""
        motion, number = flight.motion, Polynomial.number
        rotation, velocity, rate = motion.rotation.transpose(1, 2, 0), tuple(motion.velocity.T), tuple(motion.rate.T)
        air = apply(transposed(rotation), velocity)
        torque, force = self.at.polynomial.wrench(air, rate, self._rotors(flight))
        xx, yy, zz, xy, xz, yz = map(number, INERTIA_PARAMETERS)
        momentum = apply(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)), rate)
        yield momentum, subtract(cross(rate, momentum), torque)
        if translates:
            weight = number(_MASS) * self.at.free.vehicle.gravity_m_s2
            yield scaled(number(_MASS), velocity), subtract((0, 0, weight), apply(rotation, force))

    def _rotors(self, flight: PlaybackFlight) -> Rotors:
        """Give what drives the vehicle at the samples, with derivatives by the times of the response."""

        def filled(terms: Callable[..., Array], *by: TimeOfResponse) -> Array:
            found = np.zeros((len(flight), 1 + 4 * flight.speed.shape[1]))
            for part in flight.stretches:
                found[part] = terms(flight.speed[part], flight.motion.period, flight.hold, *by)
            return found

        response, index = self.at.response, self.at.free.index
        slopes = {index[name]: filled(response.slope_at_samples, TIMES[name]) for name in self.at.times}
        if SLOW in index:
            # The number is the logarithm of the slow time.
            slopes[index[SLOW]] *= response.slow_s
        return Rotors.of(filled(response.terms_at_samples), slopes)

    def _terms(self, component: Value) -> Iterator[tuple[tuple[str, ...], str, Value]]:
        """List the terms of a polynomial, then the derivatives by times of the response of those that are not 0."""
        for factors, value in Polynomial.of(component).terms.items():
            yield factors, "", value_of(value)
            if isinstance(value, Tangent) and value_of(self.product(factors)):
                for place, slope in value.by.items():
                    yield factors, self.at.free.numbers[place].name, slope
