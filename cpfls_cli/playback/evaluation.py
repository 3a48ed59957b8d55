"""A vehicle at values of its free numbers: its model, what people read of it, and its derivatives by the numbers.

That of several configurations at once too: numbers that they share, numbers of their own, and what differs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.registry import CATALOGUE, CENTRE_OF_MASS, THRUST_CURVE
from cpfls_cli.estimation.estimate import Prior
from cpfls_cli.inertia import INERTIA_ENTRIES, INERTIA_PARAMETERS, six_parameters, symmetric
from cpfls_cli.playback.flight import Body, PlaybackFlight
from cpfls_cli.playback.model import ModelEffect, VehicleModel, learned_wrench, of_thrust
from cpfls_cli.playback.parameters import (
    AS_STATED,
    COUNTED,
    CURVE,
    DELAY,
    DRAG,
    INERTIA,
    LAG,
    LEARNED,
    LOG_INERTIA,
    LOG_MASS,
    MASS,
    PRODUCT_NAMES,
    SLOW,
    SLOW_SHARES,
    THRUST,
    FreeNumbers,
    Number,
    Physical,
    of_vehicle,
    unit_wrenches,
)
from cpfls_cli.playback.rotors import RotorResponse, TimeOfResponse
from cpfls_cli.playback.windows import STATES, Flown, Rotors, Slopes
from cpfls_cli.vehicle.motion import Acting, Instant, Numbers, Vehicle, Wrench, rotor_wrench
from cpfls_cli.vehicle.rotors import with_factors
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.tracing import Graph, Symbol, array_symbols, traced_in_two
from cpfls_cli.vehicle.values import ARRAYS, Functions, Polynomial, Tangent, Value, Vector, dot, inverse, times, zero

_POSITIVE = {
    **{log: (f"inertia.{name}", "kg m^2") for log, name in zip(LOG_INERTIA, INERTIA_PARAMETERS, strict=False)},
    THRUST: ("thrust_factor", "N s^2"),
    DRAG: ("drag_factor", "N m s^2"),
    LOG_MASS: ("mass", "kg"),
    SLOW: ("slow_actuation.slow_s", "s"),
}
"""Numbers of a fit that people know by another name and unit, and that cannot be below 0."""
TIMES: Mapping[str, TimeOfResponse] = {DELAY: "delay_s", LAG: "lag_s", SLOW: "slow_s"}
"""Times of the response that numbers are."""
DRAG_OVER_THRUST = "drag_over_thrust"
"""By how much more the drag factor differs from the stated one than the thrust factor does."""


@dataclass(frozen=True)
class ParameterPoint:
    """The vehicle that values of its free numbers make."""

    free: FreeNumbers
    values: Array

    def get(self, name: str, otherwise: float) -> float:
        """Give the value of a number, or another one where it is not free."""
        return float(self.values[self.free.index[name]]) if name in self.free.index else otherwise

    @cached_property
    def inertia(self) -> Array:
        """Inertia tensor, shape (3, 3), kg m^2."""
        return symmetric(inertia_entries(self.free, lambda name: self.get(name, 0.0), ARRAYS))

    @property
    def response(self) -> RotorResponse:
        """Response of the rotors, its shares of what these rotors give."""
        level, turn = (self.get(name, 0.0) * self.get(THRUST, 1.0) / self._hover[0] for name in SLOW_SHARES)
        return RotorResponse(
            delay_s=self.get(DELAY, 0.0),
            lag_s=self.get(LAG, self.free.lag_s),
            slow_roll_pitch=level,
            slow_yaw=turn,
            slow_s=float(np.exp(self.get(SLOW, float(np.log(RotorResponse().slow_s))))),
        )

    @cached_property
    def _acting_number(self) -> Callable[[str], Value]:
        return acting_numbers(self.free, lambda name: self.get(name, 0.0))

    @cached_property
    def coefficients(self) -> Mapping[str, float]:
        """Coefficients of effects and remainder in SI, by name."""
        return {name: float(self._acting_number(name)) for name in self.free.shares}

    @property
    def mass(self) -> float:
        """Mass, kg."""
        return self.free.vehicle.mass_kg * float(np.exp(self.get(LOG_MASS, 0.0)))

    @cached_property
    def vehicle(self) -> VehicleSettings:
        """The vehicle with what was found as its own numbers, and rotors that carry it in hover by their squares."""
        thrust = self._hover[0]
        found = with_factors(self.free.vehicle, thrust, thrust * float(self._acting_number(DRAG_OVER_THRUST)))
        xx, yy, zz, xy, xz, yz = (float(self.inertia[entry]) for entry in INERTIA_ENTRIES)
        inertia = (xx, yy, zz, xy, xz, yz)
        return replace(found, mass_kg=self.mass, inertia_kg_m2=inertia, unknown=())

    @cached_property
    def _hover(self) -> tuple[float, float]:
        """Thrust per squared speed in hover, relative to what is stated, and what share is linear in the speed there.

        A curve of the thrust is fitted as it is where the vehicle as stated hovers; this one hovers elsewhere.
        """
        linear, heavier = self.get(CURVE, 0.0), self.mass / self.free.vehicle.mass_kg
        square = self.get(THRUST, 1.0) - linear
        # Of thrust that no speed carries the weight with, the largest.
        root = np.sqrt(max(linear**2 + 4.0 * square * heavier, 0.0))
        faster = 2.0 * heavier / (linear + root)
        thrust = heavier / faster**2
        return float(thrust), float(linear / (thrust * faster))

    @cached_property
    def effects(self) -> tuple[ModelEffect, ...]:
        """Effects, their coefficients counted on this vehicle and not on the stated one: some share its thrust."""
        effects = []
        # As runs fly them: with the stated thrust, and a drag that changed by as much more than the thrust.
        flown = with_factors(self.free.vehicle, 1.0, self._acting_number(DRAG_OVER_THRUST))
        for block in self.free.effects:
            before, found = (unit_wrenches(block, vehicle) for vehicle in (flown, self.vehicle))
            ratio = (before * found).sum(axis=(1, 2)) / (found**2).sum(axis=(1, 2))
            known, places = of_vehicle(block, self.vehicle)
            own = np.zeros(len(known.coefficients))
            own[places] = [self.coefficients[number.name] for number in self.free.of_block(block)] * ratio
            if block == THRUST_CURVE.name:
                own[0] = self._hover[1]
            effects.append(ModelEffect(block, {}, own))
        return tuple(effects)

    @property
    def model(self) -> VehicleModel:
        """The model, with what was found as numbers of the vehicle."""
        learned = [block for block in self.free.blocks if block in LEARNED]
        names = (number.name for block in learned for number in self.free.of_block(block))
        unnamed = np.array([self.coefficients[name] for name in names])
        return VehicleModel(
            vehicle=self.vehicle,
            response=self.response,
            effects=self.effects,
            remainder=self.free.remainder(learned, unnamed) if learned else None,
        )

    @property
    def physical(self) -> dict[str, Physical]:
        """All numbers as people know them, in order: moments of inertia, factors of the first rotor, SI."""
        free = self.free
        entries = (self.inertia.item(entry) for entry in INERTIA_ENTRIES)
        stated = dict(zip((*LOG_INERTIA, *PRODUCT_NAMES), entries, strict=True))
        stated |= {
            THRUST: self.vehicle.rotors[0].thrust_factor_n_s2,
            DRAG: self.vehicle.rotors[0].drag_factor_n_m_s2,
            LOG_MASS: self.mass,
        }
        response = self.response
        shares = zip(SLOW_SHARES, (response.slow_roll_pitch, response.slow_yaw), strict=True)
        others = {SLOW: response.slow_s, **dict(shares), **self.coefficients}
        for effect in self.effects:
            names = (number.name for number in free.of_block(effect.name))
            _, places = of_vehicle(effect.name, self.vehicle)
            others |= dict(zip(names, effect.coefficients[places].tolist(), strict=True))
        found: dict[str, Physical] = {}
        for number, value in zip(free.numbers, self.values.tolist(), strict=True):
            name, unit = _POSITIVE.get(number.name, (number.name, number.unit))
            found[name] = Physical(
                stated.get(number.name, others.get(number.name, value)),
                unit,
                positive=number.name in _POSITIVE,
                stated=number.name in stated and number.block not in free.vehicle.unknown,
            )
        return found

    def rotor_terms(self, flight: PlaybackFlight, samples: IntArray, by: str = "") -> Array:
        """Evaluate the terms of the rotors over the steps that begin at samples of a flight.

        Parameters
        ----------
        by : str
            Number of the response that they are differentiated by; empty for the terms themselves.

        Returns
        -------
        array, shape (samples, 1 + 4 rotors)
        """
        if not by:
            return np.asarray(flight.rotor_terms(*self.times_of_response)[samples])
        response, slow = self.response, SLOW in self.free.index
        slopes = flight.of_speeds(partial(response.terms_by_step, by=TIMES[by], slow=slow))
        # The number is the logarithm of the slow time.
        return np.asarray(slopes[samples] * (response.slow_s if by == SLOW else 1.0))

    @cached_property
    def times_of_response(self) -> tuple[float, float, float | None]:
        """Delay, lag and slow time of the rotors, s; None where nothing is slow."""
        response = self.response
        return response.delay_s, response.lag_s, response.slow_s if SLOW in self.free.index else None

    @property
    def times(self) -> list[str]:
        """Numbers that are times of the rotors' response."""
        return [name for name in TIMES if name in self.free.index]

    def flown(self, period: float, *, translates: bool, pushed: bool = False) -> Flown:
        """Give the vehicle as runs fly it, by its steps as one function, which is all that it has.

        Parameters
        ----------
        pushed : bool
            Whether something pushes on top.
        """
        function = traced_step(self.free, self._nothing, translates, pushed)((period, *self.values.tolist()))
        return Flown(Vehicle(self.free.vehicle, ()), self._body, traced=function)

    def slopes(self, pushes: int = 0) -> Slopes:
        """Differentiate its accelerations by all numbers, or by those of what pushes on top."""
        numbers, places, function = traced_slopes(self.free, self._nothing, pushes)
        return Slopes(numbers, places, function(tuple(self.values.tolist())))

    @property
    def _nothing(self) -> tuple[bool, ...]:
        """Which numbers are 0: what they are factors of is not evaluated, only their derivatives are.

        None where they are few: a function for each such set takes longer to make than what it leaves out.
        """
        nothing = self.values == 0
        return tuple((nothing & (2 * nothing.sum() >= len(nothing))).tolist())

    @cached_property
    def polynomial(self) -> Flown:
        """The vehicle as a polynomial of its numbers, coefficients in SI."""
        acting, drag_scale = acting_at(self.free, Polynomial.number)
        return Flown(Vehicle(self.free.vehicle, acting), self._body, drag_scale)

    @property
    def _body(self) -> Body:
        return Body.of(replace(self.free.vehicle, mass_kg=self.mass), self.inertia)


