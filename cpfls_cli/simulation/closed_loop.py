"""A vehicle in flight with effects and what it carries, in the closed loop of autopilot and actuators along a plan."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import ceil, cos, dist, isfinite, prod
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.autopilots.motors import Motors
from cpfls_cli.dynamics import turning_law
from cpfls_cli.effects.hooks import Actuation
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.errors import ComputationError
from cpfls_cli.inertia import symmetric
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulation.autopilot import (
    Asked,
    Autopilot,
    GyroscopeNoise,
    PlanPilot,
    along_path,
    integration_rate,
    law_pilot,
    mixer,
    plan_of,
)
from cpfls_cli.simulation.model import SimulatedEffect, SimulatedEffects
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.trajectory.planning import sample_interval
from cpfls_cli.vehicle.motion import (
    ATTITUDE,
    BODY_RATE,
    POSITION,
    VEHICLE_STATES,
    VELOCITY,
    Acting,
    Carried,
    Instant,
    Turning,
    Vehicle,
    rotor_wrench,
    wrench_by_part,
)
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.stepping import Flat, Machine, Memory, RotorMotion
from cpfls_cli.vehicle.tracing import Symbol
from cpfls_cli.vehicle.values import ZERO, Each, Functions, Value, Vector, add, scaled

if TYPE_CHECKING:
    from cpfls_cli.playback.lack import DrawnLack
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


def settled(
    vehicle: Vehicle, model: VehicleModel | None, state: Array, speed: Array, push: Array | None = None
) -> Array:
    """Differentiate a state with rotors that have long turned at a speed, shape (state,).

    Parameters
    ----------
    speed : array, shape (rotor,), rad/s
    push : array, shape (6,), N m and N, body frame, or None
        Of gusts.
    """
    numbers, rotors = tuple(state.tolist()), Each(speed.tolist())
    turning = turning_of(vehicle, model)
    now = vehicle.instant(numbers, rotors, 0, rotors**2)
    pushed = None if push is None else tuple(push.tolist())
    return np.array(vehicle.derivative(now, numbers, pushed, turning and given_turning(turning(numbers))), dtype=float)


# Share of the full battery: what a load takes beyond it would turn rotors backwards.
_LOWEST_VOLTAGE = 0.05


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


_ROUNDING = 1e-6
_STEPS_BETWEEN_REPORTS = 100
_REMEDY = (
    "fly more gently, make the effects smaller, or change the frequencies of simulation.closed_loop; of an autopilot "
    "its gains, simulation.closed_loop.autopilot_parameters, which `cpfls tune` finds"
)


@dataclass(frozen=True)
class Clock:
    """Steps of the integration between the samples of the plan, so many for each.

    `instants`: the start, then the middle of each step, s.
    """

    parts: int
    steps: int
    step: float
    instants: Array


def clock_of(time: Array, settings: ClosedLoopSettings) -> Clock:
    """Divide the samples of a plan, shape (time,), s, into steps of the integration and of the autopilot's law."""
    period = sample_interval(time)
    rate = integration_rate(settings.law, settings.integration_rate_hz)
    parts = ceil(period * rate - _ROUNDING)
    steps, step = (len(time) - 1) * parts, period / parts
    return Clock(parts, steps, step, time[0] + step * np.concatenate([[0.0], np.arange(steps) + 0.5]))


def between(middles: Array) -> Array:
    """Interpolate values from the middles of steps to their ends, one more, linearly."""
    if len(middles) < 2:
        return np.concatenate([middles, middles])
    ends = 2 * middles[0] - middles[1], 2 * middles[-1] - middles[-2]
    longer = np.concatenate([ends[0][None], middles, ends[1][None]])
    return np.asarray(0.5 * (longer[1:] + longer[:-1]))


class Pilot(Protocol):
    """What commands the rotors: numbers that it gives to each step, and what the traced step makes of them."""

    def size(self, rotors: int) -> int:
        """Count the numbers."""
        ...

    def given(self, number: int, start: Flat) -> Flat:
        """Give the numbers of a step, by the steps done so far and the state at its start."""
        ...

    def commanded(self, given: Vector, middle: Vector) -> tuple[Value, Value]:
        """Command the rotors.

        Parameters
        ----------
        middle : vector
            The state in the middle of the step.

        Returns
        -------
        command : value by rotor, rad/s
        demand : value by rotor, rad^2/s^2
            Squared speeds asked for, possible or not.
        """
        ...


