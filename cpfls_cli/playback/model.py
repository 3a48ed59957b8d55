"""The model of a whole vehicle: rotors, inertia, effects and a learned remainder, as one table of weights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.consistency.audit import Audit
from cpfls_cli.dynamics.equations_of_motion import InertiaModel
from cpfls_cli.effects.effect import Columns, Effect
from cpfls_cli.effects.polynomial import STATE_TERMS, Probe, polynomial, state_terms
from cpfls_cli.effects.registry import CENTRE_OF_MASS, VEHICLE_NUMBERS, effect
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.fuzzy.basis import Consequents
from cpfls_cli.fuzzy.periodic_system import PeriodicStructure
from cpfls_cli.inertia import symmetric
from cpfls_cli.playback.kernels import MOST_COLUMNS, Airflow, Body, Terms, airflow_terms
from cpfls_cli.playback.rotors import Hold, RotorResponse, rotor_terms_at_samples, rotor_terms_by_step
from cpfls_cli.vehicle.rotors import allocation_matrix
from cpfls_cli.vehicle.settings import VehicleSettings

_AXES = 3


class ModelEffect(NamedTuple):
    """An effect of the catalogue in a model.

    Attributes
    ----------
    name : str
    shape : mapping of str to float
    coefficients : array, shape (coefficient,)
        Linear ones, SI. An offset of the centre of mass with three has a lever for all forces, with two for the thrust.
    """

    name: str
    shape: Mapping[str, float]
    coefficients: Array

    @property
    def is_lever(self) -> bool:
        """Whether it has a lever for the forces of all other parts."""
        return self.name == CENTRE_OF_MASS.name and len(self.coefficients) == _AXES

    @property
    def known(self) -> Effect:
        """What it is in the catalogue, in the form that has these numbers."""
        return effect(self.name).form(len(self.coefficients), self.shape)

    @property
    def effect(self) -> Effect:
        """What it does: of the vehicle's own numbers what is no inertia, of others all."""
        return _wrench_of_numbers() if self.known.kind == "parameter" else self.known

    @property
    def values(self) -> dict[str, float]:
        """Its numbers by name, as the catalogue has them."""
        known = self.known
        physical = self.coefficients if known.physical is None else known.physical.of(self.coefficients)
        values = zip((each.name for each in known.coefficients), physical.tolist(), strict=True)
        # Of the vehicle's own numbers those that stand in the vehicle are 0 here.
        return {name: value for name, value in values if value or known.kind != "parameter"} | dict(self.shape)

    @property
    def is_filter(self) -> bool:
        """Whether it acts on what drives the rotors."""
        return self.effect.kind == "actuator" and self.effect.apply is not None

    @property
    def linear(self) -> Array:
        """Coefficients of the columns; 1 where everything is in the shape."""
        return np.ones(1) if self.effect.unit_coefficient else self.coefficients

    def wrench(self, signals: Signals) -> Array:
        """Evaluate torque and force along a measured motion, shape (time, 6), N m and N, body frame."""
        columns = self.effect.columns
        assert columns is not None, "what only an audit sees is in no model"
        return columns(signals, self.shape).at_samples(self.linear, signals.time)

    def weights(self, probe: Probe) -> Array | None:
        """Weigh the terms, shape (6, 34, 1 + 4 rotors); None for what is no polynomial of motion and rotor speeds."""
        known = self.effect
        # A body with a state of its own: the random motions of the probe, a second apart, may make it diverge.
        found = None if self.is_filter or known.carried is not None else polynomial(known, probe, self.shape)
        return None if found is None else np.tensordot(self.linear, _with_slow(found, probe), axes=1)

    def missing(self, signals: Signals) -> tuple[str, ...]:
        """Name the signals that it needs and a flight lacks; a filter may lack the command: it leaves speeds alone."""
        return tuple(each for each in self.effect.missing(signals) if not (self.is_filter and each == "command"))


@dataclass(frozen=True, kw_only=True)
class Remainder:
    """What has no name: torque and force over the direction of the airflow, by a periodic fuzzy system.

    Each column of the system enters with the speed in the rotor plane times the mean rotor speed, and with its square.

    Attributes
    ----------
    breakpoints : array, shape (rules + 1,)
        Peaks of the membership functions, share of a turn.
    harmonic_order : int
        Of the consequents; 0 for the seesaw.
    rows : array of int, shape (row,)
        Which of torque (0 to 2) and force (3 to 5) it adds to.
    coefficients : array, shape (row, columns, 2)
        For speed times mean rotor speed, and for squared speed.
    """

    breakpoints: Array
    harmonic_order: int
    rows: IntArray
    coefficients: Array


