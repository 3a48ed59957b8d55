"""Numbers of a vehicle that a fit may change: blocks of them, the model they make, and its derivatives by them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.effects import scales
from cpfls_cli.effects.polynomial import STATE_TERMS, Probe, polynomial
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.inertia import INERTIA_ENTRIES, INERTIA_PARAMETERS, symmetric
from cpfls_cli.lag import Numbers
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.kernels import Airflow, Body, Parameters, Terms, airflow_terms
from cpfls_cli.playback.model import (
    ModelEffect,
    Remainder,
    VehicleModel,
    body_of,
    effect_weights,
    remainder_weights,
    rotor_weights,
    used_terms,
    weights_by_step,
)
from cpfls_cli.playback.rotors import RotorResponse, rotor_terms_by_step
from cpfls_cli.vehicle.settings import VehicleSettings

INERTIA = "inertia"
LEARNED: Mapping[str, tuple[int, ...]] = {"remainder": (0, 1, 2), "remainder_force": (3, 4, 5)}
"""Blocks of the learned remainder, of torque and of force, with the rows of the wrench that each adds to."""

_INERTIA = tuple(f"inertia.log_{name}" for name in INERTIA_PARAMETERS[:3])
_PRODUCTS = tuple(f"products.{name}" for name in INERTIA_PARAMETERS[3:])
_PRODUCTS_BLOCK = "products"
_DELAY, _LAG, _SLOW = "delay.delay_s", "lag.time_constant_s", "slow_actuation.log_slow_s"
_SLOW_SHARES = ("slow_actuation.roll_pitch", "slow_actuation.yaw")
_THRUST, _DRAG, _LAW = "thrust_factor.scale", "drag_factor.scale", "thrust_law.linear"
MASS = "mass"
"""Block of groups of flights alone: one configuration has the stated mass, which gives all else its size."""

COUNTED, AS_STATED = "counted", "as_stated"
"""Blocks of groups of flights alone: coefficients of torque, shared with the vehicle of the config, are counted by its
inertia and not by that of the group; as numbers, or none where it is the stated one."""

_MASS = "mass.log_mass"
_COUNTED = tuple(f"{COUNTED}.log_{name}" for name in INERTIA_PARAMETERS[:3])

_ROOM = 10.0
"""Bounds of a coefficient here, in multiples of those of the catalogue: an effective number may lie beyond them."""

_STEP = 1e-30
"""Imaginary step of a derivative: so small that no digit is lost."""

_TURNED, _PUSHED = 2.0, 0.5
"""Natural size of a remainder: angular acceleration in rad/s^2 per m/s, acceleration in m/s^2 per m/s."""


@dataclass(frozen=True)
class Number:
    """One number of a vehicle.

    Attributes
    ----------
    name : str
        Block and number, such as ``linear_damping.d_x``.
    unit : str
        Empty for a ratio, or the logarithm of one.
    start : float
        What is stated, or a small value where nothing is.
    scale : float
        Natural size of a change.
    low, high : float
        Physical bounds.
    spread : float
        Standard deviation of what is believed before the flights, in scales.
    """

    name: str
    unit: str
    start: float
    scale: float
    low: float
    high: float
    spread: float

    @property
    def block(self) -> str:
        """Block that it comes and goes with."""
        return self.name.split(".")[0]

    @property
    def absent(self) -> float:
        """What it is in a model without its block."""
        return 0.0 if self.block in ("lag", "delay", "slow_actuation") else self.start


class Physical(NamedTuple):
    """A number as people know it.

    Attributes
    ----------
    value : float
    unit : str
    positive : bool
        Whether it cannot be below 0.
    stated : bool
        Whether a config states it.
    """

    value: float
    unit: str
    positive: bool = False
    stated: bool = False


_OF_ROTORS: Mapping[str, tuple[Number, ...]] = {
    INERTIA: tuple(Number(name, "", 0.0, 0.5, -4.0, 4.0, 3.0) for name in _INERTIA),
    "thrust_factor": (Number(_THRUST, "", 1.0, 0.2, 0.1, 10.0, 2.0),),
    "drag_factor": (Number(_DRAG, "", 1.0, 0.5, 0.01, 30.0, 4.0),),
    "thrust_law": (Number(_LAW, "", 0.0, 0.5, -0.9, 5.0, 2.0),),
    "lag": (Number(_LAG, "s", 0.01, 0.02, 0.001, 0.3, 5.0),),
    "delay": (Number(_DELAY, "s", 0.002, 0.01, 0.0, 0.1, 5.0),),
    "slow_actuation": (
        *(Number(name, "", -0.05, 0.3, -1.5, 3.0, 3.0) for name in _SLOW_SHARES),
        Number(_SLOW, "", float(np.log(0.3)), 0.7, float(np.log(0.03)), float(np.log(5.0)), 2.0),
    ),
    MASS: (Number(_MASS, "", 0.0, 0.1, -2.0, 2.0, 3.0),),
    COUNTED: tuple(Number(name, "", 0.0, 0.5, -4.0, 4.0, 3.0) for name in _COUNTED),
    AS_STATED: (),
}
"""Blocks that are the same for all vehicles."""


@lru_cache(maxsize=256)
def _stated_weights(block: str, vehicle: VehicleSettings) -> Array:
    """Weigh the terms for an effect on the stated vehicle; a search asks for it again and again."""
    return effect_weights(block, {}, _probe(vehicle))


@lru_cache(maxsize=256)
def _drag_rows(block: str, vehicle: VehicleSettings) -> BoolArray:
    """Find the rows of each coefficient that grow with the drag factor while others do not, (coefficient, 6)."""
    known, signals = CATALOGUE[block], _probe(vehicle).signals
    if known.columns is None or known.kind != "wrench":
        return np.zeros((len(known.coefficients), 6), dtype=bool)
    twice = [replace(rotor, drag_factor_n_m_s2=2 * rotor.drag_factor_n_m_s2) for rotor in vehicle.rotors]
    other = replace(signals, vehicle=replace(vehicle, rotors=tuple(twice)))
    stated, changed = (known.columns(each, {}).direct for each in (signals, other))
    grows, acts = np.any(changed != stated, axis=0).T, np.any(stated, axis=0).T
    return np.asarray(grows & np.any(acts & ~grows, axis=1, keepdims=True))


@lru_cache(maxsize=8)
def _probe(vehicle: VehicleSettings) -> Probe:
    return Probe.of(vehicle)


def blocks_of(vehicle: VehicleSettings) -> tuple[str, ...]:
    """List the blocks that a vehicle can have: of rotors and body, polynomial effects, and the remainder's.

    Numbers that the config does not know are in every layout, so they are not among the choices.
    """
    probe = _probe(vehicle)
    effects = (
        name for name, known in CATALOGUE.items() if not known.shapes and polynomial(known, probe, {}) is not None
    )
    known = (block for block in _OF_ROTORS if block not in (MASS, COUNTED, AS_STATED, *vehicle.unknown))
    return (*known, _PRODUCTS_BLOCK, *effects, *LEARNED)


def needs_velocity(block: str) -> bool:
    """Tell whether a block can only be found where the velocity was measured."""
    return block in (*LEARNED, "thrust_factor", "thrust_law") or (
        block in CATALOGUE and bool(CATALOGUE[block].needs & {"velocity", "force"})
    )


@dataclass(frozen=True)
class Column:
    """What a coefficient adds to the weights.

    Attributes
    ----------
    weights : array, shape (6, terms, 1 + 4 rotors)
        For a unit.
    share : array, shape (3,)
        A coefficient of torque is counted in units of the inertia about the axes on which it acts, so that a fit can
        change the inertia alone; 0 for one that has a force, which knows no inertia.
    drags : array of bool, shape (6,)
        Rows that go with the drag factor, where the others go with the thrust factor.
    """

    weights: Array
    share: Array
    drags: BoolArray

    @classmethod
    def of(cls, weights: Array, drags: BoolArray) -> Column:
        """Find the axes on which a coefficient acts."""
        acts = np.any(weights[:3], axis=(1, 2))
        free = not np.any(weights[3:])
        return cls(weights, acts / max(acts.sum(), 1) * float(free), drags)

    def scaled(self, drag: float) -> Array:
        """Weights for a unit counted in thrust, with a drag factor that changed by as much more than the thrust's."""
        return np.where(self.drags[:, None, None], drag * self.weights, self.weights)

    def counted(self, found: Array) -> float:
        """Count a unit on another vehicle, shape of its weights (6, 34, 1 + 4 rotors)."""
        stated, other = self.weights[~self.drags, : len(STATE_TERMS)], found[~self.drags]
        return float(np.sum(stated * other) / np.sum(other**2))