@dataclass
class Integration:
    """The midpoint rule with one evaluation a step.

    The middle of a step is reached with the derivative of the step before, so that the rule is of second order. All of
    a step is traced into plain Python, but for the law of another autopilot and for an inertia that depends on the
    attitude, which are evaluated apart and given to it. `state`, `change`: at the start, and its derivative; `push`: of
    gusts, in the middle of each step, N m and N, body frame; `lacking`: what the model lacks, drawn for the steps.
    """

    pilot: Pilot
    actuators: Actuators
    vehicle: Vehicle
    model: VehicleModel | None
    state: Array
    change: Array
    clock: Clock
    push: Array | None = None
    lacking: DrawnLack | None = None

    def machine(self) -> tuple[Machine, Callable[[int, Machine], Flat]]:
        """Trace a step, and give what it is to be given by number."""
        rotors, turning = len(self.vehicle.settings.rotors), turning_of(self.vehicle, self.model)
        pilot, push, lacking, step = self.pilot, self.push, self.lacking, self.clock.step
        columns = [each for each in (push, None if lacking is None else lacking.unit) if each is not None]
        rows = np.hstack(columns).tolist() if columns else [()] * self.clock.steps
        sizes = {
            "piloted": pilot.size(rotors),
            "push": 0 if push is None else 6,
            "unit": 0 if lacking is None else 6,
            "turning": 0 if turning is None else TURNING_NUMBERS,
        }
        states = len(self.state)

        def given(number: int, machine: Machine) -> Flat:
            state = machine.kept[:states]
            piloted = pilot.given(number, state)
            if turning is None:
                return (*piloted, *rows[number])
            middle = [x + 0.5 * step * rate for x, rate in zip(state, machine.kept[states:], strict=False)]
            return (*piloted, *rows[number], *turning(tuple(middle)))

        def build(memory: Memory, numbers: tuple[Symbol, ...]) -> Vector:
            parts, first = {}, 0
            for name, size in sizes.items():
                parts[name], first = numbers[first : first + size], first + size
            return self._traced(memory, parts)

        return Machine.of(build, sum(sizes.values()), step), given

    def _traced(self, memory: Memory, given: Mapping[str, Vector]) -> Vector:
        """Take a step: derivative; command, lagged command, logged speeds, voltage and demand in its middle."""
        state, change = memory.recall(self.state.tolist()), memory.recall(self.change.tolist())
        middle = add(state.values, scaled(0.5 * memory.step, change.values))
        command, demand = self.pilot.commanded(given["piloted"], middle)
        rotors = self.actuators.rotors(command, memory)
        instant = self.vehicle.instant(middle, rotors.speed, rotors.acceleration, rotors.slow)
        push = given["push"] or None
        if self.lacking is not None:
            lacking = self.lacking.at(given["unit"], wrench_by_part(self.lacking.model.parts, _evenly(instant)))
            push = lacking if push is None else add(push, lacking)
        turning = given_turning(given["turning"]) if given["turning"] else None
        now = self.vehicle.derivative(instant, middle, push, turning)
        state.keep(add(state.values, scaled(memory.step, now)))
        change.keep(now)
        return (*now, *command, *rotors.lagged, *rotors.measured, rotors.voltage, *demand)


def _evenly(instant: Instant) -> Instant:
    """See the same flow on a body that does not turn, whose rotors all turn alike."""
    square = instant.functions.total(instant.rotor_speed**2) * (1 / len(instant.vehicle.rotors))
    speed = Each([instant.functions.sqrt(square)] * len(instant.vehicle.rotors))
    return Instant(instant.vehicle, speed, instant.air_velocity, slow_square=speed**2, functions=instant.functions)


@dataclass(frozen=True)
class SimulatedMotion:
    """The simulated motion at the samples of the plan.

    State of the plant and its derivative; command, command after the lag, and rotor speed, rad/s; voltage as a share of
    the full battery; `demand`: squared speeds that the autopilot asked for, not clipped, rad^2/s^2.
    """

    state: Array
    change: Array
    command: Array
    lagged: Array
    speed: Array
    voltage: Array
    demand: Array


