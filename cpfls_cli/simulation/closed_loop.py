"""The closed loop of autopilot, actuators and vehicle, integrated along a planned motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, cos, pi
from typing import TYPE_CHECKING, Protocol

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.autopilots.motors import Motors
from cpfls_cli.dynamics.rigid_body import inertia_tensor
from cpfls_cli.errors import ComputationError
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulation.actuators import Actuators, Mixer, Rotors, actuators, mixer
from cpfls_cli.simulation.law_pilot import Asked, GyroscopeNoise, integration_rate, law_pilot
from cpfls_cli.simulation.model import SimulatedEffects
from cpfls_cli.simulation.plant import (
    ATTITUDE,
    BODY_RATE,
    POSITION,
    VEHICLE_STATES,
    VELOCITY,
    Plant,
    plant_of,
)
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.trajectory.planning import sample_interval
from cpfls_cli.vehicle.settings import VehicleSettings

if TYPE_CHECKING:
    from cpfls_cli.playback.lack import DrawnLack
    from cpfls_cli.playback.model import VehicleModel

_ROUNDING = 1e-6
_STEPS_BETWEEN_REPORTS = 100
_REMEDY = "fly more gently, make the effects smaller, or change the frequencies of simulation.closed_loop"


@dataclass(frozen=True)
class Reference:
    """A planned motion at the steps of the autopilot; time is the first axis.

    Attributes
    ----------
    position, velocity, acceleration : array, shape (time, 3), m and s, world frame
    attitude : array, shape (time, 3), rad
    body_rate : array, shape (time, 3), rad/s, body frame
    body_acceleration : array, shape (time, 3), rad/s^2, body frame
    """

    position: Array
    velocity: Array
    acceleration: Array
    attitude: Array
    body_rate: Array
    body_acceleration: Array


def reference(planned: Mapping[str, Array], time: Array, at: Array) -> Reference:
    """Interpolate a planned motion by cubic splines.

    Parameters
    ----------
    planned : mapping of str to array
        `attitude`, `attitude_rate`, `attitude_acceleration`, `position`, `velocity`, `acceleration`, shape
        (time, 3) each.
    time : array, shape (time,), s
    at : array, shape (step,), s
        Times asked for.
    """
    from scipy.interpolate import CubicSpline

    names = ("position", "velocity", "acceleration", "attitude", "attitude_rate", "attitude_acceleration")
    splines = CubicSpline(time, np.stack([planned[name] for name in names], axis=1))
    position, velocity, acceleration, q, qd, qdd = np.moveaxis(splines(at), 1, 0)
    return Reference(
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        attitude=q,
        body_rate=rotations.body_rate(q, qd),
        body_acceleration=rotations.body_acceleration(q, qd, qdd),
    )


class Autopilot:
    """Track a planned motion with the vehicle's model, without knowledge of the effects.

    References
    ----------
    Lee, Leok and McClamroch 2010, Geometric tracking control of a quadrotor UAV on SE(3).
    """

    def __init__(self, vehicle: VehicleSettings, settings: ClosedLoopSettings, planned: Reference) -> None:
        position = 2 * pi * settings.position_frequency_hz
        attitude = 2 * pi * np.array([settings.attitude_frequency_hz] * 2 + [settings.yaw_frequency_hz])
        self._position_gain, self._velocity_gain = position**2, 2 * settings.position_damping * position
        self._attitude_gain, self._rate_gain = attitude**2, 2 * settings.attitude_damping * attitude
        self._planned = planned
        self._inertia = inertia_tensor(vehicle)
        self._mass = vehicle.mass_kg
        self._gravity = np.array([0.0, 0.0, vehicle.gravity_m_s2])

    def wrench(self, step: int, position: Array, velocity: Array, rotation: Array, body_rate: Array) -> Array:
        """Compute the thrust and the torque that the motion asks for.

        Parameters
        ----------
        step : int
            Index into the planned motion.
        position, velocity : array, shape (3,), m and m/s, world frame
        rotation : array, shape (3, 3)
            Body to world.
        body_rate : array, shape (3,), rad/s, body frame

        Returns
        -------
        array, shape (4,), N and N m
            Thrust along body z, body torque.
        """
        pull = self._pull(step, position, velocity)
        target = upright(pull, self._planned.attitude[step, 2])
        torque = self._torque(step, target.T @ rotation, body_rate)
        return np.array([self._mass * (pull @ rotation[:, 2]), *torque])

    def target(self, step: int, position: Array, velocity: Array) -> Array:
        """Orient the body as the path asks for, shape (3, 3), body to world; arguments are those of `wrench`."""
        return upright(self._pull(step, position, velocity), self._planned.attitude[step, 2])

    def _pull(self, step: int, position: Array, velocity: Array) -> Array:
        """Compute what the thrust has to pull with, shape (3,), m/s^2, world frame."""
        planned = self._planned
        pull = self._gravity + planned.acceleration[step] + self._position_gain * (planned.position[step] - position)
        return np.asarray(pull + self._velocity_gain * (planned.velocity[step] - velocity))

    def _torque(self, step: int, turned: Array, body_rate: Array) -> Array:
        """Compute the torque that turns the body to its target attitude."""
        (_, xy, xz), (yx, _, yz), (zx, zy, _) = turned.tolist()
        error = np.array([0.5 * (zy - yz), 0.5 * (xz - zx), 0.5 * (yx - xy)])
        rate_error = body_rate - turned.T @ self._planned.body_rate[step]
        wanted = turned.T @ self._planned.body_acceleration[step]
        wanted = wanted - self._attitude_gain * error - self._rate_gain * rate_error
        return np.asarray(self._inertia @ wanted + rotations.cross(body_rate, self._inertia @ body_rate))


def upright(pull: Array, yaw: float) -> Array:
    """Orient a body whose z axis points along the pull, with a given yaw.

    Parameters
    ----------
    pull : array, shape (3,), world frame
    yaw : float, rad

    Returns
    -------
    array, shape (3, 3)
        Body to world.
    """
    up = pull / np.sqrt(pull @ pull)
    # By the definition of yaw the x axis lies in the vertical plane of the heading, however the body rolls.
    forward = rotations.cross(np.array([-np.sin(yaw), np.cos(yaw), 0.0]), up)
    forward /= np.sqrt(forward @ forward)
    return np.array([forward, rotations.cross(up, forward), up]).T.copy()


@dataclass(frozen=True)
class Clock:
    """Steps of the integration between the samples of the plan.

    Attributes
    ----------
    parts : int
        Steps from sample to sample.
    step : float, s
    instants : array, shape (1 + step,), s
        The start, then the middle of each step.
    """

    parts: int
    steps: int
    step: float
    instants: Array


def clock_of(time: Array, settings: ClosedLoopSettings) -> Clock:
    """Divide the samples of a plan, shape (time,), s, into steps of the integration and of the autopilot's law."""
    period = sample_interval(time, "a flight in closed loop")
    rate = integration_rate(settings.law, settings.integration_rate_hz)
    parts = ceil(period * rate - _ROUNDING)
    steps, step = (len(time) - 1) * parts, period / parts
    return Clock(parts, steps, step, time[0] + step * np.concatenate([[0.0], np.arange(steps) + 0.5]))


