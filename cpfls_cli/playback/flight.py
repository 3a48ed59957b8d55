"""Flights as playback needs them: motion, logged rotor speeds, stretches without pauses, and where windows start."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.playback.rotors import Hold, rotor_terms_by_step
from cpfls_cli.vehicle.settings import VehicleSettings


class State(NamedTuple):
    """Where vehicles are and how they move.

    Attributes
    ----------
    position, velocity : array, shape (samples, 3), m and m/s, world frame
    rotation : array, shape (samples, 3, 3)
        Body to world.
    rate : array, shape (samples, 3), rad/s, body frame
    """

    position: Array
    velocity: Array
    rotation: Array
    rate: Array


class MeasuredMotion(NamedTuple):
    """Measured motion, where runs start and what they are held against.

    Attributes
    ----------
    position, velocity : array, shape (time, 3), m and m/s, world frame
    rotation : array, shape (time, 3, 3)
        Body to world.
    rate : array, shape (time, 3), rad/s, body frame
    period : float, s
    """

    position: Array
    velocity: Array
    rotation: Array
    rate: Array
    period: float


class Body(NamedTuple):
    """What is moved.

    Attributes
    ----------
    inertia, inverse : array, shape (3, 3)
    """

    mass: float
    gravity: float
    inertia: Array
    inverse: Array

    @classmethod
    def of(cls, vehicle: VehicleSettings, inertia: Array) -> Body:
        """Arrange mass and inertia, which may be another than the vehicle's."""
        return cls(vehicle.mass_kg, vehicle.gravity_m_s2, inertia, np.asarray(np.linalg.inv(inertia), dtype=float))


FASTEST = 300.0
"""Body rate in rad/s, and speed in m/s, at which a run is called diverged and stays as it was."""


_REMEMBERED = 4
"""Terms of rotors: derivatives follow the loss at the same numbers, and two threads ask."""


def motion_at(motion: MeasuredMotion, samples: slice | IntArray) -> MeasuredMotion:
    """Take samples of a motion, in arrays of their own where that needs a copy."""
    position, velocity, rotation, rate = (np.ascontiguousarray(each[samples]) for each in motion[:4])
    return MeasuredMotion(position, velocity, rotation, rate, motion.period)


@dataclass(frozen=True, kw_only=True)
class PlaybackFlight:
    """A flight on a uniform clock, in stretches without pauses.

    `motion`: zero, and no rotation, where the flight does not know it; `speed`: measured or commanded, rad/s, shape
    (time, rotor), and what it is between samples; without attitude or velocity rotation alone is played back; `wrench`:
    stated torque and force of a flight without rotor speeds, which are then 0, shape (time, 6), N m and N, body frame;
    `specific_force`: of an accelerometer, m/s^2, body frame; `setpoints`: those of `Signals` that are known in all
    stretches; `group`: configuration of the vehicle that flew it, empty for the one of the config; `rotor_span_s`,
    `commanded`: of `Signals`.
    """

    name: str
    motion: MeasuredMotion
    speed: Array
    hold: Hold
    stretches: tuple[slice, ...]
    has_attitude: bool = True
    has_velocity: bool = True
    has_position: bool = True
    wrench: Array | None = None
    specific_force: Array | None = None
    setpoints: Mapping[str, Array] = field(default_factory=dict)
    group: str = ""
    rotor_span_s: float = 0.0
    commanded: bool = False

    def __len__(self) -> int:
        return len(self.speed)

    @property
    def translates(self) -> bool:
        """Whether velocity is simulated."""
        return self.has_attitude and self.has_velocity

    @property
    def shown(self) -> BoolArray:
        """Whether runs show position, velocity, attitude and rate, shape (4,)."""
        return np.array([self.translates, self.translates, self.has_attitude, True])

    @cached_property
    def rotor_terms(self) -> Callable[[float, float, float | None], Array]:
        """Terms of the rotors over each step by the times of their response, of which the last few are remembered."""
        # What is remembered does not hold the flight, which would then be freed only by the garbage collector.
        speeds, period, hold = [self.speed[part] for part in self.stretches], self.motion.period, self.hold

        @lru_cache(maxsize=_REMEMBERED)
        def terms(*times: Any) -> Array:
            return np.concatenate([rotor_terms_by_step(each, period, hold, *times) for each in speeds])

        return terms

    def of_speeds(self, terms: Callable[..., Array], *times: Any) -> Array:
        """Evaluate what follows from speeds, their sampling period, what they are between samples, and more."""
        period, hold = self.motion.period, self.hold
        return np.concatenate([terms(self.speed[part], period, hold, *times) for part in self.stretches])

    def starts(self, horizon: int, every: int) -> IntArray:
        """List every n-th sample from which a horizon fits into its stretch.

        Parameters
        ----------
        horizon, every : int
            Samples.

        Raises
        ------
        InputError
            If no stretch is that long.
        """
        found = [np.arange(part.start, part.stop - horizon, every) for part in self.stretches]
        starts = np.concatenate([np.zeros(0, dtype=np.int64), *found]).astype(np.int64)
        if not len(starts):
            longest = max((part.stop - part.start for part in self.stretches), default=1) - 1
            period = self.motion.period
            raise InputError(
                f"{self.name}: a horizon of {horizon * period:g} s is longer than its longest stretch without a pause, "
                f"{longest * period:g} s; ask for a shorter one"
            )
        return starts