def inertia_entries(free: FreeNumbers, number: Callable[[str], Value], functions: Functions) -> tuple[Value, ...]:
    """Give the entries of the inertia tensor by `INERTIA_ENTRIES`, kg m^2, from free numbers of any kind."""
    logs, products = ([number(n) if n in free.index else 0.0 for n in each] for each in (LOG_INERTIA, PRODUCT_NAMES))
    root = [functions.exp(0.5 * log) for log in logs]
    stated = six_parameters(free.vehicle.inertia_kg_m2).tolist()
    tensor = [entry + own for entry, own in zip(stated, (0.0, 0.0, 0.0, *products), strict=True)]
    pairs = zip(tensor, INERTIA_ENTRIES, strict=True)
    return tuple(times(times(root[row], entry), root[column]) for entry, (row, column) in pairs)


def acting_numbers(
    free: FreeNumbers, number: Callable[[str], Value], functions: Functions = ARRAYS
) -> Callable[[str], Value]:
    """Give numbers as they act, by name, of any kind: coefficients in SI, not in units of the inertia."""
    index = free.index
    counted = [number(name) if name in index else 0.0 for name in free.counting]

    def given(name: str) -> Value:
        if name == DRAG_OVER_THRUST:
            thrust, drag = (number(each) if each in index else 1.0 for each in (THRUST, DRAG))
            return drag / thrust
        share = free.shares.get(name)
        return number(name) if share is None else number(name) * functions.exp(dot(share.tolist(), counted))

    return given


