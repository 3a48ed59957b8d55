"""A vehicle at values of its free numbers: its model, what people read of it, and its derivatives by the numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects import scales
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.inertia import INERTIA_ENTRIES, INERTIA_PARAMETERS, six_parameters, symmetric
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.model import ModelEffect, VehicleModel, of_thrust
from cpfls_cli.playback.motion import Body
from cpfls_cli.playback.parameters import (
    DELAY,
    DRAG,
    LAG,
    LAW,
    LEARNED,
    LOG_COUNTED,
    LOG_INERTIA,
    LOG_MASS,
    PRODUCT_NAMES,
    SLOW,
    SLOW_SHARES,
    THRUST,
    FreeNumbers,
    Physical,
    unit_wrenches,
)
from cpfls_cli.playback.remainder import Airflow, learned_wrench
from cpfls_cli.playback.rotors import RotorResponse, TimeOfResponse
from cpfls_cli.playback.windows import MOTION, Flown
from cpfls_cli.vehicle.motion import Acting, Instant, Numbers, Vehicle, Wrench, rotor_wrench
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.tracing import ARRAY_SYMBOLS, Graph, traced_in_two
from cpfls_cli.vehicle.values import (
    ARRAYS,
    Functions,
    Polynomial,
    Tangent,
    Value,
    Vector,
    dot,
    times,
    value_of,
)

TIMES: Mapping[str, TimeOfResponse] = {DELAY: "delay_s", LAG: "lag_s", SLOW: "slow_s"}
"""Times of the response that numbers are."""
DRAG_OVER_THRUST = "drag_over_thrust"
"""By how much more the drag factor differs from the stated one than the thrust factor does."""


@dataclass(frozen=True)
class VehicleAt:
    """The vehicle that values of its free numbers make.

    Attributes
    ----------
    values : array, shape (number,)
    """

    free: FreeNumbers
    values: Array

    def get(self, name: str, otherwise: float) -> float:
        """Give the value of a number, or another one where it is not free."""
        return float(self.values[self.free.index[name]]) if name in self.free.index else otherwise

    @cached_property
    def inertia_entries(self) -> tuple[Value, ...]:
        """Entries of the inertia tensor by `INERTIA_ENTRIES`, kg m^2, with derivatives by the numbers, by place."""
        free, given = self.free, self.with_derivatives(0)
        logs, products = (
            [given(name) if name in free.index else 0.0 for name in each] for each in (LOG_INERTIA, PRODUCT_NAMES)
        )
        root = [ARRAYS.exp(0.5 * log) for log in logs]
        stated = six_parameters(free.vehicle.inertia_kg_m2).tolist()
        tensor = [entry + own for entry, own in zip(stated, (0.0, 0.0, 0.0, *products), strict=True)]
        pairs = zip(tensor, INERTIA_ENTRIES, strict=True)
        return tuple(root[row] * entry * root[column] for entry, (row, column) in pairs)

    @cached_property
    def inertia(self) -> Array:
        """Inertia tensor, shape (3, 3), kg m^2."""
        return symmetric([value_of(entry) for entry in self.inertia_entries])

    @property
    def inertia_by(self) -> Array:
        """Derivatives of the inertia tensor by each number, shape (number, 3, 3), kg m^2."""
        derivatives = np.zeros((len(self.free.index), 3, 3))
        for (row, column), entry in zip(INERTIA_ENTRIES, self.inertia_entries, strict=True):
            for place, slope in entry.by.items() if isinstance(entry, Tangent) else ():
                derivatives[place, [row, column], [column, row]] = slope
        return derivatives

    @property
    def response(self) -> RotorResponse:
        """Response of the rotors."""
        return RotorResponse(
            delay_s=self.get(DELAY, 0.0),
            lag_s=self.get(LAG, 0.0),
            slow_roll_pitch=self.get(SLOW_SHARES[0], 0.0),
            slow_yaw=self.get(SLOW_SHARES[1], 0.0),
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
        """The vehicle with what was found as its own numbers."""
        thrust, drag, stated = self.get(THRUST, 1.0), self.get(DRAG, 1.0), self.free.vehicle
        rotors = tuple(
            replace(
                rotor,
                thrust_factor_n_s2=rotor.thrust_factor_n_s2 * thrust,
                drag_factor_n_m_s2=rotor.drag_factor_n_m_s2 * drag,
            )
            for rotor in stated.rotors
        )
        xx, yy, zz, xy, xz, yz = (float(self.inertia[entry]) for entry in INERTIA_ENTRIES)
        inertia = (xx, yy, zz, xy, xz, yz)
        return replace(stated, mass_kg=self.mass, rotors=rotors, inertia_kg_m2=inertia, unknown=())

    @cached_property
    def effects(self) -> tuple[ModelEffect, ...]:
        """Effects, their coefficients counted on this vehicle and not on the stated one: some share its thrust."""
        effects, stated = [], self.free.vehicle
        # As runs fly them: with the stated thrust, and a drag that changed by as much more than the thrust.
        rotors = tuple(
            replace(each, drag_factor_n_m_s2=each.drag_factor_n_m_s2 * self._acting_number(DRAG_OVER_THRUST))
            for each in stated.rotors
        )
        flown = replace(stated, rotors=rotors)
        for block in self.free.effects:
            before, found = (unit_wrenches(block, vehicle) for vehicle in (flown, self.vehicle))
            ratio = (before * found).sum(axis=(1, 2)) / (found**2).sum(axis=(1, 2))
            own = [self.coefficients[number.name] for number in self.free.of_block(block)]
            effects.append(ModelEffect(block, {}, np.array(own) * ratio))
        return tuple(effects)

    @property
    def model(self) -> VehicleModel:
        """The model, with what was found as numbers of the vehicle."""
        lighter = self.get(THRUST, 1.0) * self.free.vehicle.mass_kg / self.vehicle.mass_kg
        learned = [block for block in self.free.blocks if block in LEARNED]
        names = (number.name for block in learned for number in self.free.of_block(block))
        unnamed = np.array([self.coefficients[name] for name in names])
        return VehicleModel(
            vehicle=self.vehicle,
            response=self.response,
            # The speed that hovers goes with the root of the mass over the thrust factor.
            thrust_linear=self.get(LAW, 0.0) * float(np.sqrt(lighter)),
            effects=self.effects,
            remainder=self.free.remainder(learned, unnamed) if learned else None,
        )

    @property
    def physical(self) -> dict[str, Physical]:
        """All numbers as people know them, in order: moments of inertia, factors of the first rotor, SI."""
        free, inertia, rotor = self.free, self.inertia, self.free.vehicle.rotors[0]
        coefficients = dict(self.coefficients)
        for effect in self.effects:
            names = (number.name for number in free.of_block(effect.name))
            coefficients |= dict(zip(names, effect.coefficients.tolist(), strict=True))
        found: dict[str, Physical] = {}
        for number, value in zip(free.numbers, self.values.tolist(), strict=True):
            name, stated = number.name, number.block not in free.vehicle.unknown
            if name in LOG_INERTIA:
                axis = LOG_INERTIA.index(name)
                known = Physical(float(inertia[axis, axis]), "kg m^2", positive=True, stated=stated)
                found[f"inertia.{INERTIA_PARAMETERS[axis]}"] = known
            elif name in PRODUCT_NAMES:
                row, column = INERTIA_ENTRIES[3 + PRODUCT_NAMES.index(name)]
                found[name] = Physical(float(inertia[row, column]), "kg m^2", stated=True)
            elif name == THRUST:
                factor = value * rotor.thrust_factor_n_s2
                found["thrust_factor"] = Physical(factor, "N s^2", positive=True, stated=stated)
            elif name == DRAG:
                factor = value * rotor.drag_factor_n_m_s2
                found["drag_factor"] = Physical(factor, "N m s^2", positive=True, stated=stated)
            elif name in LOG_COUNTED:
                found[name] = Physical(value, "")
            elif name == LOG_MASS:
                found["mass"] = Physical(self.mass, "kg", positive=True, stated=True)
            elif name == SLOW:
                found["slow_actuation.slow_s"] = Physical(float(np.exp(value)), "s", positive=True)
            else:
                found[name] = Physical(coefficients.get(name, value), number.unit)
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
        response = self.response
        if not by:
            slow = response.slow_s if SLOW in self.free.index else None
            return np.asarray(flight.rotor_terms(response.delay_s, response.lag_s, slow)[samples])
        slopes = [
            response.slope_by_step(flight.speed[part], flight.motion.period, flight.hold, TIMES[by])
            for part in flight.stretches
        ]
        # The number is the logarithm of the slow time.
        return np.concatenate(slopes)[samples] * (response.slow_s if by == SLOW else 1.0)

    @property
    def times(self) -> list[str]:
        """Numbers that are times of the rotors' response."""
        return [name for name in TIMES if name in self.free.index]

    @cached_property
    def flown(self) -> Flown:
        """The vehicle as runs fly it."""
        function = traced_wrench(*self.free.key)(tuple(self.values.tolist()))
        return replace(
            self._flown(self._acting_number, np.zeros((0, 3, 3))),
            traced=lambda air, rate, *rotors: function(air, rate, rotors),
        )

    @cached_property
    def differentiated(self) -> Flown:
        """The same with the derivatives by all numbers."""
        return self._flown(self.with_derivatives(MOTION), self.inertia_by)

    @cached_property
    def polynomial(self) -> Flown:
        """The same as a polynomial of its numbers, coefficients in SI."""
        return self._flown(Polynomial.number, np.zeros((0, 3, 3)))

    def with_derivatives(self, first: int) -> Callable[[str], Value]:
        """Give numbers by name, with derivatives by places from the first on."""
        return acting_numbers(
            self.free, lambda name: Tangent(self.get(name, 0.0), {first + self.free.index[name]: 1.0})
        )

    def _flown(self, number: Callable[[str], Value], inertia_by: Array) -> Flown:
        acting, drag_scale = acting_at(self.free, number)
        body = Body.of(replace(self.free.vehicle, mass_kg=self.mass), self.inertia)
        vehicle = Vehicle(self.free.vehicle, acting)
        return Flown(vehicle, body, inertia_by, self.free.index.get(LOG_MASS), drag_scale)


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
    """List what acts on a vehicle of free numbers, and the ratio of the drag factors that effects share.

    Parameters
    ----------
    number : callable
        See `acting_numbers`.
    """
    index, hover = free.index, scales.hover_speed(free.vehicle)

    def given(name: str, otherwise: float) -> Value:
        return number(name) if name in index else otherwise

    thrust, drag = given(THRUST, 1.0), given(DRAG, 1.0)
    numbers = {
        "linear": times(given(LAW, 0.0), hover),
        "slow_roll_pitch": given(SLOW_SHARES[0], 0.0),
        "slow_yaw": given(SLOW_SHARES[1], 0.0),
    }

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