@dataclass(frozen=True)
class LoggedFlight:
    """A flight to be played back, as it was logged.

    `parts`: stretches without pauses, at least one; `hold`: what a speed is between samples; `actuation`: what drives
    the playback, in words; `contradictions`: what of it no verdict can stand with; `group`: see `PlaybackFlight`;
    `shares`: whether its commands are shares of the full speed of the rotors; `updated_hz`: how often the log says what
    drives the playback, None for as often as there are samples; `system`: what wrote the log.
    """

    parts: tuple[Signals, ...]
    hold: Hold
    actuation: str
    warnings: tuple[str, ...]
    contradictions: tuple[str, ...] = ()
    group: str = ""
    shares: bool = False
    updated_hz: float | None = None
    system: str = ""

    @property
    def name(self) -> str:
        """Name of its file."""
        return self.parts[0].name

    @property
    def logged_hz(self) -> float:
        """How often what drives the playback is known, Hz."""
        return self.updated_hz or 1 / self.parts[0].period

    @property
    def held_s(self) -> float:
        """For how long it holds a command, s; 0 of measured speeds, and where lines join commands."""
        return 1 / self.logged_hz if self.parts[0].commanded and self.hold == "previous" else 0.0

    @classmethod
    def of(cls, signals: Signals) -> LoggedFlight:
        """Take a flight without pauses; commands stay until the next sample."""
        return cls((signals,), "previous" if signals.commanded else "linear", "", ())

    @property
    def time(self) -> Array:
        """Time of all samples, s."""
        return np.concatenate([part.time for part in self.parts])

    @property
    def playback(self) -> PlaybackFlight:
        """The flight as logged."""
        return replace(playback_flight(self.parts, self.hold), group=self.group)


def playback_flight(parts: Sequence[Signals], hold: Hold) -> PlaybackFlight:
    """Put the stretches of a flight one after another, of one period and with the same signals."""
    first = parts[0]
    thrust_known = first.rotor_speed is not None or first.stated_thrust is not None
    motion = MeasuredMotion(
        _joined([_or_zero(part.position, part) for part in parts]),
        _joined([_or_zero(part.velocity, part) for part in parts]),
        _joined([np.tile(np.eye(3), (len(part), 1, 1)) if part.attitude is None else part.rotation for part in parts]),
        _joined([part.body_rate for part in parts]),
        # Clocks are rounded; what rounding leaves of a step would show in every horizon.
        round(float(first.time[-1] - first.time[0]) / (len(first) - 1), 12),
    )
    force = [part.specific_force for part in parts if part.specific_force is not None]
    return PlaybackFlight(
        name=first.name,
        motion=motion,
        speed=_joined([_or_zero(part.rotor_speed, part, len(part.vehicle.rotors)) for part in parts]),
        hold=hold,
        stretches=stretches_of(parts),
        has_attitude=first.attitude is not None,
        has_velocity=first.velocity is not None and thrust_known,
        has_position=first.position is not None,
        wrench=None if first.rotor_speed is not None else _joined([part.wrench for part in parts]),
        specific_force=_joined(force) if len(force) == len(parts) else None,
        setpoints={
            name: _joined([part.setpoints[name] for part in parts])
            for name in first.setpoints
            if all(name in part.setpoints for part in parts)
        },
        rotor_span_s=first.rotor_span_s,
        commanded=first.commanded,
    )


def stretches_of(parts: Sequence[Signals]) -> tuple[slice, ...]:
    """Give the samples of each stretch among those of all, one after another."""
    ends = np.cumsum([0, *(len(part) for part in parts)]).tolist()
    return tuple(slice(*pair) for pair in pairwise(ends))


def _joined(parts: Sequence[Array]) -> Array:
    return np.ascontiguousarray(np.concatenate(parts), dtype=float)


def _or_zero(values: Array | None, part: Signals, columns: int = 3) -> Array:
    return np.zeros((len(part), columns)) if values is None else values


def contradictions_of(flights: Sequence[LoggedFlight]) -> tuple[str, ...]:
    """Gather what rules out any verdict on a model."""
    return tuple(each for flight in flights for each in flight.contradictions)