class Numbered(ABC):
    """Numbers in an order, as arrays."""

    @property
    @abstractmethod
    def numbers(self) -> tuple[Number, ...]:
        """All numbers."""

    @cached_property
    def index(self) -> dict[str, int]:
        """Place of each number by name."""
        return {number.name: place for place, number in enumerate(self.numbers)}

    @cached_property
    def starts(self) -> Array:
        """Stated numbers, shape (number,)."""
        return np.array([number.start for number in self.numbers], dtype=float)

    @cached_property
    def scales(self) -> Array:
        """Natural sizes of changes, shape (number,)."""
        return np.array([number.scale for number in self.numbers], dtype=float)

    @cached_property
    def lows(self) -> Array:
        """Lower bounds, shape (number,)."""
        return np.array([number.low for number in self.numbers], dtype=float)

    @cached_property
    def highs(self) -> Array:
        """Upper bounds, shape (number,)."""
        return np.array([number.high for number in self.numbers], dtype=float)

    @cached_property
    def spreads(self) -> Array:
        """Standard deviations of what is believed before, in scales, shape (number,)."""
        return np.array([number.spread for number in self.numbers], dtype=float)

    def named(self, values: Array) -> dict[str, float]:
        """Name values."""
        return dict(zip(self.index, values.tolist(), strict=True))


