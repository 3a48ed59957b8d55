"""Legs of a path in space: the profiles of one rest-to-rest move, and the moves one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import SettingError
from cpfls_cli.trajectory.limits import Limits, LimitSettings
from cpfls_cli.trajectory.moves import Move, MoveOutcome, moves_of, plan_move, plan_moves
from cpfls_cli.trajectory.profile import BaseProfile, Holds, covering

Measure = Literal["along-path", "per-axis"]
Synchronisation = Literal["straight-line", "each-axis"]


@dataclass(frozen=True, kw_only=True)
class MoveInSpace:
    """One move from rest to rest, wherever and whenever it begins.

    One profile along a straight line, or one for each axis that moves where every axis is planned by itself, all of the
    same time; `directions`: world vector that one metre of each profile moves along; `limited_by`: derivatives that
    reach their limit on any axis, or ``period`` where none does, empty where the move was not planned under limits.
    """

    profiles: tuple[BaseProfile, ...]
    directions: Array
    limited_by: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """Time from rest to rest, s."""
        return max(profile.duration for profile in self.profiles)


@dataclass(frozen=True, kw_only=True)
class Leg(MoveInSpace):
    """A move of a path.

    Attributes
    ----------
    begin : float, s
        When it starts.
    start : array, shape (3,), m, world frame
    yaw : tuple of float or None, rad
        At its start and its end; None where the yaw does not belong to the legs.
    """

    begin: float
    start: Array
    yaw: tuple[float, float] | None

    @property
    def end(self) -> float:
        """Time at which it is at rest again, s."""
        return self.begin + self.duration

    @property
    def vector(self) -> Array:
        """Displacement, shape (3,), m, world frame."""
        covered = np.array([profile.displacement for profile in self.profiles])
        return np.asarray(covered @ self.directions)


def evaluate_legs(legs: Sequence[Leg], time: Array) -> Array:
    """Evaluate position and its six derivatives along a path at ascending times, shape (7, time, 3), m and s."""
    motion = np.zeros((7, len(time), 3))
    motion[0] = legs[0].start
    for leg, samples in samples_of_legs(legs, time):
        elapsed = time[samples] - leg.begin
        motion[0, samples] = leg.start
        for profile, direction in zip(leg.profiles, leg.directions, strict=True):
            motion[:, samples] += profile.sample(elapsed).T[..., None] * direction
    return motion


def samples_of_legs(legs: Sequence[Leg], time: Array) -> Iterator[tuple[Leg, slice]]:
    """Assign the samples to the legs, so that the work grows with the samples and not with samples times legs.

    A slice goes from the beginning of a leg to that of the next one: it is at rest at the end of them.
    """
    firsts = np.searchsorted(time, [*(leg.begin for leg in legs), np.inf])
    for leg, first, after in zip(legs, firsts[:-1], firsts[1:], strict=True):
        if first < after:
            yield leg, slice(int(first), int(after))


@dataclass(frozen=True, kw_only=True)
class Timing:
    """Timing of a move: by its period and holds, or the shortest that its limits allow, where the period may be None.

    `measure`: how long a displacement is, and what a limit that is one number for all axes holds for.
    """

    limits: LimitSettings
    coordination: Synchronisation
    period: float | None
    holds: Holds
    measure: Measure


def unit_of(vector: Array, measure: Measure) -> tuple[float, Array]:
    """Split a vector, not zero, into its length, in a measure, and the vector of length 1."""
    # Divided by the largest component first, so that no square overflows.
    largest = float(np.abs(vector).max())
    unit = vector / largest
    length = 1.0 if measure == "per-axis" else float(np.sqrt(unit @ unit))
    return largest * length, unit / length


def move_in_space(vector: Array, timing: Timing) -> MoveInSpace:
    """Plan the move over a displacement in the world, m, not zero.

    `SettingError` names the key of the section `trajectory` where there is no smooth move under the limits.
    """
    length, direction = unit_of(vector, timing.measure)
    if not timing.limits.given:
        period = 1.0 if timing.period is None else timing.period
        return MoveInSpace(profiles=(covering(length, period, timing.holds),), directions=direction[None])
    if timing.coordination == "straight-line":
        move = plan_move(length, timing.limits.along(direction), timing.period)
        return _smooth((move,), direction[None])
    axes = np.flatnonzero(vector)
    moves = synchronised(vector[axes], timing.limits.of_axes(axes), timing.period)
    return _smooth(moves, np.eye(3)[axes])


def _smooth(moves: tuple[Move, ...], directions: Array) -> MoveInSpace:
    """Refuse moves of unbounded snap, from which the acceleration of the attitude follows."""
    for move in moves:
        if not move.outcome.solved:
            raise SettingError("limits", move.outcome.words)
        if not np.isfinite(move.peaks.snap):
            message = "leave the snap unlimited, and with it the acceleration of the attitude; give a limit on"
            raise SettingError("limits", f"{message} snap_m_s4, crackle_m_s5 or pop_m_s6, or a period_s")
    # Where no limit is reached, the period that was given decides.
    reached = dict.fromkeys(name for move in moves for name in move.active) or {"period": None}
    profiles = tuple(move.profile for move in moves)
    return MoveInSpace(profiles=profiles, directions=directions, limited_by=tuple(reached))


def synchronised(displacements: Array, limits: Limits, period: float | None = None) -> tuple[Move, ...]:
    """Plan the shortest move of every axis, all stretched in time to the duration of the slowest, of a given period.

    An axis may stay where it is. `SettingError` names the key of what is not finite, or not greater than zero.
    """
    alone = plan_moves(displacements, limits, period)
    taken = np.where(alone.outcome == MoveOutcome.SOLVED, alone.duration, 0.0)
    stretched = alone.spans * np.divide(taken.max(initial=0.0), taken, out=np.ones_like(taken), where=taken > 0)
    moves = moves_of(displacements, stretched, limits.broadcast(len(displacements)), alone.outcome)
    return tuple(moves[axis] for axis in range(len(displacements)))