@dataclass(frozen=True, kw_only=True)
class VehicleModel:
    """A vehicle that gives torque, force and motion from its state and its rotor speeds.

    Attributes
    ----------
    vehicle : VehicleSettings
        Mass, inertia and rotors of the model, which need not be those of a config.
    response : RotorResponse
    thrust_linear : float
        Law of the rotors: thrust and drag follow ``w^2 + thrust_linear w_h w``, with the speed w_h that hovers under
        the square alone.
    effects : tuple of ModelEffect
        Polynomials of motion and rotor speeds stand in `weights`; others are evaluated along a measured motion
        (`along`), or act on what drives the rotors (`filters`).
    remainder : Remainder or None
    fuzzy : InertiaModel or None
        Inertia that depends on the attitude; it then stands in the place of the vehicle's.
    wind : tuple of float, m/s, world frame
        Of its flights, steady; no part of the vehicle.
    commanded : bool
        Whether lag and delay of the response lie behind commands: measured speeds have them already.
    hold : {"linear", "previous"} or None
        What a command is between samples, where the response was found so; None: as a flight is usually taken.
    repairs : Audit or None
        Faults of the sensors, which are taken out of signals first.
    """

    vehicle: VehicleSettings
    response: RotorResponse = field(default_factory=RotorResponse)
    thrust_linear: float = 0.0
    effects: tuple[ModelEffect, ...] = ()
    remainder: Remainder | None = None
    fuzzy: InertiaModel | None = None
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)
    commanded: bool = False
    hold: Hold | None = None
    repairs: Audit | None = None

    @property
    def rotors(self) -> int:
        """Number of rotors."""
        return len(self.vehicle.rotors)

    @cached_property
    def weights(self) -> Array:
        """Torque (3) and force (3) by term of the motion and term of the rotors, shape (6, terms, 1 + 4 rotors)."""
        return np.asarray(sum(self.part_weights().values()))

    def part_weights(self) -> dict[str, Array]:
        """Give the weights of each part alone: rotors, effects by name, remainder; shapes as `weights`.

        Raises
        ------
        ComputationError
            If the remainder has more columns than the compiled loops hold.
        """
        return dict(self._parts)

    @cached_property
    def _parts(self) -> dict[str, Array]:
        if airflow_terms(self.airflow) > 2 * MOST_COLUMNS:
            columns = airflow_terms(self.airflow) // 2
            raise ComputationError(f"a remainder of {columns} columns is too large; {MOST_COLUMNS} are possible")
        parts = {"rotors": np.zeros((6, self.term_count, 1 + 4 * self.rotors))}
        parts["rotors"][:, 0] = rotor_weights(self.vehicle, self.thrust_linear, self.response)
        for name, weights in self._polynomials.items():
            more = np.zeros((6, self.term_count - len(STATE_TERMS), weights.shape[2]))
            parts[name] = np.concatenate([weights, more], axis=1)
        if self.remainder is not None:
            parts["remainder"] = remainder_weights(self.remainder, self.rotors)
        levers = [known for known in self.effects if known.is_lever]
        forces = sum(parts.values()) if levers else np.zeros(6)
        return parts | {known.name: lever_weights(known.coefficients, np.asarray(forces)) for known in levers}

    @cached_property
    def _polynomials(self) -> dict[str, Array]:
        """Weights of the effects that are polynomials, by name."""
        probe = Probe.of(self.vehicle) if self.effects else None
        found = {one.name: one.weights(probe) for one in self.effects if probe is not None and not one.is_lever}
        return {name: weights for name, weights in found.items() if weights is not None}

    @property
    def along(self) -> tuple[ModelEffect, ...]:
        """Effects that are evaluated along a measured motion, being no polynomials."""
        elsewhere = self._polynomials
        return tuple(one for one in self.effects if not (one.is_lever or one.is_filter or one.name in elsewhere))

    @property
    def filters(self) -> tuple[ModelEffect, ...]:
        """Effects on what drives the rotors, beside the response."""
        return tuple(one for one in self.effects if one.is_filter)

    @property
    def needs(self) -> frozenset[str]:
        """What a flight has to have for all of its parts, as `Signals.available` names it."""
        of_effects = (one.effect.needs - ({"command"} if one.is_filter else set()) for one in self.effects)
        learned = {"rotor_speed", "velocity"} if self.remainder else {"rotor_speed"} if self.thrust_linear else set()
        needs = frozenset(learned).union(*of_effects)
        return needs - {"torque", "thrust"} if "rotor_speed" in needs else needs

    @property
    def is_rigid_body(self) -> bool:
        """Whether it is mass, inertia and squared rotor speeds alone."""
        return not (self.effects or self.remainder or self.thrust_linear or any(self.wind)) and self.response == (
            RotorResponse()
        )

    @property
    def of_catalogue(self) -> bool:
        """Whether it is a rigid body or inertia functions with effects of the catalogue, lag and delay among them."""
        response = self.response
        slow = response.slow_roll_pitch or response.slow_yaw
        late = (response.lag_s or response.delay_s) and not self.commanded
        return not (self.thrust_linear or self.remainder or slow or late)

    @property
    def beside_table(self) -> tuple[str, ...]:
        """Effects that no table of weights holds, by name."""
        return tuple(one.name for one in (*self.filters, *self.along))

    @property
    def centre(self) -> Array:
        """Centre of mass, from where all forces have their levers from, shape (3,), m."""
        return next((one.coefficients for one in self.effects if one.is_lever), np.zeros(_AXES))

    def require(self, signals: Signals, name: str) -> None:
        """Refuse a flight that lacks what an effect beside the table needs.

        Parameters
        ----------
        name : str
            Of the flight.

        Raises
        ------
        InputError
        """
        for one in (*self.along, *self.filters):
            if missing := one.missing(signals):
                lacking = ", ".join(each.replace("_", " ") for each in missing)
                raise InputError(f"{name}: lacks {lacking}, which the model's effect {one.name} needs")
        if self.fuzzy is not None and signals.attitude is None:
            raise InputError(f"{name}: lacks the attitude, which the model needs: its inertia depends on it")

    def repaired(self, signals: Signals) -> Signals:
        """Take the faults of the sensors out of a flight."""
        return signals if self.repairs is None else self.repairs.repaired(signals)

    def acting(self, signals: Signals) -> Signals:
        """Give a repaired flight as the model meets it: of its own vehicle, in its wind, past its filters."""
        if signals.vehicle != self.vehicle:
            signals = replace(signals, vehicle=self.vehicle)
        if any(self.wind):
            signals = replace(signals, wind=np.array(self.wind))
        for one in self.filters:
            apply = one.effect.apply
            if apply is not None and not one.effect.missing(signals):
                signals = apply(signals, one.shape)
        return signals

    def response_to(self, signals: Signals) -> RotorResponse:
        """Give the response to the rotor speeds of a flight."""
        if self.commanded and not signals.commanded:
            return replace(self.response, delay_s=0.0, lag_s=0.0)
        return self.response

    def hold_of(self, signals: Signals, usual: Hold) -> Hold:
        """Tell what a speed of a flight is between samples for this model."""
        return self.hold if self.hold is not None and signals.commanded else usual

    def wrench_along(self, signals: Signals) -> Array:
        """Compute torque and force on the body at the samples of a flight, without weight.

        Parameters
        ----------
        signals : Signals
            See `acting`.

        Returns
        -------
        array, shape (time, 6), N m and N, body frame
        """
        beside = self.wrench_beside(signals)
        if signals.rotor_speed is None:
            rotor = np.zeros((len(signals), self.weights.shape[2]))
            rotor[:, 0] = 1.0
            beside = beside + signals.wrench
        else:
            hold = self.hold_of(signals, "previous" if signals.commanded else "linear")
            response = self.response_to(signals)
            rotor = rotor_terms_at_samples(signals.rotor_speed, signals.period, hold, response)
        table = self.wrench(self._air(signals), signals.body_rate, rotor)
        return np.asarray(table + beside + lever_weights(self.centre, beside.T).T)

    def wrench_beside(self, signals: Signals) -> Array:
        """Evaluate what the table of weights does not hold, at the samples of a flight.

        That is what is no polynomial; of a flight that states torque and thrust also what depends on rotor speeds.

        Parameters
        ----------
        signals : Signals
            See `acting`.

        Returns
        -------
        array, shape (time, 6), N m and N, body frame
            Without the lever of the centre of mass.
        """
        total = np.zeros((len(signals), 6))
        for one in self.along:
            total += one.wrench(signals)
        for one in self.effects if signals.rotor_speed is None else ():
            weights = self._polynomials.get(one.name)
            if weights is not None and weights[:, :, 1:].any() and not one.missing(signals):
                held = state_terms(self._air(signals), signals.body_rate) @ weights[:, :, 0].T
                total += one.wrench(signals) - held
        return total

    def _air(self, signals: Signals) -> Array:
        return signals.air_velocity if self.needs_velocity else np.zeros_like(signals.body_rate)

    @property
    def airflow(self) -> Airflow:
        """Terms of the remainder."""
        return airflow_of(self.remainder)

    @property
    def term_count(self) -> int:
        """Number of terms of the motion."""
        return len(STATE_TERMS) + airflow_terms(self.airflow)

    @cached_property
    def body(self) -> Body:
        """What is moved, where its inertia is constant."""
        return body_of(self.vehicle, symmetric(self.vehicle.inertia_kg_m2))

    def rotor_terms(self, speed: Array, period: float, hold: Hold) -> Array:
        """Evaluate the terms of the rotors over each step of a stretch.

        Parameters
        ----------
        speed : array, shape (time, rotor), rad/s
            Logged.
        period : float, s
        hold : {"linear", "previous"}
            See `rotor_terms_by_step`.

        Returns
        -------
        array, shape (time, 1 + 4 rotors)
        """
        response = self.response
        terms = rotor_terms_by_step(speed, period, hold, response.delay_s, response.lag_s, response.slow_s)
        return np.asarray(terms, dtype=float)

    def rotor_terms_at(self, speed: Array, period: float, hold: Hold) -> Array:
        """Evaluate the terms of the rotors at the samples of a stretch; parameters and shape as `rotor_terms`."""
        return rotor_terms_at_samples(speed, period, hold, self.response)

    @property
    def needs_velocity(self) -> bool:
        """Whether torque or force depend on the velocity through the air."""
        of_velocity = np.array([any(axis in term for axis in "uvw") for term in STATE_TERMS])
        learned = np.ones(self.term_count - len(STATE_TERMS), dtype=bool)
        return bool(np.any(self.weights[:, np.concatenate([of_velocity, learned])]))

    def step_weights(self, rotor: Array) -> tuple[Terms, Array]:
        """Evaluate the weights of the terms of the motion over each step.

        Parameters
        ----------
        rotor : array, shape (time, 1 + 4 rotors)
            See `rotor_terms`.

        Returns
        -------
        terms : Terms
            Those in use.
        weights : array, shape (time, 6, active)
        """
        used = used_terms(self.weights, self.airflow)
        return used, weights_by_step(self.weights, used, rotor)

    def wrench(self, velocity: Array, rate: Array, rotor: Array) -> Array:
        """Compute torque and force on the body, without weight.

        Parameters
        ----------
        velocity : array, shape (time, 3), m/s, body frame
            Through the air.
        rate : array, shape (time, 3), rad/s, body frame
        rotor : array, shape (time, 1 + 4 rotors)
            See `rotor_terms`.

        Returns
        -------
        array, shape (time, 6), N m and N, body frame
        """
        return wrench_of(self.weights, self.terms(velocity, rate), rotor)

    def terms(self, velocity: Array, rate: Array) -> Array:
        """Evaluate the terms of the motion, shape (time, terms)."""
        return np.hstack([state_terms(velocity, rate), remainder_terms(self.remainder, velocity)])

    def weights_at(self, velocity: Array, rate: Array) -> Array:
        """Compute what the terms of the rotors are multiplied with to give torque (3) and force (3).

        Parameters
        ----------
        velocity : array, shape (time, 3), m/s, body frame
            Through the air.
        rate : array, shape (time, 3), rad/s, body frame

        Returns
        -------
        array, shape (time, 6, 1 + 4 rotors)
        """
        return np.asarray(np.einsum("ta,kau->tku", self.terms(velocity, rate), self.weights, optimize=True))


