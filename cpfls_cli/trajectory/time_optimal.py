"""The shortest rest-to-rest move of the family under limits on any of its derivatives."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.errors import SettingError
from cpfls_cli.trajectory.limits import Limits, require_positive, spread
from cpfls_cli.trajectory.moves import Move, Moves, Outcome, moves_of
from cpfls_cli.trajectory.nesting import peaks_of
from cpfls_cli.trajectory.ramps import shortest_spans

# By how much a peak may lie above its limit, in parts of it.
_ROUNDING = 1e-12


def plan_moves(displacement: Array, limits: Limits, period: float | Array | None = None) -> Moves:
    """Plan the shortest moves, all at once.

    Minimise ``16 P + 8 Ts + 4 Tj + 2 Ta + Tv`` over A, P and the holds, with the displacement covered and no
    derivative above its limit.

    Parameters
    ----------
    displacement : array, shape (moves,), m
        Of any sign; a negative one moves backwards.
    limits : Limits
        One of each for all moves, or one for each move; those that are left out do not limit.
    period : float or array, shape (moves,), s, optional
        The paper's parameter P; chosen where it is not given. With crackle and pop not limited the choice is 0,
        and the snap jumps.

    Raises
    ------
    SettingError
        If a displacement is not finite, or a limit or the period is not greater than zero; it names the key.

    References
    ----------
    Section 7 of the paper; method.md section 3.
    """
    covered = _finite(displacement)
    bounds = limits.broadcast(len(covered))
    spans = shortest_spans(np.abs(covered), bounds, _positive(period, len(covered)))
    return moves_of(covered, spans, bounds, _outcome(covered, bounds, spans, period))


def plan_move(displacement: float, limits: Limits, period: float | None = None) -> Move:
    """Plan the shortest move.

    Parameters
    ----------
    displacement : float, m
    limits : Limits
    period : float, s, optional

    Raises
    ------
    SettingError
        As `plan_moves`, which plans many moves in little more time than one.
    """
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
    return spread("period", period, moves)


def _outcome(displacement: Array, bounds: Array, spans: Array, period: float | Array | None) -> IntArray:
    limited = np.isfinite(bounds).any(axis=0) | (period is not None)
    outcome = np.where(_kept(displacement, bounds, spans), Outcome.SOLVED, Outcome.OUT_OF_RANGE)
    outcome = np.where(limited, outcome, Outcome.NO_LIMIT)
    return np.where(displacement == 0, Outcome.ZERO_DISPLACEMENT, outcome).astype(np.int64)


def _kept(displacement: Array, bounds: Array, spans: Array) -> BoolArray:
    """Whether the limits are kept, which is always so unless numbers overflowed on the way, or vanished."""
    with np.errstate(over="ignore", invalid="ignore"):
        duration = spans.sum(axis=0)
    peaks = peaks_of(displacement, spans)
    kept: BoolArray = np.isfinite(duration) & (duration > 0)
    return kept & (peaks[1:] <= bounds * (1 + _ROUNDING)).all(axis=0)