@lru_cache(maxsize=256)
def traced_wrench(
    vehicle: VehicleSettings, blocks: tuple[str, ...], breakpoints: tuple[float, ...], order: int
) -> Callable[..., Callable[..., tuple[Vector, Vector]]]:
    """Make a function of values of the numbers that gives one of torque and force of the vehicle.

    This takes air velocity, body rate, and speeds, accelerations and slow squares of the rotors: arrays by component.
    """
    free, graph = FreeNumbers(vehicle, blocks, Airflow(np.array(breakpoints), order)), Graph()
    symbols = dict(zip(free.index, graph.inputs("number", len(free.numbers)), strict=True))
    air, rate = (graph.inputs(name, 3) for name in ("air", "rate"))
    rotors = graph.inputs("rotors", 3)
    acting, drag_scale = acting_at(free, acting_numbers(free, symbols.__getitem__, ARRAY_SYMBOLS))
    see = Instant(
        vehicle,
        rotors[0],
        air_velocity=air,
        body_rate=rate,
        rotor_acceleration=rotors[1],
        slow_square=rotors[2],
        drag_scale=drag_scale,
        functions=ARRAY_SYMBOLS,
    )
    numbers, motion = ("number", tuple(symbols.values())), {"air": air, "rate": rate, "rotors": rotors}
    return traced_in_two(graph, numbers, motion, Vehicle(vehicle, acting).wrench(see))