def wrench_of(weights: Array, terms: Array, rotor: Array) -> Array:
    """Multiply weights with the terms of the motion and of the rotors, shape (time, 6)."""
    return np.asarray(np.einsum("ta,kau,tu->tk", terms, weights, rotor, optimize=True))


def body_of(vehicle: VehicleSettings, inertia: Array) -> Body:
    """Arrange mass and inertia for the compiled loops."""
    return Body(vehicle.mass_kg, vehicle.gravity_m_s2, inertia, np.asarray(np.linalg.inv(inertia), dtype=float))


def used_terms(table: Array, airflow: Airflow) -> Terms:
    """List the terms of the motion that have weights."""
    active = np.flatnonzero(np.any(table, axis=(0, 2))).astype(np.int64)
    return Terms(airflow, active, table.shape[1])


def weights_by_step(table: Array, used: Terms, rotor: Array) -> Array:
    """Multiply a table with the terms of the rotors, shape (time, 6, active)."""
    flat = table[:, used.active].reshape(-1, table.shape[2])
    return np.ascontiguousarray((rotor @ flat.T).reshape(len(rotor), 6, -1))


def airflow_of(remainder: Remainder | None) -> Airflow:
    """Describe the terms of a remainder to the compiled loops."""
    if remainder is None:
        return Airflow(np.zeros(0), 0)
    return Airflow(remainder.breakpoints, remainder.harmonic_order)


