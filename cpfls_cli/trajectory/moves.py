"""Results of planning: moves, the limits that they reach, and the reason where there is no move."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.trajectory.closed_form import holds_of, peaks_of, spans_of
from cpfls_cli.trajectory.limits import LIMIT_NAMES
from cpfls_cli.trajectory.profile import BaseProfile, Holds, Peaks, covering

# A peak this near to its limit, in parts of it, has reached it.
_REACHED = 1e-9


class Outcome(IntEnum):
    """Outcome of planning; `words` describes it."""

    SOLVED = 0
    ZERO_DISPLACEMENT = 1
    NO_LIMIT = 2
    OUT_OF_RANGE = 3

    @property
    def solved(self) -> bool:
        """Whether a move was found, including one of zero displacement."""
        return self in (Outcome.SOLVED, Outcome.ZERO_DISPLACEMENT)

    @property
    def words(self) -> str:
        """Description of the outcome, with a remedy."""
        return _WORDS[self]


_WORDS = {
    Outcome.SOLVED: "solved: the shortest move of the family that keeps all limits",
    Outcome.ZERO_DISPLACEMENT: "the displacement is zero: nothing moves, and it takes no time",
    Outcome.NO_LIMIT: "no solution: nothing limits the move, so none is the shortest; give a limit on "
    f"{', '.join(LIMIT_NAMES[:-1])} or {LIMIT_NAMES[-1]}, or a period",
    Outcome.OUT_OF_RANGE: "no solution: the move's times are too long or too short for floating-point numbers; bring "
    "the displacement and the limits nearer to 1",
}


@dataclass(frozen=True, kw_only=True)
class Move:
    """A planned rest-to-rest move along a line.

    Attributes
    ----------
    profile : BaseProfile
        At rest, in no time, where there is no solution.
    duration : float, s
        Infinite where there is no solution.
    active : tuple of str
        Names of the limits that the move reaches.
    """

    profile: BaseProfile
    duration: float
    active: tuple[str, ...]
    outcome: Outcome

    @property
    def peaks(self) -> Peaks:
        """Largest absolute value of every derivative, in m and s."""
        return self.profile.peaks

    @property
    def integral_of_absolute_jerk(self) -> float:
        """The paper's measure of energy, m/s^2."""
        return self.profile.integral_of_absolute_jerk


@dataclass(frozen=True, kw_only=True)
class Moves:
    """Planned rest-to-rest moves, one for each displacement; they are the last axis.

    Attributes
    ----------
    displacement : array, shape (moves,), m
    period : array, shape (moves,), s
        Length P of one wave of the pop.
    holds : array, shape (4, moves), s
        Of snap, jerk, acceleration and velocity.
    peaks : array, shape (7, moves), m and s
        Largest absolute displacement, velocity, acceleration, jerk, snap, crackle and pop.
    duration : array, shape (moves,), s
        Infinite where there is no solution.
    active : array, shape (6, moves), bool
        Which limits are reached: velocity, acceleration, jerk, snap, crackle, pop.
    outcome : array, shape (moves,)
        Values of `Outcome`.
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
        outcome = Outcome(int(self.outcome[index]))
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

    @property
    def integral_of_absolute_jerk(self) -> Array:
        """The paper's measure of energy, shape (moves,), m/s^2."""
        integral: Array = 4 * self.peaks[2]
        return integral


def moves_of(displacement: Array, spans: Array, bounds: Array, outcome: IntArray) -> Moves:
    """Build moves from their spans.

    Parameters
    ----------
    displacement : array, shape (moves,), m
    spans : array, shape (5, moves) or (5, 1), s
    bounds : array, shape (6, moves)
        Limits.
    outcome : array, shape (moves,)
        Values of `Outcome`; what is not solved rests.
    """
    moving = outcome == Outcome.SOLVED
    exact = np.where(moving, spans, 0.0)
    holds = holds_of(exact)
    exact = spans_of(exact[0], holds)
    peaks = peaks_of(np.where(moving, displacement, 0.0), exact)
    return Moves(
        displacement=displacement,
        period=exact[0],
        holds=holds,
        peaks=peaks,
        duration=np.where(outcome <= Outcome.ZERO_DISPLACEMENT, exact.sum(axis=0), np.inf),
        active=np.isfinite(bounds) & (peaks[1:] >= bounds * (1 - _REACHED)),
        outcome=outcome,
    )