def acting_at(free: FreeNumbers, number: Callable[[str], Value]) -> tuple[tuple[Acting, ...], Value]:
    """List what acts on a vehicle of free numbers, and the ratio of the drag factors that effects share."""
    index = free.index

    def given(name: str, otherwise: float) -> Value:
        return number(name) if name in index else otherwise

    thrust, drag = given(THRUST, 1.0), given(DRAG, 1.0)
    numbers = {"slow_roll_pitch": given(SLOW_SHARES[0], 0.0), "slow_yaw": given(SLOW_SHARES[1], 0.0)}

    def rotors(see: Instant, p: Numbers) -> Wrench:
        return rotor_wrench(see.moved(thrust_scale=thrust, drag_scale=drag), p)

    acting = [Acting("rotors", rotors, numbers)]
    for block in free.effects:
        known = CATALOGUE[block]
        assert known.acts is not None, "blocks have it"
        acts = of_thrust(known.acts) if known.of_all_forces else known.acts
        own = {each.name.split(".")[1]: number(each.name) for each in free.of_block(block)}
        acting.append(Acting(block, acts, own))
    learned = [block for block in free.blocks if block in LEARNED]
    if learned:
        names = [each.name for block in learned for each in free.of_block(block)]
        values = np.empty(len(names), dtype=object)
        values[:] = [number(name) for name in names]
        remainder = free.remainder(learned, np.zeros(len(names)))
        acting.append(Acting("remainder", learned_wrench(remainder, values.reshape(remainder.coefficients.shape))))
    return tuple(acting), number(DRAG_OVER_THRUST)