def between(middles: Array) -> Array:
    """Interpolate values from the middles of steps to their ends linearly.

    Parameters
    ----------
    middles : array, shape (step, ...)
        Those of the ends have the shape (1 + step, ...).
    """
    if len(middles) < 2:
        return np.concatenate([middles, middles])
    ends = 2 * middles[0] - middles[1], 2 * middles[-1] - middles[-2]
    longer = np.concatenate([ends[0][None], middles, ends[1][None]])
    return np.asarray(0.5 * (longer[1:] + longer[:-1]))


@dataclass(frozen=True)
class LoopStep:
    """Derivative, rotors and demand in the middle of a step.

    Attributes
    ----------
    change : array, shape (state,)
        Derivative of the state, in the middle of the step.
    rotors : Rotors
        In the middle of the step.
    demand : array, shape (rotor,), rad^2/s^2
        Squared speeds that the autopilot asked for, not clipped.
    """

    change: Array
    rotors: Rotors
    demand: Array


class Pilot(Protocol):
    """What commands the rotors."""

    def command(self, number: int, start: Array, middle: Array) -> tuple[Array, Array]:
        """Command a step.

        Parameters
        ----------
        number : int
            Steps done so far.
        start, middle : array, shape (state,)
            The state at the start of the step, and in its middle.

        Returns
        -------
        command : array, shape (rotor,), rad/s
        demand : array, shape (rotor,), rad^2/s^2
            Squared speeds asked for, possible or not.
        """