def rotor_weights(vehicle: VehicleSettings, thrust_linear: float, response: RotorResponse) -> Array:
    """Weigh the terms of the rotors alone, shape (6, 1 + 4 rotors)."""
    rotors = len(vehicle.rotors)
    thrust, *torque = allocation_matrix(vehicle)
    wrench = np.vstack([torque, np.zeros((2, rotors)), thrust])
    hover = np.sqrt(vehicle.mass_kg * vehicle.gravity_m_s2 / thrust.sum())
    table = np.zeros((6, 1 + 4 * rotors))
    table[:, 1 : 1 + rotors] = thrust_linear * hover * wrench
    table[:, 1 + rotors : 1 + 2 * rotors] = wrench
    slow = response.slow_roll_pitch, response.slow_roll_pitch, response.slow_yaw
    table[:3, 1 + 3 * rotors :] = np.array(slow)[:, None] * wrench[:3]
    return table


def lever_weights(centre: Array, forces: Array) -> Array:
    """Weigh the torque ``-c x F`` of forces about a centre of mass.

    Parameters
    ----------
    centre : array, shape (3,), m
        Where it is, from where the forces have their levers from.
    forces : array, shape (6, ...)
        Weights of torque and force.

    Returns
    -------
    array, shape (6, ...)
    """
    table = np.zeros_like(forces)
    table[:3] = -np.cross(centre, forces[3:], axisb=0, axisc=0)
    return table


