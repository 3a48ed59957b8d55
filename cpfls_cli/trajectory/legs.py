"""Legs of a path in space: the shortest move under limits, from rest to rest, and the moves one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.errors import SettingError
from cpfls_cli.trajectory.profile import (
    LIMIT_NAMES,
    BaseProfile,
    Holds,
    Limits,
    Peaks,
    broadcast_to_moves,
    covering,
    holds_of,
    peaks_of,
    require_positive,
    spans_of,
)

# A peak this near to its limit, in parts of it, has reached it.
_REACHED = 1e-9
# By how much a peak may lie above its limit, in parts of it.
_ROUNDING = 1e-12
# Spans of a rise without holds, in periods.
_DOUBLING = np.array([1.0, 1.0, 2.0, 4.0, 8.0])[:, np.newaxis]
# The start is within 7 % of the root, and every step squares the error.
_NEWTON_STEPS = 5


class MoveOutcome(IntEnum):
    """Outcome of planning; `words` describes it."""

    SOLVED = 0
    ZERO_DISPLACEMENT = 1
    NO_LIMIT = 2
    OUT_OF_RANGE = 3

    @property
    def solved(self) -> bool:
        """Whether a move was found, including one of zero displacement."""
        return self in (MoveOutcome.SOLVED, MoveOutcome.ZERO_DISPLACEMENT)

    @property
    def words(self) -> str:
        """Description of the outcome, with a remedy."""
        return _WORDS[self]


_WORDS = {
    MoveOutcome.SOLVED: "solved: the shortest move of the family that keeps all limits",
    MoveOutcome.ZERO_DISPLACEMENT: "the displacement is zero: nothing moves, and the move takes no time",
    MoveOutcome.NO_LIMIT: "no solution: nothing limits the move, so there is no shortest one; give a limit on "
    f"{', '.join(LIMIT_NAMES[:-1])} or {LIMIT_NAMES[-1]}, or a period",
    MoveOutcome.OUT_OF_RANGE: "no solution: the move's times are too long or too short for floating-point numbers; "
    "bring the displacement and the limits closer to 1",
}


@dataclass(frozen=True, kw_only=True)
class Move:
    """A planned rest-to-rest move along a line, and the names of the limits that it reaches.

    Where there is no solution it is at rest, in no time, and its duration infinite.
    """

    profile: BaseProfile
    duration: float
    active: tuple[str, ...]
    outcome: MoveOutcome

    @property
    def peaks(self) -> Peaks:
        """Largest absolute value of every derivative, in m and s."""
        return self.profile.peaks


@dataclass(frozen=True, kw_only=True)
class Moves:
    """Planned rest-to-rest moves, one for each displacement; they are the last axis. All in m and s.

    `period`: length P of one wave of the pop; `holds` of snap, jerk, acceleration and velocity; `peaks`: largest
    absolute displacement to pop; `duration`: infinite where there is no solution; `active`: which limits are reached,
    of velocity to pop; `outcome`: values of `MoveOutcome`.
    """

    displacement: Array
    period: Array
    holds: Array
    peaks: Array
    duration: Array
    active: BoolArray
    outcome: IntArray

    def __len__(self) -> int:
        return len(self.displacement)

    def __getitem__(self, index: int) -> Move:
        snap, jerk, acceleration, velocity = self.holds[:, index].tolist()
        holds = Holds(snap=snap, jerk=jerk, acceleration=acceleration, velocity=velocity)
        outcome = MoveOutcome(int(self.outcome[index]))
        covered = float(self.displacement[index]) if outcome.solved else 0.0
        return Move(
            profile=covering(covered, float(self.period[index]), holds),
            duration=float(self.duration[index]),
            active=tuple(np.array(LIMIT_NAMES)[self.active[:, index]].tolist()),
            outcome=outcome,
        )

    @property
    def spans(self) -> Array:
        """Durations T1 to T5, shape (5, moves), s."""
        return spans_of(self.period, self.holds)


def moves_of(displacement: Array, spans: Array, bounds: Array, outcome: IntArray) -> Moves:
    """Build moves from their spans, limits and outcomes; what is not solved rests."""
    moving = outcome == MoveOutcome.SOLVED
    exact = np.where(moving, spans, 0.0)
    holds = holds_of(exact)
    exact = spans_of(exact[0], holds)
    peaks = peaks_of(np.where(moving, displacement, 0.0), exact)
    return Moves(
        displacement=displacement,
        period=exact[0],
        holds=holds,
        peaks=peaks,
        duration=np.where(outcome <= MoveOutcome.ZERO_DISPLACEMENT, exact.sum(axis=0), np.inf),
        active=np.isfinite(bounds) & (peaks[1:] >= bounds * (1 - _REACHED)),
        outcome=outcome,
    )


def plan_moves(displacement: Array, limits: Limits, period: float | Array | None = None) -> Moves:
    """Plan the shortest moves under limits, all at once; a negative displacement moves backwards.

    Minimise ``16 P + 8 Ts + 4 Tj + 2 Ta + Tv`` over A, P and the holds, with the displacement covered and no derivative
    above its limit. The paper's parameter P is chosen where it is not given: 0 with crackle and pop not limited, and
    the snap jumps. `SettingError` names the key of what is not finite, or not greater than zero. Section 7 of the
    paper; method.md section 3.
    """
    covered = _finite(displacement)
    bounds = limits.broadcast(len(covered))
    spans = _shortest_spans(np.abs(covered), bounds, _positive(period, len(covered)))
    return moves_of(covered, spans, bounds, _outcome(covered, bounds, spans, period))


def plan_move(displacement: float, limits: Limits, period: float | None = None) -> Move:
    """Plan the shortest move under limits, by `plan_moves`, which plans many moves in little more time than one."""
    return plan_moves(np.array([displacement]), limits, period)[0]


def _finite(displacement: Array) -> Array:
    covered = np.asarray(displacement, dtype=np.float64)
    if covered.ndim != 1:
        raise SettingError("displacement", f"has shape {covered.shape}; give one length for each move")
    if not np.isfinite(covered).all():
        wrong = covered[~np.isfinite(covered)][0]
        raise SettingError("displacement", f"is {wrong:g}; give a finite length in m")
    return covered


def _positive(period: float | Array | None, moves: int) -> Array | None:
    if period is None:
        return None
    require_positive("period", period, "leave it out to have it chosen")
    if not np.isfinite(period).all():
        raise SettingError("period", "is not finite; give a time in s, or leave it out to have it chosen")
    return broadcast_to_moves("period", period, moves)


def _outcome(displacement: Array, bounds: Array, spans: Array, period: float | Array | None) -> IntArray:
    with np.errstate(over="ignore", invalid="ignore"):
        duration = spans.sum(axis=0)
    # Limits are not kept only where numbers overflowed or vanished on the way.
    within = (peaks_of(displacement, spans)[1:] <= bounds * (1 + _ROUNDING)).all(axis=0)
    solved = np.isfinite(duration) & (duration > 0) & within
    outcome = np.where(solved, MoveOutcome.SOLVED, MoveOutcome.OUT_OF_RANGE)
    limited = np.isfinite(bounds).any(axis=0) | (period is not None)
    outcome = np.where(limited, outcome, MoveOutcome.NO_LIMIT)
    return np.where(displacement == 0, MoveOutcome.ZERO_DISPLACEMENT, outcome).astype(np.int64)


def _shortest_spans(displacement: Array, limits: Array, period: Array | None) -> Array:
    """Compute the spans T1 to T5, s, of the shortest move of the family; zero where nothing limits what is below.

    Let ``S_k(x)`` be the shortest time in which derivative k (1 snap, 2 jerk, 3 acceleration, 4 velocity, 5
    displacement) rises to x. It grows no faster than x, so that what is below is best raised as far as its limit
    allows: if ``x >= L_m K (2 K)^n 2^(n (n - 1) / 2)``, with ``K = S_m(L_m)``, ``n = k - m - 1`` and the highest such
    m, derivative m is held at its limit, nothing above is held, and ``x = L_m t (K + t)^n 2^(n (n - 1) / 2)`` with the
    spans ``t, K + t, 2 (K + t), 4 (K + t)`` above m. If there is no such m, nothing is held at all. P is chosen where
    it is None. Section 7 of the paper; the derivation is in docs/trajectory.md.
    """
    velocity, acceleration, jerk, snap, crackle, pop = limits
    with np.errstate(over="ignore", divide="ignore", invalid="ignore", under="ignore"):
        if period is not None:
            snap = np.minimum(snap, period * np.minimum(crackle / 2, pop * period / (2 * np.pi)))
        targets = [snap, jerk, acceleration, velocity, displacement]
        rises: list[Array] = []
        for target in targets:
            free = _without_holds(target, len(rises) + 1, crackle, pop, period)
            rises.append(_with_holds(free, target, targets, rises))
    return rises[-1]


def _without_holds(target: Array, level: int, crackle: Array, pop: Array, period: Array | None) -> Array:
    """Spans of a rise that holds nothing, limited by crackle and pop only, shape (level, moves)."""
    if period is None:
        scaled = target / 2.0 ** ((level - 1) * (level - 2) // 2)
        by_crackle = (2 * scaled / crackle) ** (1 / level)
        by_pop = (2 * np.pi * scaled / pop) ** (1 / (level + 1))
        period = np.maximum(by_crackle, by_pop)
    spans: Array = _DOUBLING[:level] * period
    return spans


def _with_holds(spans: Array, target: Array, limits: Sequence[Array], rises: Sequence[Array]) -> Array:
    """Replace the spans where a derivative below is held at its limit, the highest such first."""
    undecided = np.isfinite(target)
    for below in reversed(range(len(rises))):
        above = len(rises) - below - 1
        here = undecided & _held(target, limits[below], rises[below], above)
        if here.any():
            spans[:, here] = _holding(target[here], limits[below][here], rises[below][:, here], above)
            undecided &= ~here
    return spans


def _held(target: Array, limit: Array, rise: Array, above: int) -> BoolArray:
    reach = rise.sum(axis=0)
    least = limit * reach * (2 * reach) ** above * 2.0 ** (above * (above - 1) // 2)
    held: BoolArray = np.isfinite(limit) & (target >= least)
    return held


def _holding(target: Array, limit: Array, rise: Array, above: int) -> Array:
    """Spans of a rise that holds the derivative `above` + 1 below its target at the limit."""
    reach = rise.sum(axis=0)
    unit = (target / limit / 2.0 ** (above * (above - 1) // 2)) ** (1 / (above + 1))
    held = unit * _root(reach / unit, above)
    return np.concatenate([rise, held[np.newaxis], (reach + held) * 2.0 ** np.arange(above)[:, np.newaxis]])


def _root(offset: Array, power: int) -> Array:
    """Solve ``z (c + z)^n = 1`` for z >= c >= 0 by Newton's method, from a lower bound of the root."""
    root = 1 - power / (power + 1) * offset
    for _ in range(_NEWTON_STEPS if power else 0):
        total = offset + root
        root = root - (root * total - total ** (1 - power)) / (offset + (power + 1) * root)
    return root


Measure = Literal["along-path", "per-axis"]


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


def unit_of(vector: Array, measure: Measure) -> tuple[float, Array]:
    """Split a vector, not zero, into its length, in a measure, and the vector of length 1."""
    # Divided by the largest component first, so that no square overflows.
    largest = float(np.abs(vector).max())
    unit = vector / largest
    length = 1.0 if measure == "per-axis" else float(np.sqrt(unit @ unit))
    return largest * length, unit / length


def checked_move(moves: tuple[Move, ...], directions: Array) -> MoveInSpace:
    """Make a move in space of planned moves along directions, shape (move, 3).

    `SettingError` where one has no solution, or an unbounded snap, from which the acceleration of the attitude follows.
    """
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