@dataclass(frozen=True)
class PlanPilot:
    """The autopilot that knows the vehicle, with its mixer; it answers at once."""

    autopilot: Autopilot
    mixer: Mixer

    def command(self, number: int, start: Array, middle: Array) -> tuple[Array, Array]:  # noqa: ARG002
        """Command a step; the plan has the start before the middle of each step."""
        wrench = self.autopilot.wrench(number + 1, *_seen(middle))
        return self.mixer.command(wrench), self.mixer.demand(wrench)


@dataclass
class Loop:
    """The midpoint rule with one evaluation a step.

    The middle of a step is reached with the derivative of the step before, so that the rule is of second order.

    Attributes
    ----------
    state : array, shape (state,)
    change : array, shape (state,)
        Derivative of the state in the step before.
    push : array, shape (step, 6), N m and N, body frame
        Of gusts, in the middle of each step.
    lacking : DrawnLack or None
        What acts beside it and the model lacks.
    """

    pilot: Pilot
    actuators: Actuators
    plant: Plant
    state: Array
    change: Array
    push: Array
    lacking: DrawnLack | None = None

    def advance(self, number: int) -> LoopStep:
        """Take one step.

        Parameters
        ----------
        number : int
            Steps done so far.
        """
        middle = self.state + 0.5 * self.actuators.step * self.change
        command, demand = self.pilot.command(number, self.state, middle)
        rotors = self.actuators.advance(command)
        push = self.push[number]
        if self.lacking is not None:
            _, velocity, rotation, _ = _seen(middle)
            push = push + self.lacking.at(number, velocity @ rotation, rotors.speed)
        self.change = self.plant.derivative(middle, rotors, push)
        self.state = self.state + self.actuators.step * self.change
        return LoopStep(self.change, rotors, demand)


@dataclass(frozen=True)
class SimulatedMotion:
    """The simulated motion at the samples of the plan.

    Attributes
    ----------
    state, change : array, shape (time, state)
        State of the plant and its derivative.
    command, lagged, speed : array, shape (time, rotor), rad/s
        Command, command after the lag, and rotor speed.
    voltage : array, shape (time,)
        Share of the full battery.
    demand : array, shape (time, rotor), rad^2/s^2
        Squared speeds that the autopilot asked for, not clipped.
    """

    state: Array
    change: Array
    command: Array
    lagged: Array
    speed: Array
    voltage: Array
    demand: Array


def fly(
    time: Array,
    planned: Mapping[str, Array],
    vehicle: VehicleSettings,
    settings: ClosedLoopSettings,
    model: VehicleModel | None,
    effects: SimulatedEffects,
    progress: Callable[[float, int], None],
    push: Array | None = None,
    noise: GyroscopeNoise | None = None,
) -> SimulatedMotion:
    """Integrate a closed-loop flight along a planned motion.

    Parameters
    ----------
    time : array, shape (time,), s
        Uniform.
    planned : mapping of str to array
        `attitude`, `attitude_rate`, `attitude_acceleration`, `position`, `velocity`, `acceleration`, shape
        (time, 3) each.
    model : VehicleModel or None
        In place of the vehicle, as far as its table of weights gives it.
    effects : SimulatedEffects
        That the autopilot does not know.
    progress : callable
        Takes steps done and steps in all.
    push : array, shape (step, 6), N m and N, body frame, or None
        Torque and force of gusts in the middle of each step of `clock_of`.
    noise : GyroscopeNoise or None
        In the loop of an autopilot of `settings.autopilot` that is not `cpfls`.

    Raises
    ------
    ComputationError
        If the plan is not sampled uniformly, or the vehicle leaves the path or overturns.
    """
    clock = clock_of(time, settings)
    autopilot = Autopilot(vehicle, settings, reference(planned, time, clock.instants))
    attitude, rate = planned["attitude"][:1], planned["attitude_rate"][:1]
    state = np.zeros(VEHICLE_STATES)
    state[POSITION], state[VELOCITY] = planned["position"][0], planned["velocity"][0]
    state[ATTITUDE], state[BODY_RATE] = attitude[0], rotations.body_rate(attitude, rate)[0]
    mix = mixer(vehicle)
    speed = mix.command(autopilot.wrench(0, *_seen(state)))
    pilot: Pilot = PlanPilot(autopilot, mix)
    if settings.law is not None:
        motors = Motors.of(settings.law.mixer, settings.law.curve, vehicle)
        pilot = law_pilot(settings.law, motors, _along_path(autopilot, motors, vehicle), clock.step, speed, noise)
    flight = _loop(pilot, state, speed, vehicle, settings, model, effects, clock, push)

    def check(sample: int, state: Array) -> None:
        _refuse_lost(state, time, sample)
        _refuse_far(state, planned["position"][sample], time[sample], settings.deviation_max_m)

    return _flown(flight, clock, check, progress)


