"""The simulated vehicle: actuators from command to rotors; a vehicle or a model, with effects and what it carries."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.autopilots.motors import fitting_yaw
from cpfls_cli.dynamics import turning_law
from cpfls_cli.effects.hooks import Actuation
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.inertia import symmetric
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulation.model import SimulatedEffect, SimulatedEffects
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.vehicle.motion import (
    ATTITUDE,
    BODY_RATE,
    VEHICLE_STATES,
    Acting,
    Carried,
    Turning,
    Vehicle,
    rotor_wrench,
)
from cpfls_cli.vehicle.rotors import rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.stepping import Flat, Machine, Memory, RotorMotion
from cpfls_cli.vehicle.tracing import SYMBOLS, Symbol
from cpfls_cli.vehicle.values import ZERO, Each, Functions, Value, Vector, add, dot, times, transposed

if TYPE_CHECKING:
    from cpfls_cli.playback.model import VehicleModel


TURNING_NUMBERS = 12
"""Of `turning_of`."""


def flown_vehicle(vehicle: VehicleSettings, model: VehicleModel | None, effects: SimulatedEffects) -> Vehicle:
    """Set up a vehicle, or the model in its place, with effects on top of those of the model."""
    flown = vehicle if model is None else model.vehicle
    own = (Acting("rotors", rotor_wrench),) if model is None else model.parts
    winds = [one.effect.air(one.values) for one in effects.listed if one.effect.air is not None]
    return Vehicle(
        flown,
        (*own, *(_acting(one) for one in effects.listed if one.effect.acts is not None and one.effect.carried is None)),
        tuple(_carried(one) for one in effects.ordered if one.effect.carried is not None),
        add(ZERO, *winds),
        symmetric(flown.inertia_kg_m2) if model is None or model.fuzzy is None else None,
    )


def _acting(one: SimulatedEffect) -> Acting:
    assert one.effect.acts is not None, "chosen so"
    return Acting(one.effect.name, one.effect.acts, one.values, one.effect.of_all_forces)


def _carried(one: SimulatedEffect) -> Carried:
    body = one.effect.carried
    assert body is not None, "chosen so"
    return Carried(body.pull, body.start, one.values)


def turning_of(vehicle: Vehicle, model: VehicleModel | None) -> Callable[[Flat], Flat] | None:
    """Give inverse inertia and direct torque in a state, where the inertia depends on the attitude; None elsewhere.

    They are evaluated apart from what is traced.
    """
    if model is None or model.fuzzy is None:
        return None
    law, added = turning_law(model.fuzzy), vehicle.added_inertia

    def numbers(state: Flat) -> Flat:
        turning = law(np.array([state[ATTITUDE]]), np.array([state[BODY_RATE]]))
        return (*np.linalg.inv(turning.inertia[0] + added).ravel().tolist(), *turning.direct[0].tolist())

    return numbers


def given_turning(numbers: Vector) -> Turning:
    """Arrange the numbers of `turning_of`."""
    return Turning((numbers[:3], numbers[3:6], numbers[6:9]), numbers[9:])


class Plant:
    """A vehicle whose derivative is evaluated state by state.

    Attributes
    ----------
    start : array, shape (state,)
        At rest at the origin, with the bodies that it carries.
    """

    def __init__(self, vehicle: Vehicle, model: VehicleModel | None) -> None:
        self._turning = turning_of(vehicle, model)
        rotors, extra = len(vehicle.settings.rotors), 0 if self._turning is None else TURNING_NUMBERS
        self.start = np.array([*[0.0] * VEHICLE_STATES, *vehicle.start])
        states = len(self.start)

        def build(_memory: Memory, given: tuple[Symbol, ...]) -> Vector:
            state, push, rest = given[:states], given[states : states + 6], given[states + 6 :]
            speed, acceleration, slow = (Each(rest[rotors * n : rotors * (n + 1)]) for n in range(3))
            instant = vehicle.instant(state, speed, acceleration, slow)
            turning = given_turning(rest[3 * rotors :]) if extra else None
            return vehicle.derivative(instant, state, push, turning)

        self._machine = Machine.of(build, states + 6 + 3 * rotors + extra)

    def derivative(
        self, state: Array, speed: Array, acceleration: Array, slow: Array, push: Array | None = None
    ) -> Array:
        """Differentiate the state, shape (state,).

        Parameters
        ----------
        speed, acceleration, slow : array, shape (rotor,), rad/s, rad/s^2 and rad^2/s^2
            Of the rotors; squared speed that slow actuation has come to.
        push : array, shape (6,), N m and N, body frame, or None
            Of gusts.
        """
        push = np.zeros(6) if push is None else push
        numbers = tuple(state.tolist())
        turning = () if self._turning is None else self._turning(numbers)
        parts = (each.tolist() for each in (push, speed, acceleration, slow))
        return np.array(self._machine.advance((*numbers, *(x for part in parts for x in part), *turning)))

    def settled(self, state: Array, speed: Array, push: Array | None = None) -> Array:
        """Differentiate the state with rotors that have long turned at a speed; parameters as of `derivative`."""
        return self.derivative(state, speed, np.zeros_like(speed), speed**2, push)


# Share of the full battery: what a load takes beyond it would turn rotors backwards.
_LOWEST_VOLTAGE = 0.05


@dataclass(frozen=True)
class Mixer:
    """Allocate a wrench; where a rotor cannot follow, yaw gives way first, and the rest is clipped.

    `inverse`: squared speeds for one unit of thrust and of each torque; `limit`: largest squared speed, rad^2/s^2.
    """

    inverse: Array
    limit: float

    def mixed(self, wrench: Vector) -> tuple[Value, Value]:
        """Find speeds that are possible for thrust and torque (N, N m), rad/s, and squared speeds that they ask for."""
        by_rotor = transposed(self.inverse.tolist())
        upright = SYMBOLS.rotors(dot(wrench[:3], own[:3]) for own in by_rotor)
        yaw = SYMBOLS.rotors(times(wrench[3], own[3]) for own in by_rotor)
        possible = upright + fitting_yaw(upright, yaw, self.limit) * yaw
        squared = SYMBOLS.smallest(SYMBOLS.largest(possible, 0.0), self.limit)
        return SYMBOLS.sqrt(squared), upright + yaw


def mixer(vehicle: VehicleSettings) -> Mixer:
    """Invert the allocation of a vehicle.

    `ComputationError` where the rotors cannot produce thrust, roll, pitch and yaw independently.
    """
    units = np.eye(4)
    inverse = rotor_demand(vehicle, units[:, 0], units[:, 1:]).squared_speed
    return Mixer(inverse, vehicle.rotor_speed_max_rad_s**2)


@dataclass(frozen=True)
class Battery:
    """Voltage as a share of the full battery, ``V = 1 - use t / T - load (P / P_hover - 1)`` with P ~ sum w_i^3.

    `use`: share lost by the end of the flight, at T = `duration` s; `load`: share lost under twice the hover power;
    `hover_cubed`: sum of the cubed rotor speeds in hover, rad^3/s^3.
    """

    use: float
    load: float
    duration: float
    hover_cubed: float

    def voltage(self, time: Value, rotor_speed: Value, functions: Functions) -> Value:
        """Compute the voltage some time after take-off, s, at rotor speeds, rad/s."""
        power = functions.total(rotor_speed**3) * (1 / self.hover_cubed)
        left = 1 - (self.use / self.duration) * time - self.load * (power - 1)
        return functions.largest(left, _LOWEST_VOLTAGE)


class Rotors(NamedTuple):
    """Rotors in the middle of a step, each a value by rotor but for the voltage, a share of the full battery.

    `lagged`: command after the lag, rad/s; `measured`: speed that is logged, at the end of the chain; `speed`,
    `acceleration`: what acts, the same or later where the model of a whole vehicle says so; `slow`: squared speed that
    slow actuation has come to, rad^2/s^2, 0 without any.
    """

    lagged: Value
    measured: Value
    speed: Value
    acceleration: Value
    slow: Value
    voltage: Value


@dataclass(frozen=True)
class Actuators:
    """First-order lag, then the links of effects, then what the battery leaves, then the response of a whole vehicle.

    `lag`: time constant behind the command, s; `acting`: what effects do between command and rotors, with their values;
    `response`: behind the speed that is logged; `start`: speeds at which the rotors have long turned before the first
    step, rad/s.
    """

    lag: float
    acting: tuple[tuple[Actuation, Mapping[str, float]], ...]
    battery: Battery
    response: RotorResponse
    start: Array

    def rotors(self, command: Value, memory: Memory) -> Rotors:
        """Take one step, exactly for a command, rad/s, that stays the same during it."""
        start, functions = self.start.tolist(), memory.functions
        motion = _behind(command, self.lag, start, memory)
        lagged = motion.speed
        for actuation, values in self.acting:
            if actuation.link is not None:
                motion = actuation.link(motion, values, memory)
        voltage = self.battery.voltage((memory.number + 0.5) * memory.step, motion.speed, functions)
        supplies = [(each.supply, values) for each, values in self.acting if each.supply is not None]
        factor = prod(supply(values, voltage) for supply, values in supplies)
        measured = RotorMotion(factor * motion.speed, factor * motion.acceleration)
        response = self.response
        acting = memory.delayed(measured, response.delay_s / memory.step)
        if response.lag_s > 0:
            acting = _behind(acting.speed, response.lag_s, start, memory)
        slow: Value = 0
        if response.slow_roll_pitch or response.slow_yaw:
            squares = (self.start**2).tolist()
            slow = memory.lagged(acting.speed**2, response.slow_s / memory.step, squares)
        return Rotors(lagged, measured.speed, acting.speed, acting.acceleration, slow, voltage)


def _behind(wanted: Value, time_constant: float, start: list[float], memory: Memory) -> RotorMotion:
    """Put rotors behind a lag, s."""
    reached = memory.lagged(wanted, time_constant / memory.step, start)
    return RotorMotion(reached, (wanted - reached) * (1 / time_constant))


def actuators(
    effects: SimulatedEffects,
    response: RotorResponse,
    vehicle: VehicleSettings,
    settings: ClosedLoopSettings,
    speed: Array,
    duration: float,
) -> Actuators:
    """Build the actuator chain of a vehicle with its effects, from rotor speeds at the start on."""
    acting = [(one.effect.actuation, one.values) for one in effects.ordered if one.effect.actuation is not None]
    lags = [each.lag(values) for each, values in acting if each.lag is not None]
    hover = len(vehicle.rotors) * hover_speed(vehicle) ** 3
    battery = Battery(settings.battery_use, settings.battery_load, duration, hover)
    return Actuators(lags[-1] if lags else settings.rotor_time_constant_s, tuple(acting), battery, response, speed)
