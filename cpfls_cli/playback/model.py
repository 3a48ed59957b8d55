"""The model of a whole vehicle: rotors, inertia, effects and a learned remainder, once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import cache, cached_property
from math import pi
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.consistency.check import Audit
from cpfls_cli.dynamics import InertiaFunctions, InertiaModel, body_inertia, momentum_form, positive_definite
from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Columns, Effect
from cpfls_cli.effects.registry import CENTRE_OF_MASS, THRUST_CURVE, VEHICLE_NUMBERS, effect
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.inertia import symmetric
from cpfls_cli.playback.flight import Body
from cpfls_cli.playback.gusts import Gusts
from cpfls_cli.playback.rotors import Hold, RotorResponse
from cpfls_cli.playback.windows import Flown, Rotors, Turned, Turning
from cpfls_cli.result import About, about, part, result
from cpfls_cli.vehicle.motion import Acting, Acts, Instant, Numbers, Vehicle, Wrench, rotor_wrench
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.values import Functions, Tangent, Value, Vector, dot, minus, plus, times

if TYPE_CHECKING:
    from cpfls_cli.regressor.regressor import InertiaValues

_DISCHARGE_S = 10.0
"""Over which a voltage is averaged: dips are shorter, which answer commands or are noise, a discharge is longer."""


def _discharging(signals: Signals, full: float) -> Signals:
    """Take the voltage of a flight as a share of a full one, in V, without its dips and noise about the discharge."""
    if signals.voltage is None:
        return signals
    # The fullest battery of other flights is another one; 1 is that of shares.
    ratio = 1.0 if 1.0 in {signals.full_voltage, full} else signals.full_voltage / full
    line = np.polynomial.Polynomial.fit(signals.time, signals.voltage, 1)(signals.time)
    dips = uniform_filter1d(signals.voltage - line, max(1, round(_DISCHARGE_S / signals.period)), mode="nearest")
    return replace(signals, voltage=ratio * (line + dips), full_voltage=signals.full_voltage / ratio)


@result
class Remainder:
    """What has no name: torque and force over the direction of the airflow, by a periodic fuzzy system.

    Each column of the system enters with the speed in the rotor plane times the mean rotor speed, and with its square.
    """

    breakpoints: Array = about(
        "peaks of the membership functions over the direction, share of a turn", "breakpoint", brief=False
    )
    harmonic_order: int = about("of the consequents; 0 for the seesaw")
    rows: IntArray = about("which of torque (0 to 2) and force (3 to 5) it adds to", "row")
    coefficients: Array = about(
        "of each column: by speed in the rotor plane times mean rotor speed, and by that speed squared",
        "row",
        "column",
        "2",
        unit="SI",
        brief=False,
    )


def learned_wrench(learned: Remainder, coefficients: Any = None) -> Callable[[Instant, Numbers], Wrench]:
    """Make of a remainder what acts on a vehicle as an effect does.

    `coefficients`, shape (row, column, 2), take the place of its own, with derivatives.
    """
    rules, order, peaks = max(len(learned.breakpoints) - 1, 1), learned.harmonic_order, learned.breakpoints.tolist()
    given = learned.coefficients if coefficients is None else coefficients

    def acts(see: Instant, _p: Numbers) -> Wrench:
        functions, (x, y, _) = see.functions, see.air_velocity
        speed, angle = functions.sqrt(x**2 + y**2), functions.arctan2(y, x)
        mean = functions.total(see.rotor_speed) * (1 / len(see.vehicle.rotors))
        features = _features(angle, order, functions)
        turn = angle * (0.5 / pi)
        turn = turn - functions.floor(turn)
        total: list[Value] = [0] * 6
        for row, by_column in zip(learned.rows.tolist(), given, strict=True):
            by_power = by_column.T.reshape(2, rules, len(features)).tolist()
            slow, fast = (
                _blended([dot(features, rule) for rule in by_rule], peaks, turn, functions) for by_rule in by_power
            )
            total[row] = plus(times(speed * mean, slow), times(speed**2, fast))
        return Wrench(tuple(total[:3]), tuple(total[3:]))

    return acts


def _features(angle: Value, order: int, functions: Functions) -> list[Value]:
    """Evaluate the consequent features: 1, and a seesaw or harmonics of the angle."""
    if order:
        multiples = [k * angle for k in range(1, order + 1)]
        return [1, *map(functions.sin, multiples), *map(functions.cos, multiples)]
    end = functions.where(angle > 0.0, pi, -pi)
    return [1, functions.where(functions.absolute(angle) > 0.5 * pi, end - angle, angle) * (2 / pi)]


def _blended(by_rule: Sequence[Value], breakpoints: Sequence[float], turn: Value, functions: Functions) -> Value:
    """Blend the two rules that fire, by the copy of `cpfls_cli.fuzzy.basis.z_function`."""
    rules = len(by_rule)
    # Rules between equal peaks never fire.
    wide = [rule for rule in range(rules) if breakpoints[rule + 1] > breakpoints[rule]] if rules > 1 else []
    blended: list[Value] = []
    for rule in wide:
        start, end, after = breakpoints[rule], breakpoints[rule + 1], by_rule[(rule + 1) % rules]
        u = (turn - start) * (1 / (end - start))
        falling = functions.where(u < 0.5, 1.0 - 2.0 * u**2, 2.0 * (1.0 - u) ** 2)
        blended.append(plus(after, times(falling, minus(by_rule[rule], after))))
    total = blended.pop() if blended else by_rule[0]
    for rule, here in reversed(list(zip(wide, blended, strict=False))):
        total = functions.where(turn < breakpoints[rule + 1], here, total)
    return total


class ModelEffect(NamedTuple):
    """An effect of the catalogue in a model."""

    name: Annotated[str, About("identifier, see `cpfls effects`")]
    shape: Annotated[Mapping[str, float], About("what it depends on nonlinearly", unit="SI")]
    coefficients: Annotated[
        Array,
        About(
            "linear ones; an offset of the centre of mass with three has a lever for all forces, with two for thrust",
            ("coefficient",),
            "SI",
            ragged=True,
        ),
    ]

    @property
    def is_lever(self) -> bool:
        """Whether it has a lever for the forces of all other parts."""
        return self.name == CENTRE_OF_MASS.name and len(self.coefficients) == 3

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

    def missing(self, signals: Signals) -> tuple[str, ...]:
        """Name the signals that it acts by and a flight lacks; command and measured force only show it."""
        return tuple(each for each in self.effect.missing(signals) if each not in {"command", "force"})


@result
class VehicleModel:
    """A vehicle that gives torque, force and motion from its state and its rotor speeds."""

    vehicle: VehicleSettings = part()
    """Mass, inertia and rotors of the model, which need not be those of a config."""
    response: RotorResponse = part(default=RotorResponse())
    effects: tuple[ModelEffect, ...] = part(default=())
    """What follows from motion and rotors is simulated; others are evaluated along a measured motion (`along`), or
    act on what drives the rotors (`filters`)."""
    remainder: Remainder | None = part(default=None)
    fuzzy: InertiaModel | None = part(default=None, kind=InertiaFunctions)
    """Inertia that depends on the attitude, in the place of the vehicle's."""
    wind: tuple[float, float, float] = about(
        "steady wind of its flights; no part of the vehicle",
        "3",
        unit="m/s",
        frame="world (z up)",
        default=(0.0, 0.0, 0.0),
    )
    commanded: bool = about(
        "1 where delay and lag lie behind commands, which measured speeds have already; 0 behind any speed",
        default=False,
    )
    hold: Hold | None = about(
        "what a command is between samples, where the response was found so: linear or previous", default=None
    )
    held_s: float = about(
        "for how long logs of its flights hold a command; 0 for measured speeds", unit="s", least=0.0, default=0.0
    )
    full_voltage: float = about(
        "what the voltages of its flights are shares of; 1 for shares alone", unit="V", least=0.0, default=1.0
    )
    repairs: Audit | None = part(default=None)
    """Faults of the sensors, which are taken out of signals first."""
    gusts: Gusts | None = part(default=None)
    """In its flights, as far as they are known; no part of what the model forecasts."""

    def __getstate__(self) -> dict[str, object]:
        """Leave what follows from the fields to whoever gets a copy: it holds functions, which no process can send."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @property
    def rotors(self) -> int:
        """Number of rotors."""
        return len(self.vehicle.rotors)

    @property
    def parts(self) -> tuple[Acting, ...]:
        """What acts on it in any state: rotors, effects, and what is learned."""
        response = self.response
        numbers = {"slow_roll_pitch": response.slow_roll_pitch, "slow_yaw": response.slow_yaw}
        parts = [Acting("rotors", rotor_wrench, numbers)]
        for one in self.effects:
            if one.name not in self.unsimulated:
                acts, known = one.known.acts, one.known
                assert acts is not None, "what is simulated with the state has it"
                own = of_thrust(acts) if known.of_all_forces and not one.is_lever else acts
                parts.append(Acting(one.name, own, one.values, one.is_lever))
        if self.remainder is not None:
            parts.append(Acting("remainder", learned_wrench(self.remainder)))
        return tuple(parts)

    @property
    def along(self) -> tuple[ModelEffect, ...]:
        """Effects that are evaluated along a measured motion."""
        return tuple(one for one in self.effects if not (one.is_lever or one.is_filter or one.effect.follows_state))

    @property
    def filters(self) -> tuple[ModelEffect, ...]:
        """Effects on what drives the rotors, in addition to the response."""
        return tuple(one for one in self.effects if one.is_filter)

    @property
    def thrust_curve(self) -> tuple[ModelEffect, ...]:
        """The effect of a thrust that is no square of what drives the rotors, or none."""
        return tuple(one for one in self.effects if one.name == THRUST_CURVE.name)

    @property
    def needs(self) -> frozenset[str]:
        """What a flight has to have for all parts to act, which takes neither the command nor the measured force."""
        of_effects = (one.effect.needs - {"command", "force"} for one in self.effects)
        learned = {"rotor_speed", "velocity"} if self.remainder else set()
        needs = frozenset(learned).union(*of_effects)
        return needs - {"torque", "thrust"} if "rotor_speed" in needs else needs

    @property
    def is_rigid_body(self) -> bool:
        """Whether it is mass, inertia and squared rotor speeds alone."""
        return not (self.effects or self.remainder or any(self.wind)) and self.response == RotorResponse()

    @property
    def of_catalogue(self) -> bool:
        """Whether it is a rigid body or inertia functions with effects of the catalogue, lag and delay among them."""
        response = self.response
        slow = response.slow_roll_pitch or response.slow_yaw
        late = (response.lag_s or response.delay_s) and not self.commanded
        return not (self.remainder or slow or late)

    @property
    def unsimulated(self) -> tuple[str, ...]:
        """Effects that are not simulated with the state, by name."""
        return tuple(one.name for one in (*self.filters, *self.along))

    @property
    def centre(self) -> Array:
        """Centre of mass, from where all forces have their levers from, shape (3,), m."""
        return next((one.coefficients for one in self.effects if one.is_lever), np.zeros(3))

    def require(self, signals: Signals, name: str) -> None:
        """Refuse a flight that lacks what an effect that is not simulated needs.

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
        signals = _discharging(signals, self.full_voltage)
        for one in self.filters:
            apply = one.effect.apply
            if apply is not None and not one.effect.missing(signals):
                signals = apply(signals, one.shape)
        return signals

    def driven_by(self, signals: Signals) -> VehicleModel:
        """Give the model for what drives the rotors of a flight: at measured speeds commands are behind them."""
        if not self.commanded or signals.commanded:
            return self
        curve, behind = self.thrust_curve, replace(self.response, delay_s=0.0, lag_s=0.0)
        return replace(self, response=behind, effects=tuple(one for one in self.effects if one not in curve))

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
        others, driven = self.other_wrench(signals), self.driven_by(signals)
        if signals.rotor_speed is None:
            rotor = np.zeros((len(signals), 1 + 4 * self.rotors))
            others = others + signals.wrench
        else:
            hold = self.hold_of(signals, "previous" if signals.commanded else "linear")
            rotor = driven.response.terms_at_samples(signals.rotor_speed, signals.period, hold)
        held = driven.wrench(self._air(signals), signals.body_rate, rotor)
        return held + self.with_lever(others)

    def with_lever(self, wrench: Array) -> Array:
        """Add the torque of forces about the centre of mass, from where they have their levers; shape (time, 6)."""
        lever = -np.cross(self.centre, wrench[:, 3:])
        return np.hstack([wrench[:, :3] + lever, wrench[:, 3:]])

    def other_wrench(self, signals: Signals) -> Array:
        """Evaluate what is not simulated with the state, at the samples of a flight.

        Of a flight that states torque and thrust that is also what depends on rotor speeds.

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
        if signals.rotor_speed is None:
            still = np.zeros((len(signals), 1 + 4 * self.rotors))
            held = self.wrench_by_part(self._air(signals), signals.body_rate, still)
            for one in self.effects:
                if one.name in held and not (one.is_lever or one.missing(signals)):
                    total += one.wrench(signals) - held[one.name]
        return total

    def _air(self, signals: Signals) -> Array:
        return signals.air_velocity if self.feels_air else np.zeros_like(signals.body_rate)

    @cached_property
    def flown(self) -> Flown:
        """The vehicle as runs fly it."""
        turning = None if self.fuzzy is None else turning_by_attitude(self.fuzzy)
        return Flown(Vehicle(self.vehicle, self.parts), self.body, turning=turning)

    @cached_property
    def feels_air(self) -> bool:
        """Whether torque or force depend on the velocity through the air."""
        seen = tuple(Tangent(np.array([value]), {0: 1.0}) for value in (1.0, -2.0, 0.5))
        speed = np.linspace(0.9, 1.1, self.rotors)[:, None] * scales.hover_speed(self.vehicle)
        torque, force = self.flown.wrench(seen, (0.3, -0.2, 0.1), Rotors(speed, 0 * speed, speed**2))
        return any(isinstance(each, Tangent) and np.any(each.by.get(0, 0.0)) for each in (*torque, *force))

    def wrench(self, air: Array, rate: Array, rotor: Array) -> Array:
        """Compute torque and force of all that is simulated with the state, shape (time, 6), N m and N, body frame.

        Parameters
        ----------
        air, rate : array, shape (time, 3), m/s and rad/s, body frame
            Velocity through the air, and body rate.
        rotor : array, shape (time, 1 + 4 rotors)
            See `cpfls_cli.playback.rotors`.
        """
        return wrench_along(self.flown, air, rate, rotor)

    def wrench_by_part(self, air: Array, rate: Array, rotor: Array) -> dict[str, Array]:
        """Compute the same of each part alone: rotors, effects by name, remainder; parameters as those of `wrench`."""
        parts = self.flown.wrench_by_part(tuple(air.T), tuple(rate.T), Rotors.of(rotor))
        return {name: _rows(wrench, len(air)) for name, wrench in parts.items()}

    @cached_property
    def body(self) -> Body:
        """What is moved, where its inertia is constant."""
        return Body.of(self.vehicle, symmetric(self.vehicle.inertia_kg_m2))


def commanded_anew(model: VehicleModel, held_s: float = 0.0) -> VehicleModel:
    """Make of a model one for commands that are not those of its logs, as those of a log that holds each for a while.

    A log shows some of the commands that an autopilot sends. Held from sample to sample they are half a sample late on
    average, and so much of what is between command and torque the model's lag and delay lack. What a delay is too short
    for, of a log that holds commands longer, is taken off the lag.
    """
    if not model.held_s:
        return model
    behind, later = model.response, 0.5 * (model.held_s - held_s)
    lag_s = max(behind.lag_s + min(behind.delay_s + later, 0.0), 0.0)
    behind = replace(behind, delay_s=max(behind.delay_s + later, 0.0), lag_s=lag_s)
    return replace(model, response=behind, held_s=held_s)


def of_thrust(lever: Acts) -> Acts:
    """Give a lever the thrust of the rotors in place of all forces."""
    return lambda see, p: lever(replace(see, force=(0, 0, see.thrust)), p)


@cache
def _wrench_of_numbers() -> Effect:
    """Make an effect of the numbers of the vehicle that are no inertia: scale of the thrust, coupling of the rates."""

    def columns(signals: Signals, shape: Mapping[str, float]) -> Columns:
        assert VEHICLE_NUMBERS.columns is not None
        given = VEHICLE_NUMBERS.columns(signals, shape)
        assert given.momentum is not None
        # What has momentum is inertia, which stands in the vehicle, or the place of a sensor, which moves nothing.
        return Columns(given.direct * ~np.any(given.momentum, axis=(0, 1)))

    return replace(VEHICLE_NUMBERS, kind="wrench", columns=columns, rate_derivative=False)


def wrench_along(flown: Flown, air: Array, rate: Array, rotor: Array) -> Array:
    """Compute torque and force of a vehicle along a motion; parameters and shape as `VehicleModel.wrench`."""
    torque, force = flown.wrench(tuple(air.T), tuple(rate.T), Rotors.of(rotor))
    return _rows((*torque, *force), len(air))


def _rows(components: Vector, samples: int) -> Array:
    out = np.zeros((6, samples))
    for row, value in zip(out, components, strict=True):
        row[:] = value
    return out.T


def turning_by_attitude(fuzzy: InertiaModel) -> Turning:
    """Say how bodies turn whose inertia depends on the attitude."""

    def inertia(rotation: Array) -> tuple[Array, InertiaValues, Array]:
        attitude = rotations.euler_angles(np.nan_to_num(rotation.transpose(2, 0, 1)))
        return attitude, *body_inertia(fuzzy, attitude)

    def momentum(rotation: Array, rate: Array) -> Array:
        return np.asarray(rotations.multiply(np.nan_to_num(inertia(rotation)[2]), rate.T).T)

    def turned(rotation: Array, momentum: Array) -> Turned:
        attitude, values, matrices = inertia(rotation)
        exists = positive_definite(matrices)
        safe = np.where(exists[:, None, None], matrices, np.eye(3))
        rate = np.asarray(np.linalg.solve(safe, momentum.T[..., None])[..., 0], dtype=float)
        return Turned(tuple(rate.T), tuple(momentum_form(attitude, rate, values)[1].T), exists)

    return Turning(momentum, turned)