@dataclass(frozen=True)
class ClosedLoop:
    """What flies, and by which settings.

    `vehicle`: as the autopilot knows it; `model`: in its place, as far as its table of weights gives it; `effects`:
    that the autopilot does not know. `with_effects` gives both.
    """

    vehicle: VehicleSettings
    settings: ClosedLoopSettings
    model: VehicleModel | None = None
    effects: SimulatedEffects = field(default_factory=SimulatedEffects)


def fly(
    loop: ClosedLoop,
    time: Array,
    planned: Mapping[str, Array],
    progress: Callable[[float, int], None],
    push: Array | None = None,
    noise: GyroscopeNoise | None = None,
) -> SimulatedMotion:
    """Integrate a closed-loop flight along a planned motion, sampled uniformly.

    `planned`: `attitude`, `attitude_rate`, `attitude_acceleration`, `position`, `velocity`, `acceleration`, shape
    (time, 3) each; `progress`: called with steps done and steps in all; `push`: torque and force of gusts in the middle
    of each step of `clock_of`, N m and N, body frame; `noise`: in the loop of an autopilot of `settings.autopilot` that
    is not `cpfls`. `ComputationError` where the vehicle leaves the path or overturns.
    """
    vehicle, settings = loop.vehicle, loop.settings
    clock = clock_of(time, settings)
    autopilot, mix = Autopilot(vehicle, settings), mixer(vehicle)
    planned_pilot = PlanPilot(autopilot, mix, plan_of(planned, time, clock.instants))
    attitude, rate = planned["attitude"][:1], planned["attitude_rate"][:1]
    state = np.zeros(VEHICLE_STATES)
    state[POSITION], state[VELOCITY] = planned["position"][0], planned["velocity"][0]
    state[ATTITUDE], state[BODY_RATE] = attitude[0], rotations.body_rate(attitude, rate)[0]
    speed = np.array([*planned_pilot.commanded(planned_pilot.plan[0], tuple(state.tolist()))[0]])
    pilot: Pilot = planned_pilot
    if settings.law is not None:
        motors = Motors.of(settings.law.mixer, settings.law.curve, vehicle)
        asked = along_path(planned_pilot, motors, vehicle)
        pilot = law_pilot(settings.law, motors, asked, clock.step, speed, noise)
    flight, path = _integration(loop, pilot, state, speed, clock, push), planned["position"].tolist()

    def check(sample: int, state: Flat) -> None:
        _refuse_lost(state, time, sample)
        _refuse_far(dist(state[POSITION], path[sample]), time[sample], settings.deviation_max_m)

    return flown(flight, check, progress)


@dataclass(frozen=True)
class Setpoints:
    """What an autopilot's own law is asked for, time first; a setpoint stays until the next.

    `attitude`: roll, pitch, yaw, rad, None where rates alone are asked for; `body_rate`: added to what that asks for,
    rad/s; `thrust`: share of the full thrust, in the units of the law.
    """

    attitude: Array | None
    body_rate: Array | None
    thrust: Array


def fly_setpoints(
    loop: ClosedLoop,
    time: Array,
    setpoints: Setpoints,
    start: Array,
    push: Array | None = None,
    noise: GyroscopeNoise | None = None,
    speed: Array | None = None,
    injected: Array | None = None,
    lacking: DrawnLack | None = None,
) -> SimulatedMotion:
    """Integrate the law of `settings.autopilot` and a vehicle along setpoints of attitude or rate and thrust.

    `start`: position and velocity in the world, roll, pitch, yaw, body rate, m, m/s, rad, rad/s; `speed`: of the rotors
    at the start, None for what the first thrust asks of them; `injected`: added to the commands about the body axes at
    each step of `clock_of`, shares of the full ones; the rest as `fly` takes it. `ComputationError` where time is not
    sampled uniformly, or the vehicle overturns.
    """
    law = loop.settings.law
    if law is None:
        raise ValueError("setpoints are flown by the law of an autopilot; name one in settings.autopilot")
    clock = clock_of(time, loop.settings)
    motors = Motors.of(law.mixer, law.curve, loop.vehicle)
    if speed is None:
        speed = motors.speeds(float(setpoints.thrust[0]), np.zeros(3)).speed
    pilot = law_pilot(law, motors, _as_asked(setpoints, clock.parts), clock.step, speed, noise, injected)
    flight = _integration(loop, pilot, np.array(start, dtype=float), speed, clock, push)
    flight.lacking = lacking
    return flown(flight, lambda sample, state: _refuse_lost(state, time, sample), lambda _done, _all: None)