class _Traced:
    """A vehicle of symbols, and its numbers."""

    def __init__(self, free: FreeNumbers, nothing: tuple[bool, ...], *, differentiated: bool = False) -> None:
        vehicle, self.free, self.graph = free.vehicle, free, Graph()
        self.values = self.graph.inputs("number", len(free.numbers))
        known = [0.0 if none else symbol for none, symbol in zip(nothing, self.values, strict=True)]
        symbols = dict(zip(free.index, known, strict=True))

        def number(name: str) -> Value:
            return Tangent(symbols[name], {STATES + free.index[name]: 1.0}) if differentiated else symbols[name]

        functions = array_symbols(len(vehicle.rotors))
        acting, drag_scale = acting_at(free, acting_numbers(free, number, functions))
        xx, yy, zz, xy, xz, yz = inertia_entries(free, number, functions)
        inertia: Any = (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)
        inverted: Any = inverse(inertia)
        growth = functions.exp(number(LOG_MASS)) if LOG_MASS in free.index else 1.0
        body = Body(growth * vehicle.mass_kg, vehicle.gravity_m_s2, inertia, inverted)
        self.flown = Flown(Vehicle(vehicle, acting), body, drag_scale, functions=functions)

    def inputs(self, name: str, count: int) -> tuple[Symbol, ...]:
        """Make arguments with one value for each rotor."""
        return self.graph.inputs(name, count, rotors=len(self.free.vehicle.rotors))


@lru_cache(maxsize=256)
def traced_step(
    free: FreeNumbers, nothing: tuple[bool, ...], translates: bool, pushed: bool
) -> Callable[..., Callable[..., tuple[Vector, Vector]]]:
    """Make a function of a period and of numbers that gives one of a step of the vehicle; see `Flown.traced`.

    `nothing` says which of the numbers are 0.
    """
    own = _Traced(free, nothing)
    period, state, rotors = *own.graph.inputs("period", 1), own.graph.inputs("state", 18), own.inputs("rotors", 3)
    push = own.graph.inputs("push", 6 if pushed else 0)
    step = own.flown.stepped(state, Rotors(rotors[0], rotors[1], rotors[2], push or None), period, translates)
    arguments = {"state": state, "rotors": rotors, "push": push}
    return traced_in_two(own.graph, ("number", (period, *own.values)), arguments, step[:2], short=True)