@dataclass(frozen=True)
class Layout(Numbered):
    """The numbers that are free, and how they make a model of the vehicle.

    Attributes
    ----------
    vehicle : VehicleSettings
        As stated.
    chosen : tuple of str
        Blocks, beside those of what is not known of the vehicle.
    airflow : Airflow
        Rules of the remainder, where it is among the blocks.
    """

    vehicle: VehicleSettings
    chosen: tuple[str, ...]
    airflow: Airflow

    @cached_property
    def blocks(self) -> tuple[str, ...]:
        """All blocks."""
        return (*sorted(set(self.vehicle.unknown) - set(self.chosen)), *self.chosen)

    @cached_property
    def numbers(self) -> tuple[Number, ...]:
        """All numbers, block by block."""
        return tuple(number for block in self.blocks for number in self._numbers(block))

    def values(self, known: Mapping[str, float]) -> Array:
        """Start from known values, and from the stated ones where none is known."""
        return np.array([known.get(number.name, number.start) for number in self.numbers], dtype=float)

    def of_flight(self, _flight: PlaybackFlight) -> tuple[Layout, IntArray]:
        """Give the layout of the vehicle of a flight, and where its numbers stand among these."""
        return self, np.arange(len(self.numbers))

    @property
    def used_airflow(self) -> Airflow:
        """Rules of the remainder; empty where the remainder is not among the blocks."""
        return self.airflow if LEARNED.keys() & set(self.blocks) else Airflow(np.zeros(0), 0)

    def _numbers(self, block: str) -> tuple[Number, ...]:
        if block in _OF_ROTORS:
            return _OF_ROTORS[block]
        if block == _PRODUCTS_BLOCK:
            size = scales.smallest_inertia(self.vehicle)
            return tuple(Number(name, "kg m^2", 0.0, 0.1 * size, -0.5 * size, 0.5 * size, 1.0) for name in _PRODUCTS)
        if block in LEARNED:
            return self._remainder_numbers(block)
        return tuple(self._coefficient(block, place) for place in range(len(CATALOGUE[block].coefficients)))

    def _coefficient(self, block: str, place: int) -> Number:
        coefficient = CATALOGUE[block].coefficients[place]
        scale = 1.0 if coefficient.scale is None else coefficient.scale(self.vehicle)
        low, high = coefficient.bounds(self.vehicle)
        name = f"{block}.{coefficient.name}"
        return Number(name, coefficient.unit, 0.0, scale, _ROOM * low, _ROOM * high, 1.0)

    def _remainder_numbers(self, block: str) -> tuple[Number, ...]:
        vehicle, hover = self.vehicle, scales.hover_speed(self.vehicle)
        sizes = [*(_TURNED * moment for moment in vehicle.inertia_kg_m2[:3]), *[_PUSHED * vehicle.mass_kg] * 3]
        return tuple(
            Number(f"{block}.{row}_{column}_{power}", "SI", 0.0, sizes[row] / rotor, -np.inf, np.inf, 1.0)
            for row in LEARNED[block]
            for column in range(airflow_terms(self.airflow) // 2)
            for power, rotor in ((0, hover), (1, 1.0))
        )

    @cached_property
    def _columns(self) -> dict[str, Column]:
        """What the coefficients of effects and remainder add to the weights."""
        columns: dict[str, Column] = {}
        terms = len(STATE_TERMS) + airflow_terms(self.used_airflow)
        rotors = len(self.vehicle.rotors)
        for block in self.blocks:
            if block in LEARNED:
                units = np.eye(len(self._numbers(block)))
                drags = np.zeros((len(units), 6), dtype=bool)
                weights = np.array([remainder_weights(self._remainder((block,), unit), rotors) for unit in units])
            elif not _is_effect(block):
                continue
            else:
                weights, drags = _stated_weights(block, self.vehicle), _drag_rows(block, self.vehicle)
                more = np.zeros((*weights.shape[:2], terms - weights.shape[2], weights.shape[3]))
                weights = np.concatenate([weights, more], axis=2)
            named = zip(self._numbers(block), weights, drags, strict=True)
            columns |= {number.name: Column.of(*column) for number, *column in named}
        return columns

    def _remainder(self, blocks: Sequence[str], coefficients: Array) -> Remainder:
        rows = np.array([row for block in blocks for row in LEARNED[block]], dtype=np.int64)
        shaped = coefficients.reshape(len(rows), -1, 2)
        return Remainder(
            breakpoints=self.airflow.breakpoints,
            harmonic_order=self.airflow.order,
            rows=rows,
            coefficients=shaped,
        )

    def _get(self, values: Array, name: str, otherwise: float) -> float:
        return float(values[self.index[name]]) if name in self.index else otherwise

    def _log_inertia(self, values: Array) -> Array:
        return np.array([self._get(values, name, 0.0) for name in _INERTIA])

    @property
    def _counting(self) -> tuple[str, ...]:
        return _INERTIA if {COUNTED, AS_STATED}.isdisjoint(self.blocks) else _COUNTED

    def _log_counted(self, values: Array) -> Array:
        """Give the inertia, as logarithms of ratios, in units of which coefficients of torque are counted."""
        return np.array([self._get(values, name, 0.0) for name in self._counting])

    def inertia(self, values: Array) -> Array:
        """Build the inertia tensor, shape (3, 3), kg m^2."""
        root = np.exp(0.5 * self._log_inertia(values))
        tensor = symmetric(self.vehicle.inertia_kg_m2) + symmetric(
            [0.0, 0.0, 0.0, *(self._get(values, name, 0.0) for name in _PRODUCTS)]
        )
        return np.asarray(root[:, None] * tensor * root)

    def response(self, values: Array) -> RotorResponse:
        """Build the response of the rotors."""
        stated = RotorResponse()
        return RotorResponse(
            delay_s=self._get(values, _DELAY, 0.0),
            lag_s=self._get(values, _LAG, 0.0),
            slow_roll_pitch=self._get(values, _SLOW_SHARES[0], 0.0),
            slow_yaw=self._get(values, _SLOW_SHARES[1], 0.0),
            slow_s=float(np.exp(self._get(values, _SLOW, float(np.log(stated.slow_s))))),
        )

    def _rotor_table(self, values: Array) -> Array:
        weights = rotor_weights(self.vehicle, self._get(values, _LAW, 0.0), self.response(values))
        thrust, drag = self._get(values, _THRUST, 1.0), self._get(values, _DRAG, 1.0)
        return np.array([thrust, thrust, drag, thrust, thrust, thrust])[:, None] * weights

    def coefficients(self, values: Array) -> dict[str, float]:
        """Give the coefficients of effects and remainder in SI, by name."""
        log_counted = self._log_counted(values)
        return {
            name: float(values[self.index[name]] * np.exp(column.share @ log_counted))
            for name, column in self._columns.items()
        }

    def physical(self, values: Array) -> dict[str, Physical]:
        """Give all numbers as people know them, in order: moments of inertia, factors of the first rotor, SI."""
        inertia, coefficients = self.inertia(values), self._on_found_vehicle(values)
        rotor, found = self.vehicle.rotors[0], {}
        stated = {block: block not in self.vehicle.unknown for block in self.blocks}
        for number, value in zip(self.numbers, values.tolist(), strict=True):
            name = number.name
            if name in _INERTIA:
                axis = _INERTIA.index(name)
                known = Physical(float(inertia[axis, axis]), "kg m^2", positive=True, stated=stated[number.block])
                found[f"inertia.{INERTIA_PARAMETERS[axis]}"] = known
            elif name in _PRODUCTS:
                row, column = INERTIA_ENTRIES[3 + _PRODUCTS.index(name)]
                found[name] = Physical(float(inertia[row, column]), "kg m^2", stated=True)
            elif name == _THRUST:
                factor = value * rotor.thrust_factor_n_s2
                found["thrust_factor"] = Physical(factor, "N s^2", positive=True, stated=stated[number.block])
            elif name == _DRAG:
                factor = value * rotor.drag_factor_n_m_s2
                found["drag_factor"] = Physical(factor, "N m s^2", positive=True, stated=stated[number.block])
            elif name in _COUNTED:
                found[name] = Physical(value, "")
            elif name == _MASS:
                found["mass"] = Physical(self._mass(values), "kg", positive=True, stated=True)
            elif name == _SLOW:
                found["slow_actuation.slow_s"] = Physical(float(np.exp(value)), "s", positive=True)
            else:
                found[name] = Physical(coefficients.get(name, value), number.unit)
        return found

    def table(self, values: Array) -> Array:
        """Build the weights, shape (6, terms, 1 + 4 rotors); see `VehicleModel.weights`."""
        rotors = len(self.vehicle.rotors)
        table = np.zeros((6, len(STATE_TERMS) + airflow_terms(self.used_airflow), 1 + 4 * rotors))
        table[:, 0] += self._rotor_table(values)
        drag = self._drag_over_thrust(values)
        for name, coefficient in self.coefficients(values).items():
            if coefficient:
                table += coefficient * self._columns[name].scaled(drag)
        return table * self._forces_by_mass(values)

    def _mass(self, values: Array) -> float:
        return self.vehicle.mass_kg * float(np.exp(self._get(values, _MASS, 0.0)))

    def _drag_over_thrust(self, values: Array) -> float:
        return self._get(values, _DRAG, 1.0) / self._get(values, _THRUST, 1.0)

    def _forces_by_mass(self, values: Array) -> Array:
        """Give what rows of the weights are multiplied with: runs divide forces by the stated mass."""
        share = self.vehicle.mass_kg / self._mass(values)
        return np.array([1.0, 1.0, 1.0, share, share, share])[:, None, None]

    def table_derivatives(self, values: Array) -> list[Array | None]:
        """Differentiate the weights by each number; None by those of the rotors' response in time."""
        coefficients, log_counted = self.coefficients(values), self._log_counted(values)
        found = [self._derivative(number.name, values, coefficients, log_counted) for number in self.numbers]
        by_mass = self._forces_by_mass(values)
        return [None if derivative is None else derivative * by_mass for derivative in found]

    def _derivative(
        self, name: str, values: Array, coefficients: Mapping[str, float], log_counted: Array
    ) -> Array | None:
        if name in (_DELAY, _LAG, _SLOW):
            return None
        if name in self._columns:
            column = self._columns[name]
            return np.asarray(np.exp(column.share @ log_counted) * column.scaled(self._drag_over_thrust(values)))
        derivative = np.zeros_like(self._template)
        if name in self._counting:
            axis = self._counting.index(name)
            for each, column in self._columns.items():
                derivative += coefficients[each] * column.share[axis] * column.weights
        elif name == _MASS:
            derivative[3:] = -(self.table(values) / self._forces_by_mass(values))[3:]
        elif name not in _PRODUCTS:
            # The weights of the rotors are linear in each of their numbers.
            moved = values.copy()
            moved[self.index[name]] += 1.0
            derivative[:, 0] = self._rotor_table(moved) - self._rotor_table(values)
            thrust = self._get(values, _THRUST, 1.0)
            step = {_DRAG: 1.0, _THRUST: -self._drag_over_thrust(values)}.get(name, 0.0) / thrust
            for each, column in self._columns.items():
                derivative[column.drags] += step * coefficients[each] * column.weights[column.drags]
        return derivative

    @cached_property
    def _template(self) -> Array:
        return self.table(self.starts)

    def inertia_derivatives(self, values: Array) -> Array:
        """Differentiate the inertia tensor by each number, shape (number, 3, 3)."""
        inertia, root = self.inertia(values), np.exp(0.5 * self._log_inertia(values))
        derivatives = np.zeros((len(self.numbers), 3, 3))
        for axis, name in enumerate(_INERTIA):
            if name in self.index:
                derivatives[self.index[name], axis] += 0.5 * inertia[axis]
                derivatives[self.index[name], :, axis] += 0.5 * inertia[:, axis]
        for name, (row, column) in zip(_PRODUCTS, INERTIA_ENTRIES[3:], strict=True):
            if name in self.index:
                entry = root[row] * root[column]
                derivatives[self.index[name], row, column] = derivatives[self.index[name], column, row] = entry
        return derivatives

    def rotor_terms(self, values: Array, flight: PlaybackFlight, by: str | None = None) -> Array:
        """Evaluate the terms of the rotors over each step, or their derivative by a number of the response.

        Parameters
        ----------
        values : array, shape (number,)
        flight : PlaybackFlight
        by : str or None
            Name of the number.

        Returns
        -------
        array, shape (time, 1 + 4 rotors)
        """
        response = self.response(values)
        delay: complex = response.delay_s + (1j * _STEP if by == _DELAY else 0.0)
        lag: complex = response.lag_s + (1j * _STEP if by == _LAG else 0.0)
        slow: complex = response.slow_s * (1 + 1j * _STEP if by == _SLOW else 1.0)
        given = (delay, lag, slow) if by else (response.delay_s, response.lag_s, response.slow_s)
        parts: list[Numbers] = [
            rotor_terms_by_step(flight.speed[part], flight.motion.period, flight.hold, *given)
            for part in flight.stretches
        ]
        terms = np.zeros((len(flight), parts[0].shape[1]))
        for part, found in zip(flight.stretches, parts, strict=True):
            terms[part] = found.imag / _STEP if by else found.real
        return terms

    def _found_vehicle(self, values: Array) -> VehicleSettings:
        thrust, drag = self._get(values, _THRUST, 1.0), self._get(values, _DRAG, 1.0)
        rotors = tuple(
            replace(
                rotor,
                thrust_factor_n_s2=rotor.thrust_factor_n_s2 * thrust,
                drag_factor_n_m_s2=rotor.drag_factor_n_m_s2 * drag,
            )
            for rotor in self.vehicle.rotors
        )
        xx, yy, zz, xy, xz, yz = (float(self.inertia(values)[entry]) for entry in INERTIA_ENTRIES)
        inertia = (xx, yy, zz, xy, xz, yz)
        return replace(self.vehicle, mass_kg=self._mass(values), rotors=rotors, inertia_kg_m2=inertia, unknown=())

    def model(self, values: Array) -> VehicleModel:
        """Build the model, with what was found as numbers of the vehicle."""
        vehicle = self._found_vehicle(values)
        lighter = self._get(values, _THRUST, 1.0) * self.vehicle.mass_kg / vehicle.mass_kg
        coefficients = self.coefficients(values)
        probe = Probe.of(vehicle)
        effects = tuple(self._effect(name, coefficients, probe) for name in self.blocks if _is_effect(name))
        learned = [block for block in self.blocks if block in LEARNED]
        unnamed = np.array([coefficients[number.name] for block in learned for number in self._numbers(block)])
        return VehicleModel(
            vehicle=vehicle,
            response=self.response(values),
            # The speed that hovers goes with the root of the mass over the thrust factor.
            thrust_linear=self._get(values, _LAW, 0.0) * float(np.sqrt(lighter)),
            effects=effects,
            remainder=self._remainder(learned, unnamed) if learned else None,
        )

    def _on_found_vehicle(self, values: Array) -> dict[str, float]:
        """Give the coefficients counted on the vehicle that was found: some effects share its thrust or its inertia."""
        coefficients, probe = self.coefficients(values), Probe.of(self._found_vehicle(values))
        for block in filter(_is_effect, self.blocks):
            names = (number.name for number in self._numbers(block))
            counted = self._effect(block, coefficients, probe).coefficients.tolist()
            coefficients |= dict(zip(names, counted, strict=True))
        return coefficients

    def _effect(self, name: str, coefficients: Mapping[str, float], probe: Probe) -> ModelEffect:
        """Count the coefficients of an effect on the vehicle that was found, not on the stated one."""
        found = effect_weights(name, {}, probe)
        scaled = [
            coefficients[number.name] * self._columns[number.name].counted(weights)
            for number, weights in zip(self._numbers(name), found, strict=True)
        ]
        return ModelEffect(name, {}, np.array(scaled))


def _is_effect(block: str) -> bool:
    """Tell whether a block is an effect of the catalogue that adds a wrench."""
    return block in CATALOGUE and block not in _OF_ROTORS and block != _PRODUCTS_BLOCK


@dataclass(frozen=True)
class Evaluated:
    """A layout at values: what is moved, and the weights of its terms."""

    layout: Layout
    values: Array
    body: Body
    used: Terms
    table: Array
    derivatives: list[Array | None]
    inertia: Array

    @classmethod
    def of(cls, layout: Layout, values: Array) -> Evaluated:
        """Evaluate a layout.

        Parameters
        ----------
        values : array, shape (number,)
        """
        table, derivatives = layout.table(values), layout.table_derivatives(values)
        touched = np.abs(table) + sum(np.abs(each) for each in derivatives if each is not None)
        return cls(
            layout,
            values,
            body_of(layout.vehicle, layout.inertia(values)),
            used_terms(touched, layout.used_airflow),
            table,
            derivatives,
            layout.inertia_derivatives(values),
        )

    def rotor_terms(self, flight: PlaybackFlight, samples: IntArray) -> Array:
        """Evaluate the terms of the rotors over the steps that begin at samples of a flight."""
        return self.layout.rotor_terms(self.values, flight)[samples]

    def weights(self, terms: Array) -> Array:
        """Evaluate the weights over these steps, shape (samples, 6, active)."""
        return weights_by_step(self.table, self.used, terms)

    def parameters(self, flight: PlaybackFlight, samples: IntArray, terms: Array) -> Parameters:
        """Differentiate the weights over these steps, and the inertia, by each number."""
        entries, values, first = [np.zeros((0, 2), dtype=np.int64)], [np.zeros((len(samples), 0))], [0]
        for number, derivative in zip(self.layout.numbers, self.derivatives, strict=True):
            of_response = derivative is None
            moved = self.layout.rotor_terms(self.values, flight, number.name)[samples] if of_response else None
            source = terms if moved is None else moved
            weights = (self.table if derivative is None else derivative)[:, self.used.active]
            # The first term of the rotors is constant, so the response in time leaves it.
            places = np.argwhere(np.any(weights[:, :, 1 if of_response else 0 :], axis=2))
            entries.append(places)
            values.append(source @ weights[places[:, 0], places[:, 1]].T)
            first.append(first[-1] + len(places))
        joined = np.concatenate(entries)
        return Parameters(
            np.ascontiguousarray(joined[:, 0]),
            np.ascontiguousarray(joined[:, 1]),
            np.array(first, dtype=np.int64),
            np.ascontiguousarray(np.hstack(values)),
            self.inertia,
            np.asarray(np.any(self.inertia, axis=(1, 2))),
        )
