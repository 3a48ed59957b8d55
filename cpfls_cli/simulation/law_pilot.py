"""An autopilot's own control law in flight: it measures, asks and commands at its own rate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.autopilots.law import Controller, Law, attitude_error
from cpfls_cli.autopilots.motors import Motors
from cpfls_cli.simulation.autopilot import PLANNED, Planned, PlanPilot
from cpfls_cli.vehicle.motion import ATTITUDE, BODY_RATE, VEHICLE_STATES, rotation_rows
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.stepping import Flat, Machine, Memory
from cpfls_cli.vehicle.tracing import SYMBOLS, Symbol
from cpfls_cli.vehicle.values import Each, Value, Vector


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


def _error_of(_memory: Memory, given: Vector) -> Vector:
    rotation = rotation_rows(given[:3], SYMBOLS)
    return attitude_error(rotation, (given[3:6], given[6:9], given[9:]))


_ATTITUDE_ERROR = Machine.of(_error_of, 12)


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