@lru_cache(maxsize=256)
def traced_slopes(
    free: FreeNumbers, nothing: tuple[bool, ...], pushes: int
) -> tuple[int, tuple[tuple[int, int], ...], Callable[..., Callable[..., Vector]]]:
    """Make a function of the numbers that gives derivatives of the accelerations; see `Slopes`.

    `nothing` says which of the numbers are 0. With so many `pushes` on top it is differentiated by those, and not by
    the numbers of the vehicle.
    """
    own = _Traced(free, nothing, differentiated=not pushes)
    motion, rotors = own.graph.inputs("motion", 15), own.inputs("rotors", 3)
    times_of = [free.index[name] for name in TIMES if name in free.index and not pushes]
    by = own.inputs("by", 3 * len(times_of))
    push, push_by = (own.graph.inputs(n, 6 * count) for n, count in (("push", min(pushes, 1)), ("push_by", pushes)))
    slopes: tuple[dict[int, Value], ...] = {}, {}, {}
    for place, first in zip(sorted(times_of), range(0, len(by), 3), strict=True):
        faster, change, late = by[first : first + 3]
        for slope, moved in zip(slopes, (faster, change, late + 2.0 * rotors[0] * faster), strict=True):
            slope[STATES + place] = moved
    speed, acceleration, slow = (Tangent(x, own) if own else x for x, own in zip(rotors, slopes, strict=True))
    pushed = tuple(
        Tangent(x, {STATES + place: push_by[6 * place + row] for place in range(pushes)}) for row, x in enumerate(push)
    )
    driven = Rotors(speed, acceleration, slow, pushed or None)
    found = own.flown.accelerations(motion[:3], motion[3:12], motion[12:], driven)
    by_place = {
        (row + 3 * (row >= 3), column): slope
        for row, x in enumerate(found)
        for column, slope in (x.by.items() if isinstance(x, Tangent) else ())
        if not zero(slope)
    }
    arguments = {"motion": motion, "rotors": rotors, "by": by, "push": push, "push_by": push_by}
    made = traced_in_two(own.graph, ("number", own.values), arguments, [tuple(by_place.values())])

    def at(values: tuple[float, ...]) -> Callable[..., Vector]:
        function = made(values)
        return lambda *given: function(*given)[0]

    return pushes or len(free.numbers), tuple(by_place), at


CENTRE = tuple(f"{CENTRE_OF_MASS.name}.{coefficient.name}" for coefficient in CENTRE_OF_MASS.coefficients)
"""Numbers of a fit that say where the centre of mass is, ahead and to the left."""

PRIOR = 1e-5
"""Weight of what is believed before the flights, so small that it decides only what they do not identify."""

OF_A_WEIGHT = (MASS, CENTRE_OF_MASS.name, INERTIA)
"""Blocks that an added weight changes."""


class Group(NamedTuple):
    """A configuration of the vehicle, and the blocks of numbers that it has of its own."""

    name: str
    differs: tuple[str, ...]


def _column(name: str) -> cached_property[Array]:
    """Gather what all numbers have by a name, shape (number,)."""

    def column(free: JointNumbers) -> Array:
        return np.array([getattr(number, name) for number in free.numbers], dtype=float)

    return cached_property(column)