def effect_weights(name: str, shape: Mapping[str, float], probe: Probe) -> Array:
    """Weigh the terms for a unit of each coefficient of an effect.

    Returns
    -------
    array, shape (coefficient, 6, 34, 1 + 4 rotors)

    Raises
    ------
    ComputationError
        If the effect is no polynomial of motion and rotor speeds.
    """
    known = effect(name)
    found = polynomial(_wrench_of_numbers() if known.kind == "parameter" else known, probe, shape)
    if found is None:
        raise ComputationError(f"the effect {name} is no polynomial of motion and rotor speeds")
    return _with_slow(found, probe)


def _with_slow(weights: Array, probe: Probe) -> Array:
    """Add the columns of slow actuation, in which no effect of the catalogue has weights."""
    slow = np.zeros((*weights.shape[:3], len(probe.signals.vehicle.rotors)))
    return np.concatenate([weights, slow], axis=3)


@cache
def _wrench_of_numbers() -> Effect:
    """Make an effect of the numbers of the vehicle that are no inertia: scale of the thrust, coupling of the rates."""

    def columns(signals: Signals, shape: Mapping[str, float]) -> Columns:
        assert VEHICLE_NUMBERS.columns is not None
        given = VEHICLE_NUMBERS.columns(signals, shape)
        assert given.momentum is not None
        # What has momentum is inertia, which stands in the vehicle, or the place of a sensor, which moves nothing.
        return Columns(given.direct * ~np.any(given.momentum, axis=(0, 1)))

    return replace(VEHICLE_NUMBERS, kind="wrench", columns=columns)


def remainder_weights(remainder: Remainder, rotors: int) -> Array:
    """Weigh the terms of a remainder, shape (6, terms, 1 + 4 rotors)."""
    terms = airflow_terms(airflow_of(remainder))
    table = np.zeros((6, len(STATE_TERMS) + terms, 1 + 4 * rotors))
    at = len(STATE_TERMS) + np.arange(0, terms, 2)
    for row, by_column in zip(remainder.rows, remainder.coefficients, strict=True):
        table[row, at, 1 : 1 + rotors] = by_column[:, :1] / rotors
        table[row, at + 1, 0] = by_column[:, 1]
    return table


def remainder_terms(remainder: Remainder | None, velocity: Array) -> Array:
    """Evaluate the terms of a remainder, shape (time, terms).

    Parameters
    ----------
    remainder : Remainder or None
    velocity : array, shape (time, 3), m/s, body frame
    """
    if remainder is None:
        return np.zeros((len(velocity), 0))
    order = remainder.harmonic_order
    consequents: Consequents = "harmonic" if order else "seesaw"
    structure = PeriodicStructure((remainder.breakpoints,), consequents, order, "additive")
    columns = structure.columns(np.arctan2(velocity[:, 1], velocity[:, 0])[:, None])
    speed = np.hypot(velocity[:, 0], velocity[:, 1])[:, None]
    return np.stack([columns * speed, columns * speed**2], axis=2).reshape(len(velocity), -1)