@dataclass(frozen=True)
class Setpoints:
    """What an autopilot's own law is asked for, time first; a setpoint stays until the next.

    Attributes
    ----------
    attitude : array, shape (time, 3), rad, or None
        Roll, pitch, yaw; None where rates alone are asked for.
    body_rate : array, shape (time, 3), rad/s, body frame, or None
        Asked beside what the attitude asks for; None for none.
    thrust : array, shape (time,)
        Share of the full thrust, in the units of the law.
    """

    attitude: Array | None
    body_rate: Array | None
    thrust: Array


def fly_setpoints(
    time: Array,
    setpoints: Setpoints,
    start: Array,
    vehicle: VehicleSettings,
    settings: ClosedLoopSettings,
    model: VehicleModel | None,
    effects: SimulatedEffects,
    push: Array | None = None,
    noise: GyroscopeNoise | None = None,
    speed: Array | None = None,
    injected: Array | None = None,
    lacking: DrawnLack | None = None,
) -> SimulatedMotion:
    """Integrate the law of `settings.autopilot` and a vehicle along setpoints of attitude or rate and thrust.

    Parameters
    ----------
    time : array, shape (time,), s
        Uniform.
    start : array, shape (12,)
        Position and velocity in the world, roll, pitch, yaw, body rate: m, m/s, rad, rad/s.
    model, effects, push, noise
        As `fly` takes them.
    speed : array, shape (rotor,), rad/s, or None
        Of the rotors at the start; None for what the first thrust asks of them.
    injected : array, shape (step, 3), or None
        Added to the commands about the body axes at each step of `clock_of`, shares of the full ones.
    lacking : DrawnLack or None
        What the model lacks, drawn for the steps of `clock_of`.

    Raises
    ------
    ComputationError
        If time is not sampled uniformly, or the vehicle overturns.
    """
    law = settings.law
    if law is None:
        raise ValueError("setpoints are flown by the law of an autopilot; name one in settings.autopilot")
    clock = clock_of(time, settings)
    motors = Motors.of(law.mixer, law.curve, vehicle)
    if speed is None:
        speed = motors.speeds(float(setpoints.thrust[0]), np.zeros(3)).speed
    pilot = law_pilot(law, motors, _as_asked(setpoints, clock.parts), clock.step, speed, noise, injected)
    flight = _loop(pilot, np.array(start, dtype=float), speed, vehicle, settings, model, effects, clock, push)
    flight.lacking = lacking
    return _flown(flight, clock, lambda sample, state: _refuse_lost(state, time, sample), lambda _done, _all: None)