@dataclass(frozen=True)
class JointNumbers:
    """The free numbers of all configurations: those of the vehicle of the config, then what others have of theirs."""

    base: FreeNumbers
    groups: tuple[Group, ...] = ()

    @cached_property
    def _by_group(self) -> dict[str, FreeNumbers]:
        found = {"": self.base}
        for group in self.groups:
            more = [block for block in group.differs if block not in self.base.blocks]
            if INERTIA in group.differs:
                more.append(COUNTED if INERTIA in self.base.blocks else AS_STATED)
            found[group.name] = replace(self.base, chosen=(*self.base.chosen, *more))
        return found

    @cached_property
    def numbers(self) -> tuple[Number, ...]:
        """All numbers."""
        return (
            *self.base.numbers,
            *(
                replace(number, name=f"{group.name}: {number.name}")
                for group in self.groups
                for number in self._by_group[group.name].numbers
                if number.block in group.differs
            ),
        )

    @cached_property
    def index(self) -> dict[str, int]:
        """Place of each number by name."""
        return {number.name: place for place, number in enumerate(self.numbers)}

    starts = _column("start")
    """Stated numbers."""
    scales = _column("scale")
    """Natural sizes of changes."""
    lows, highs = _column("low"), _column("high")
    """Bounds."""
    spreads = _column("spread")
    """Standard deviations of what is believed before, in scales."""

    @cached_property
    def prior(self) -> Prior:
        """What is believed before flights are seen, in scales."""
        return Prior(self.starts / self.scales, self.spreads / np.sqrt(PRIOR))

    def named(self, values: Array) -> dict[str, float]:
        """Name values."""
        return dict(zip(self.index, values.tolist(), strict=True))

    def values(self, known: Mapping[str, float]) -> Array:
        """Start from known values; a number of a group from that of the base, or from the stated one."""
        found = [known.get(n.name, known.get(n.name.rpartition(": ")[2], n.start)) for n in self.numbers]
        return np.array(found, dtype=float)

    def of_flight(self, flight: PlaybackFlight) -> tuple[FreeNumbers, IntArray]:
        """Give the numbers of the vehicle of a flight, and where they stand among these."""
        return self._by_group[flight.group], self._places[flight.group]

    @cached_property
    def _places(self) -> dict[str, IntArray]:
        return {
            group: np.array([self._place(group, number.name) for number in free.numbers], dtype=np.int64)
            for group, free in self._by_group.items()
        }

    def _place(self, group: str, name: str) -> int:
        if name.startswith(COUNTED):
            return self.index[name.replace(COUNTED, INERTIA)]
        return self.index[own if (own := f"{group}: {name}") in self.index else name]

    def at(self, values: Array, group: str = "") -> ParameterPoint:
        """Give the vehicle of a configuration at values of all numbers."""
        return ParameterPoint(self._by_group[group], values[self._places[group]])

    def physical(self, values: Array) -> dict[str, Physical]:
        """Give all numbers as people know them, in order."""
        found = self.at(values).physical
        for group in self.groups:
            at = self.at(values, group.name)
            pairs = zip(at.free.numbers, at.physical.items(), strict=True)
            found |= {
                f"{group.name}: {name}": known for number, (name, known) in pairs if number.block in group.differs
            }
        return found

    def differences(self, values: Array) -> dict[str, Physical]:
        """Say what differs between each group and the vehicle of the config: an added mass, its place, and the rest.

        A mass at a place moves the centre of mass, ``m' c' = m c + (m' - m) p``.
        """
        stated, found = self.at(values), dict[str, Physical]()
        base, mass = stated.physical, self.base.vehicle.mass_kg
        for group in self.groups:
            at = self.at(values, group.name)
            own = at.physical
            before = {name: base[name].value if name in base else 0.0 for name in own}
            if MASS in own:
                added = own[MASS].value - mass
                found[f"{group.name}: added mass"] = Physical(added, "kg")
                for name, axis in zip(CENTRE, "xy", strict=True) if CENTRE_OF_MASS.name in group.differs else ():
                    place = (own[MASS].value * own[name].value - mass * before[name]) / added if added else np.nan
                    found[f"{group.name}: place of the added mass, {axis}"] = Physical(place, "m")
            if INERTIA in group.differs:
                difference = np.diag(at.inertia - stated.inertia).tolist()
                for name, moment in zip(INERTIA_PARAMETERS, difference, strict=False):
                    found[f"{group.name}: added {name}"] = Physical(moment, "kg m^2")
            for name, known in own.items():
                block = name.split(".")[0]
                if block in group.differs and block not in OF_A_WEIGHT:
                    away = Physical(known.value - before[name], known.unit)
                    found[f"{group.name}: {name} less that of the config"] = away
        return found
