"""The planned move is the shortest: a numerical minimiser over all moves of the family finds none shorter."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from cpfls_cli.arrays import Array
from cpfls_cli.trajectory.legs import MoveOutcome, plan_moves
from cpfls_cli.trajectory.profile import LIMIT_NAMES, Limits

_DOUBLING = np.log([1.0, 1.0, 2.0, 4.0, 8.0])


def shortest_duration(displacement: float, limits: Array, period: float | None, rng: np.random.Generator) -> float:
    """Minimise the total time from two starts; spans that nothing limits are left out, as they are zero.

    Parameters
    ----------
    displacement : float, m
    limits : array, shape (6,)
        On velocity, acceleration, jerk, snap, crackle, pop; one of them finite, or the period given.
    period : float, s, or None
    rng : Generator

    Returns
    -------
    float, s
    """
    first = 0 if period is not None else max(4 - int(np.isfinite(limits).nonzero()[0][-1]), 0)
    matrix, bounds = _peak_constraints(displacement, limits, first)
    longer = (np.zeros(5 - first), rng.exponential(0.3, 5 - first))
    starts = [_feasible(matrix, bounds, period, more) for more in longer]
    return min(_minimised(start, matrix, bounds, period) for start in starts)


def _peak_constraints(displacement: float, limits: Array, first: int) -> tuple[Array, Array]:
    """Write ``matrix @ log spans <= bounds``; peaks are the displacement over the product of the spans above."""
    rows = [-(np.arange(5) >= 4 - order).astype(float) for order in range(4)]
    values = [np.log(limits[order] / displacement) for order in range(4)]
    rows += [-np.ones(5), -np.array([2.0, 1, 1, 1, 1])]
    values += [np.log(limits[4] / 2 / displacement), np.log(limits[5] / (2 * np.pi) / displacement)]
    finite = np.isfinite(values)
    return np.array(rows)[finite][:, first:], np.array(values)[finite]


def _feasible(matrix: Array, bounds: Array, period: float | None, more: Array) -> Array:
    """Take spans without holds, long enough for all limits, each lengthened by a factor exp(more)."""
    doubling = _DOUBLING[: len(more)] + np.cumsum(more)
    if period is None:
        return doubling + np.max((bounds - matrix @ doubling) / matrix.sum(axis=1))
    start = np.log(period) + doubling - doubling[0]
    start[-1] += np.max((matrix @ start - bounds) / -matrix[:, -1], initial=0.0)
    return start


def _total(y: Array) -> float:
    """Give ``log sum exp y``; SciPy's own spends its time around five numbers, not on them."""
    largest = y.max()
    return float(largest + np.log(np.exp(y - largest).sum()))


def _shares(y: Array) -> Array:
    """Differentiate `_total`."""
    parts = np.exp(y - y.max())
    return np.asarray(parts / parts.sum())


def _minimised(start: Array, matrix: Array, bounds: Array, period: float | None) -> float:
    size = len(start)
    constraints = [{"type": "ineq", "fun": lambda y: bounds - matrix @ y, "jac": lambda _: -matrix}]
    if size > 1:
        constraints.append({"type": "ineq", "fun": _nested, "jac": _nested_slope})
    if period is not None:
        held = np.eye(1, size)
        constraints.append({"type": "eq", "fun": lambda y: y[:1] - np.log(period), "jac": lambda _: held})
    found = minimize(
        _total, start, jac=_shares, method="SLSQP", constraints=constraints, options={"maxiter": 500, "ftol": 1e-14}
    )
    spans = found.x
    broken = min(np.min(bounds - matrix @ spans, initial=0.0), _nested(spans).min(initial=0.0))
    return float(np.exp(_total(spans))) if broken > -1e-8 else np.inf


def _nested(spans: Array) -> Array:
    return spans[1:] - np.logaddexp.accumulate(spans)[:-1]


def _nested_slope(spans: Array) -> Array:
    size = len(spans)
    slope = np.eye(size)[1:]
    for row in range(size - 1):
        slope[row, : row + 1] -= _shares(spans[: row + 1])
    return slope


@pytest.mark.parametrize("chosen", [True, False], ids=["chosen-period", "given-period"])
def test_brute_force_finds_the_same_duration(chosen):
    rng = np.random.default_rng(21)
    count = 500
    displacement, limits = 10 ** rng.uniform(-3, 3, count), 10 ** rng.uniform(-3, 3, (6, count))
    limits[rng.random((6, count)) < 0.3] = np.inf
    period = None if chosen else 10 ** rng.uniform(-2, 1, count)
    moves = plan_moves(displacement, Limits(**dict(zip(LIMIT_NAMES, limits, strict=True))), period)
    for index in np.flatnonzero(moves.outcome == MoveOutcome.SOLVED):
        given = None if period is None else float(period[index])
        shortest = shortest_duration(float(displacement[index]), limits[:, index], given, rng)
        assert moves.duration[index] == pytest.approx(shortest, rel=1e-6), index
