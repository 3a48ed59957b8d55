"""Courses that a simulator flies along: where runs start, and the commands of rotors between samples."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.playback.flight import FASTEST, MeasuredMotion, PlaybackFlight, State
from cpfls_cli.playback.player import less_measured
from cpfls_cli.playback.rotors import RotorResponse

_CLOCKS = 1e-3
"""Share of a sampling period by which the clock of a log is off at most."""


@dataclass(frozen=True)
class Course:
    """Runs along the logged rotor speeds of a flight, from states that were measured.

    Attributes
    ----------
    starts : array of int, shape (run,)
        Ascending samples of the flight.
    horizon : int
        Samples that each run goes.
    finer : int
        Steps of a simulator between two samples.
    gravity : float, m/s^2
        Of the world, where no file of the vehicle says it.
    """

    flight: PlaybackFlight
    starts: IntArray
    horizon: int
    finer: int = 1
    gravity: float = 9.81

    @property
    def period(self) -> float:
        """Length of a step of a simulator, s."""
        return self.flight.motion.period / self.finer

    @property
    def start(self) -> State:
        """Measured states that the runs start from."""
        return State(*(part[self.starts] for part in self.flight.motion[:4]))

    @property
    def commands(self) -> Array:
        """Mean of the logged speeds over each step of a simulator, shape (run, horizon * finer, rotor), rad/s."""
        along = _finer_speed(self.flight, self.finer)
        after = np.concatenate([along[1:], along[-1:]])
        mean = 0.5 * (along + after) if self.flight.hold == "linear" else along
        steps = self.finer * self.starts[:, None] + np.arange(self.horizon * self.finer)
        return np.asarray(mean[steps])

    def lagged(self, response: RotorResponse) -> Array:
        """Give the speeds at which rotors that lag turn at the starts, shape (run, rotor)."""
        flight = self.finer_flight
        parts = [
            response.terms_at_samples(flight.speed[part], flight.motion.period, flight.hold)
            for part in flight.stretches
        ]
        return np.concatenate(parts)[self.finer * self.starts, 1 : 1 + flight.speed.shape[1]]

    @property
    def finer_flight(self) -> PlaybackFlight:
        """The flight at the steps of a simulator; between samples its motion is that of the sample before."""
        motion, finer = self.flight.motion, self.finer
        position, velocity, rotation, rate = (np.repeat(part, finer, axis=0) for part in motion[:4])
        own = MeasuredMotion(position, velocity, rotation, rate, self.period)
        stretches = tuple(slice(finer * part.start, finer * part.stop) for part in self.flight.stretches)
        return replace(self.flight, motion=own, speed=_finer_speed(self.flight, finer), stretches=stretches)

    def steps(self, longest_s: float) -> int:
        """Count the equal steps in a step of the course, none of them longer than this but by errors of clocks."""
        return max(1, ceil((1.0 - _CLOCKS) * self.period / longest_s))

    def collected(self, runs: Iterable[Iterable[State]]) -> State:
        """Collect what runs pass through after each step; see `Flies`."""
        vector = len(self.starts), self.horizon, 3
        states = State(*(np.full(shape, np.nan) for shape in (vector, vector, (*vector, 3), vector)))
        for run, path in enumerate(runs):
            for step, now in enumerate(path, 1):
                if not (np.abs(now.rate) < FASTEST).all():
                    break
                if step % self.finer == 0:
                    for part, own in zip(states, now, strict=True):
                        part[run, step // self.finer - 1] = own
        return states

    def errors(self, states: State) -> Array:
        """Compare runs with what was measured, shape (run, horizon, 4, 3), as `cpfls_cli.playback.player.Runs` does."""
        return less_measured(states, self.flight.motion, self.starts[:, None] + 1 + np.arange(self.horizon))


Flies = Callable[[Course, bool], State]
"""From a course whose rotors are in the order of a file, and whether they lag behind its speeds, which are kept from
step to step, to states of the centre of mass at the samples behind each start, shape (run, horizon, ...); NaN from
where a run ran away."""

Wrench = Callable[[Array, Array, Array, Array], tuple[Array, Array]]
"""From rotor speeds, velocity through the air, body rate and attitude (body to world) of each run to torque and force,
body frame, (run, 3)."""


def fly_body(course: Course, mass: float, inertia: Array, wrench: Wrench, lag: float) -> State:
    """Fly a rigid body by the published equations of a target, semi-implicit; see `Otherwise.fly`.

    Parameters
    ----------
    inertia : array, shape (3, 3), kg m^2
    lag : float, s
        Of the rotors behind their commands; 0 for none.
    """
    period, gravity = course.period, np.array([0.0, 0.0, -course.gravity])
    speed, state = course.lagged(RotorResponse(lag_s=lag)), course.start
    rows, keep = [], np.exp(-period / lag) if lag else 0.0
    for step, command in enumerate(course.commands.swapaxes(0, 1), 1):
        speed = speed if lag else command
        air = np.einsum("nji,nj->ni", state.rotation, state.velocity)
        torque, force = wrench(speed, air, state.rate, state.rotation)
        linear = np.einsum("nij,nj->ni", state.rotation, force) / mass + gravity
        moment = torque - rotations.cross(state.rate, state.rate @ inertia)
        velocity, rate = state.velocity + period * linear, state.rate + period * np.linalg.solve(inertia, moment.T).T
        turned = state.rotation @ rotations.turns(period * rate)
        state = State(state.position + period * velocity, velocity, turned, rate)
        speed = keep * speed + (1.0 - keep) * command
        if step % course.finer == 0:
            rows.append(state)
    return State(*(np.stack(parts, axis=1) for parts in zip(*rows, strict=True)))


def _finer_speed(flight: PlaybackFlight, finer: int) -> Array:
    """Give the logged speeds at the steps of a simulator: on straight lines, or what they were."""
    if flight.hold == "previous":
        return np.repeat(flight.speed, finer, axis=0)
    parts = []
    for part in flight.stretches:
        speed = flight.speed[part]
        after = np.concatenate([speed[1:], speed[-1:]])
        share = (np.arange(finer) / finer)[:, None]
        parts.append((speed[:, None] + share * (after - speed)[:, None]).reshape(-1, speed.shape[1]))
    return np.concatenate(parts)