def _as_asked(setpoints: Setpoints, parts: int) -> Callable[[int, Array], Asked]:
    targets = None if setpoints.attitude is None else rotations.rotation_matrix(setpoints.attitude)
    rates = np.zeros((len(setpoints.thrust), 3)) if setpoints.body_rate is None else setpoints.body_rate

    def asked(number: int, _state: Array) -> Asked:
        sample = min(number // parts, len(rates) - 1)
        target = None if targets is None else targets[sample]
        return Asked(target, rates[sample], float(setpoints.thrust[sample]))

    return asked


def _along_path(autopilot: Autopilot, motors: Motors, vehicle: VehicleSettings) -> Callable[[int, Array], Asked]:
    """Ask for attitude and thrust along a path, in the units of a law."""
    lift = sum(rotor.thrust_factor_n_s2 for rotor in vehicle.rotors)

    def asked(number: int, state: Array) -> Asked:
        position, velocity, rotation, body_rate = _seen(state)
        thrust = float(autopilot.wrench(number, position, velocity, rotation, body_rate)[0])
        share = motors.share_of(float(np.sqrt(max(thrust, 0.0) / lift)))
        return Asked(autopilot.target(number, position, velocity), np.zeros(3), share)

    return asked


def _flown(
    flight: Loop,
    clock: Clock,
    check: Callable[[int, Array], None],
    progress: Callable[[float, int], None],
) -> SimulatedMotion:
    """Take all steps, and check the state at each sample."""
    states, steps = [flight.state], []
    # A vehicle that is lost may reach infinity before the next sample, where it is told.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for number in range(clock.steps):
            steps.append(flight.advance(number))
            if (number + 1) % clock.parts == 0:
                check(len(states), flight.state)
                states.append(flight.state)
            if number % _STEPS_BETWEEN_REPORTS == 0:
                progress(number, clock.steps)
    progress(clock.steps, clock.steps)
    return _sampled(np.array(states), steps, clock.parts)


def asked(
    time: Array,
    planned: Mapping[str, Array],
    vehicle: VehicleSettings,
    settings: ClosedLoopSettings,
    state: Array,
) -> dict[str, Array]:
    """Give what the autopilot asked for along a flight: of its position loop the plan, of its attitude loop the target.

    Parameters
    ----------
    time, planned
        As `fly` takes them.
    state : array, shape (time, state)
        Of the flight, at the samples of the plan.

    Returns
    -------
    dict of str to array, shape (time, 3), m, m/s, rad
        ``position`` and ``velocity`` in the world frame; ``attitude`` as roll, pitch, yaw, within half a turn of those
        that are flown; of an autopilot's own law ``thrust`` too, shape (time,), N.
    """
    autopilot = Autopilot(vehicle, settings, reference(planned, time, time))
    targets = [autopilot.target(step, own[POSITION], own[VELOCITY]) for step, own in enumerate(state)]
    flown = state[:, ATTITUDE]
    attitude = flown + rotations.wrapped(rotations.euler_angles(np.array(targets)) - flown)
    found = {"position": planned["position"], "velocity": planned["velocity"], "attitude": attitude}
    if settings.law is not None:
        found["thrust"] = np.array([autopilot.wrench(step, *_seen(own))[0] for step, own in enumerate(state)])
    return found


def _loop(
    pilot: Pilot,
    state: Array,
    speed: Array,
    vehicle: VehicleSettings,
    settings: ClosedLoopSettings,
    model: VehicleModel | None,
    effects: SimulatedEffects,
    clock: Clock,
    push: Array | None,
) -> Loop:
    """Set up the loop at a state, shape (12,), with the rotors at a speed that they were commanded to."""
    plant = plant_of(vehicle, model, effects, state, speed)
    state = np.concatenate([state, *(body.start for body in plant.carried)])
    push = np.zeros((clock.steps, 6)) if push is None else push
    change = plant.derivative(state, Rotors.settled(speed), push[0])
    response = RotorResponse() if model is None else model.response
    chain = actuators(effects, response, vehicle, settings, speed, clock.step, clock.step * clock.steps)
    return Loop(pilot, chain, plant, state, change, push)


def _seen(state: Array) -> tuple[Array, Array, Array, Array]:
    """Give position, velocity, rotation and body rate, as an autopilot takes them."""
    rotation = rotations.rotation_matrix(state[None, ATTITUDE])[0]
    return state[POSITION], state[VELOCITY], rotation, state[BODY_RATE]


class LostVehicleError(ComputationError):
    """A vehicle that no autopilot holds any more.

    Attributes
    ----------
    sample : int
        At which it was seen.
    """

    def __init__(self, message: str, sample: int) -> None:
        super().__init__(message)
        self.sample = sample


def _refuse_lost(state: Array, time: Array, sample: int) -> None:
    if not np.isfinite(state).all():
        raise LostVehicleError(f"the flight is out of control at t = {time[sample]:g} s: {_REMEDY}", sample)
    roll, pitch, _ = state[ATTITUDE]
    if cos(roll) * cos(pitch) <= 0:
        raise LostVehicleError(f"the vehicle tilts beyond 90 degrees at t = {time[sample]:g} s: {_REMEDY}", sample)


def _refuse_far(state: Array, planned: Array, time: float, limit: float) -> None:
    away = float(np.linalg.norm(state[POSITION] - planned))
    if away > limit:
        raise ComputationError(
            f"the vehicle is {away:.3g} m away from the path at t = {time:g} s (limit "
            f"simulation.closed_loop.deviation_max_m = {limit:g}): {_REMEDY}"
        )


def _sampled(states: Array, steps: Sequence[LoopStep], parts: int) -> SimulatedMotion:
    """Interpolate values in the middle of steps to the samples."""

    def at_samples(of_step: Callable[[LoopStep], Array | float]) -> Array:
        return between(np.array([of_step(step) for step in steps]))[::parts]

    return SimulatedMotion(
        state=states,
        change=at_samples(lambda step: step.change),
        command=at_samples(lambda step: step.rotors.command),
        lagged=at_samples(lambda step: step.rotors.lagged),
        speed=at_samples(lambda step: step.rotors.measured),
        voltage=at_samples(lambda step: step.rotors.voltage),
        demand=at_samples(lambda step: step.demand),
    )
