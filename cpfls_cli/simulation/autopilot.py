"""Who flies: the autopilot that knows the vehicle and tracks a plan, and the own law of another, at its own rate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import ceil, pi
from typing import NamedTuple

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.autopilots.law import Controller, Law, attitude_error
from cpfls_cli.autopilots.motors import Motors, fitting_yaw
from cpfls_cli.inertia import symmetric
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.vehicle.motion import ATTITUDE, BODY_RATE, VEHICLE_STATES, rotation_rows
from cpfls_cli.vehicle.rotors import rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.stepping import Flat, Machine, Memory
from cpfls_cli.vehicle.tracing import SYMBOLS, Symbol
from cpfls_cli.vehicle.values import (
    ARRAYS,
    Each,
    Functions,
    Value,
    Vector,
    add,
    apply,
    cross,
    dot,
    minus,
    scaled,
    subtract,
    times,
    transposed,
)

PLANNED = 16
"""Numbers of a `Planned`."""
_PLANNED = ("position", "velocity", "acceleration", "attitude", "attitude_rate", "attitude_acceleration")


class Planned(NamedTuple):
    """A planned motion at an instant, SI; the first three in the world frame, rates in the body frame."""

    position: Vector
    velocity: Vector
    acceleration: Vector
    body_rate: Vector
    body_acceleration: Vector
    yaw: Value

    @classmethod
    def of(cls, numbers: Vector) -> Planned:
        """Arrange `PLANNED` numbers."""
        return cls(numbers[0:3], numbers[3:6], numbers[6:9], numbers[9:12], numbers[12:15], numbers[15])


def plan_of(planned: Mapping[str, Array], time: Array, at: Array) -> list[Flat]:
    """Interpolate a planned motion (as `fly` takes it) by cubic splines, as `Planned` arranges it."""
    from scipy.interpolate import CubicSpline

    splines = CubicSpline(time, np.stack([planned[name] for name in _PLANNED], axis=1))
    return list(map(tuple, _plan(*np.moveaxis(splines(at), 1, 0)).tolist()))


def _plan(*signals: Array) -> Array:
    """Arrange signals of a plan, in the order of `_PLANNED`, as `Planned` does, time first."""
    position, velocity, acceleration, q, qd, qdd = signals
    rates = rotations.body_rate(q, qd), rotations.body_acceleration(q, qd, qdd)
    return np.column_stack([position, velocity, acceleration, *rates, q[:, 2]])


class Autopilot:
    """Thrust and torque that a planned motion asks for.

    Lee, Leok and McClamroch 2010, Geometric tracking control of a quadrotor UAV on SE(3).
    """

    def __init__(self, vehicle: VehicleSettings, settings: ClosedLoopSettings, functions: Functions = SYMBOLS) -> None:
        position = 2 * pi * settings.position_frequency_hz
        attitude = [2 * pi * each for each in (*[settings.attitude_frequency_hz] * 2, settings.yaw_frequency_hz)]
        self._position_gain, self._velocity_gain = position**2, 2 * settings.position_damping * position
        self._attitude_gain = tuple(each**2 for each in attitude)
        self._rate_gain = tuple(2 * settings.attitude_damping * each for each in attitude)
        self._inertia = tuple(map(tuple, symmetric(vehicle.inertia_kg_m2).tolist()))
        self._vehicle, self._functions = vehicle, functions

    def wrench(self, planned: Planned, state: Vector, rotation: tuple[Vector, ...]) -> Vector:
        """Compute thrust in N along body z and torque in N m.

        Parameters
        ----------
        state : vector
            Of the vehicle.
        rotation : rows of a matrix
            Body to world.
        """
        pull = self._pull(planned, state)
        # The body as the target sees it.
        axes, columns = upright(pull, planned.yaw, self._functions), transposed(rotation)
        turned = transposed([apply(axes, column) for column in columns])
        thrust = self._vehicle.mass_kg * dot(pull, columns[2])
        return (thrust, *self._torque(planned, turned, state[9:12]))

    def target(self, planned: Planned, state: Vector) -> tuple[Vector, ...]:
        """Orient the body as the path asks for: rows of a matrix, body to world."""
        return transposed(upright(self._pull(planned, state), planned.yaw, self._functions))

    def _pull(self, planned: Planned, state: Vector) -> Vector:
        """Compute what the thrust has to pull with, m/s^2, world frame."""
        position, velocity = state[:3], state[3:6]
        return add(
            (0, 0, self._vehicle.gravity_m_s2),
            planned.acceleration,
            scaled(self._position_gain, subtract(planned.position, position)),
            scaled(self._velocity_gain, subtract(planned.velocity, velocity)),
        )

    def _torque(self, planned: Planned, turned: tuple[Vector, ...], body_rate: Vector) -> Vector:
        """Compute the torque that turns the body to its target attitude."""
        (_, xy, xz), (yx, _, yz), (zx, zy, _) = turned
        error = (0.5 * (zy - yz), 0.5 * (xz - zx), 0.5 * (yx - xy))
        back = transposed(turned)
        rate_error = subtract(body_rate, apply(back, planned.body_rate))
        wanted = apply(back, planned.body_acceleration)
        wanted = subtract(wanted, map(times, self._attitude_gain, error))
        wanted = subtract(wanted, map(times, self._rate_gain, rate_error))
        return add(apply(self._inertia, wanted), cross(body_rate, apply(self._inertia, body_rate)))


def upright(pull: Vector, yaw: Value, functions: Functions = SYMBOLS) -> tuple[Vector, ...]:
    """Orient a body whose z axis points along the pull, with a given yaw, rad: its axes in the world frame."""
    up = scaled(1 / functions.sqrt(dot(pull, pull)), pull)
    # By the definition of yaw the x axis lies in the vertical plane of the heading, however the body rolls.
    forward = cross((minus(0, functions.sin(yaw)), functions.cos(yaw), 0), up)
    forward = scaled(1 / functions.sqrt(dot(forward, forward)), forward)
    return forward, cross(up, forward), up


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
class PlanPilot:
    """The autopilot that knows the vehicle, with its mixer; it answers at once, in the middle of each step.

    The plan is at the start, then in the middle of each step.
    """

    autopilot: Autopilot
    mixer: Mixer
    plan: list[Flat]

    def size(self, _rotors: int) -> int:
        """Count the numbers of a planned motion."""
        return PLANNED

    def given(self, number: int, _start: Flat) -> Flat:
        """Give the planned motion."""
        return self.plan[number + 1]

    def commanded(self, given: Vector, middle: Vector) -> tuple[Value, Value]:
        """Command the rotors."""
        rotation = rotation_rows(middle[ATTITUDE], SYMBOLS)
        return self.mixer.mixed(self.autopilot.wrench(Planned.of(given), middle, rotation))


@dataclass(frozen=True)
class GyroscopeNoise:
    """White noise of the gyroscope, which the law answers, by its standard deviation at each step of the law, rad/s."""

    std: float
    rng: np.random.Generator


class Asked(NamedTuple):
    """What a law is asked for.

    `attitude`: body to world, row by row, None where rates are asked for; `body_rate`: added to what the attitude asks
    for, rad/s, body frame; `thrust`: share of the full thrust, in the units of the law.
    """

    attitude: Flat | None
    body_rate: Flat
    thrust: float


@dataclass
class LawPilot:
    """A control law between what is asked and the rotors, one step of it for every so many of the integration.

    `asked`: from steps of the integration done so far and the state to what is asked; `held`: commanded speeds in
    rad/s, then demanded squared speeds in rad^2/s^2, until the next step of the law; `injected`: added to the commands
    about the body axes, shares of the full ones, to measure the loop.
    """

    controller: Controller
    motors: Motors
    asked: Callable[[int, Flat], Asked]
    every: int
    held: Flat
    coming: Flat
    noise: GyroscopeNoise | None = None
    injected: Array | None = None
    saturated: BoolArray | None = None

    def size(self, rotors: int) -> int:
        """Count commands and demands."""
        return 2 * rotors

    def commanded(self, given: Vector, _middle: Vector) -> tuple[Value, Value]:
        """Command what was computed."""
        rotors = len(given) // 2
        return Each(given[:rotors]), Each(given[rotors:])

    def given(self, number: int, start: Flat) -> Flat:
        """Give what the law computed a step of its own ago."""
        if number % self.every == 0:
            self.held = self.coming
            self.coming = self._computed(number, start)
        return self.held

    def _computed(self, number: int, state: Flat) -> Flat:
        asked, gyroscope = self.asked(number, state), state[BODY_RATE]
        if self.noise is not None:
            drawn = self.noise.rng.standard_normal(3).tolist()
            gyroscope = tuple(rate + self.noise.std * each for rate, each in zip(gyroscope, drawn, strict=True))
        rate = asked.body_rate
        if asked.attitude is not None:
            error = _ATTITUDE_ERROR.advance((*state[ATTITUDE], *asked.attitude))
            turned = self.controller.asked_rate(error, gyroscope)
            rate = tuple(own + each for own, each in zip(rate, turned, strict=True))
        turning = self.controller.command(rate, gyroscope, self.saturated)
        if self.injected is not None:
            added = self.injected[min(number, len(self.injected) - 1)].tolist()
            turning = tuple(own + each for own, each in zip(turning, added, strict=True))
        mixed = self.motors.speeds(asked.thrust, np.array(turning))
        self.saturated = mixed.saturated
        possible = (mixed.wanted >= 0) & (mixed.wanted <= 1)
        demand = np.where(possible, mixed.speed**2, mixed.wanted * self.motors.speed_max**2)
        return (*mixed.speed.tolist(), *demand.tolist())


_ATTITUDE_ERROR = Machine.of(
    lambda _, given: attitude_error(rotation_rows(given[:3], SYMBOLS), (given[3:6], given[6:9], given[9:])), 12
)


def along_path(pilot: PlanPilot, motors: Motors, vehicle: VehicleSettings) -> Callable[[int, Flat], Asked]:
    """Ask for attitude and thrust along a path, in the units of a law."""
    lift = sum(rotor.thrust_factor_n_s2 for rotor in vehicle.rotors)

    def build(_memory: Memory, given: tuple[Symbol, ...]) -> Vector:
        planned, state = Planned.of(given[:PLANNED]), given[PLANNED:]
        thrust = pilot.autopilot.wrench(planned, state, rotation_rows(state[ATTITUDE], SYMBOLS))[0]
        speed = SYMBOLS.sqrt(SYMBOLS.largest(thrust, 0.0) * (1 / lift))
        share = motors.curve.thrust(speed * (1 / motors.speed_max), SYMBOLS)
        return (share, *(x for row in pilot.autopilot.target(planned, state) for x in row))

    machine = Machine.of(build, PLANNED + VEHICLE_STATES)

    def asked(number: int, state: Flat) -> Asked:
        share, *target = machine.advance((*pilot.plan[number], *state[:VEHICLE_STATES]))
        return Asked(tuple(target), (0.0, 0.0, 0.0), share)

    return asked


def law_pilot(
    law: Law,
    motors: Motors,
    asked: Callable[[int, Flat], Asked],
    step: float,
    speed: Array,
    noise: GyroscopeNoise | None = None,
    injected: Array | None = None,
) -> LawPilot:
    """Set up a law in flight, with rotors at a speed until the first command acts.

    `step` is that of the integration, s; the law takes the number of steps that is nearest to its period.
    """
    every = max(round(law.period / step), 1)
    held = (*speed.tolist(), *(speed**2).tolist())
    return LawPilot(Controller(law, every * step), motors, asked, every, held, held, noise, injected)


def integration_rate(law: Law | None, rate: float) -> float:
    """Give steps in a second of an integration that a law goes into, at least `rate`, Hz."""
    return rate if law is None else law.rate_hz * ceil(rate / law.rate_hz - 1e-9)


def asked(
    planned: Mapping[str, Array], vehicle: VehicleSettings, settings: ClosedLoopSettings, state: Array
) -> dict[str, Array]:
    """Give what the autopilot asked for along a flight: of its position loop the plan, of its attitude loop the target.

    By name, at the samples of the plan: position and velocity in the world frame, m and m/s; attitude as roll, pitch,
    yaw, rad, within half a turn of those that are flown; of an autopilot's own law thrust too, N.
    """
    autopilot, at = Autopilot(vehicle, settings, ARRAYS), tuple(state.T)
    plan = Planned.of(tuple(_plan(*(planned[name] for name in _PLANNED)).T))
    target = np.stack([np.stack(row, axis=-1) for row in autopilot.target(plan, at)], axis=-2)
    flown, thrust = state[:, ATTITUDE], {}
    attitude = flown + rotations.wrapped(rotations.euler_angles(target) - flown)
    if settings.law is not None:
        thrust = {"thrust": autopilot.wrench(plan, at, rotation_rows(at[ATTITUDE], ARRAYS))[0]}
    return {"position": planned["position"], "velocity": planned["velocity"], "attitude": attitude, **thrust}