def _as_asked(setpoints: Setpoints, parts: int) -> Callable[[int, Flat], Asked]:
    count = len(setpoints.thrust)
    targets: list[Flat | None] = [None] * count
    if setpoints.attitude is not None:
        targets = [tuple(row) for row in rotations.rotation_matrix(setpoints.attitude).reshape(-1, 9).tolist()]
    rates = np.zeros((count, 3)) if setpoints.body_rate is None else setpoints.body_rate
    samples = list(map(Asked, targets, map(tuple, rates.tolist()), setpoints.thrust.tolist()))
    return lambda number, _state: samples[min(number // parts, count - 1)]


def flown(
    flight: Integration, check: Callable[[int, Flat], None], progress: Callable[[float, int], None]
) -> SimulatedMotion:
    """Take all steps, and check the state at each sample."""
    clock, size = flight.clock, len(flight.state)
    machine, given = flight.machine()
    states, steps = [machine.kept[:size]], []
    try:
        for number in range(clock.steps):
            steps.append(machine.advance(given(number, machine)))
            if (number + 1) % clock.parts == 0:
                state = machine.kept[:size]
                check(len(states), state)
                states.append(state)
            if number % _STEPS_BETWEEN_REPORTS == 0:
                progress(number, clock.steps)
    except (ArithmeticError, ValueError):
        # What is lost may be beyond all numbers before the next sample.
        check(len(states), (np.nan,) * size)
    progress(clock.steps, clock.steps)
    # Values are of the middle of steps.
    places = np.cumsum([size, *[len(flight.vehicle.settings.rotors)] * 3, 1])
    of_samples = np.split(between(np.array(steps))[:: clock.parts], places, axis=1)
    change, command, lagged, speed, voltage, demand = of_samples
    return SimulatedMotion(np.array(states), change, command, lagged, speed, voltage[:, 0], demand)


def _integration(
    loop: ClosedLoop, pilot: Pilot, state: Array, speed: Array, clock: Clock, push: Array | None
) -> Integration:
    """Set up the integration at a state, shape (12,), with the rotors at a speed that they were commanded to."""
    flown = flown_vehicle(loop.vehicle, loop.model, loop.effects)
    state = np.concatenate([state, flown.start])
    change = settled(flown, loop.model, state, speed, None if push is None else push[0])
    response = RotorResponse() if loop.model is None else loop.model.response
    chain = actuators(loop.effects, response, loop.vehicle, loop.settings, speed, clock.step * clock.steps)
    return Integration(pilot, chain, flown, loop.model, state, change, clock, push)


class LostVehicleError(ComputationError):
    """A vehicle that no autopilot holds any more, seen at a sample."""

    def __init__(self, message: str, sample: int) -> None:
        super().__init__(message)
        self.sample = sample


def _refuse_lost(state: Flat, time: Array, sample: int) -> None:
    if not all(map(isfinite, state)):
        raise LostVehicleError(f"the flight is out of control at t = {time[sample]:g} s: {_REMEDY}", sample)
    roll, pitch, _ = state[ATTITUDE]
    if cos(roll) * cos(pitch) <= 0:
        raise LostVehicleError(f"the vehicle tilts beyond 90 degrees at t = {time[sample]:g} s: {_REMEDY}", sample)


def _refuse_far(away: float, time: float, limit: float) -> None:
    if away > limit:
        raise ComputationError(
            f"the vehicle is {away:.3g} m away from the path at t = {time:g} s (limit "
            f"simulation.closed_loop.deviation_max_m = {limit:g}): {_REMEDY}"
        )
