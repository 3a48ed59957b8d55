"""Numbers from equations with instruments: ``sum Z' W (r - X d) = 0``, their covariance over blocks, their strength.

``r`` is the residual at values of the numbers, ``X`` its slopes (``r`` falls by ``X d`` for a step ``d``), ``Z`` what
goes with the slopes and not with the disturbance: a first-stage fit. Least squares is the case ``Z = X``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray, Numbers
from cpfls_cli.blocks import contiguous, half_width, jackknife_covariance

FOLDS = 5
"""Parts of the flights that are kept aside in turn."""
RIDGE, OF_MANY = 1e-6, 1e-3
"""So that instruments that hardly differ do no harm; of many that go together, in flights that differ."""


def fits_of_others(ztz: Numbers, ztx: Numbers, ridge: Numbers | float, neighbours: int = 0) -> Numbers:
    """Fit signals X to instruments Z on all parts but each, shape (part, ..., instrument, signal).

    Parameters
    ----------
    ztz : array, shape (part, ..., instrument, instrument)
    ztx : array, shape (part, ..., instrument, signal)
    ridge : float or array, broadcast to (part, ..., instrument, instrument)
        Added to the diagonal.
    neighbours : int
        How many parts to either side are left out too.

    References
    ----------
    Angrist, Imbens and Krueger 1999 (jackknife instrumental variables).
    """
    apart = np.abs(np.subtract.outer(np.arange(len(ztz)), np.arange(len(ztz)))) > neighbours
    gram, moment = (np.tensordot(apart.astype(float), each, 1) for each in (ztz, ztx))
    return np.asarray(np.linalg.solve(gram + ridge * np.eye(gram.shape[-1]), moment))


def first_stage_fit(instruments: Array, values: Array, ridge: float = RIDGE) -> Array:
    """Predict values, time first, from instruments and a constant, each of five parts by the other ones.

    `ridge`: prior precision of the prediction, for instruments as large as 1.
    """
    size, part = instruments.std(axis=0), contiguous(len(values), FOLDS)
    z = np.hstack([np.ones((len(values), 1)), instruments / np.where(size > 0, size, 1.0)])
    parts = [part == fold for fold in range(FOLDS)]
    flat = values.reshape(len(values), -1)
    ztz, ztx = (np.array([z[own].T @ each[own] for own in parts]) for each in (z, flat))
    rest = ridge * (len(z) - np.bincount(part, minlength=FOLDS))
    weights = fits_of_others(ztz, ztx, rest[:, None, None])
    return np.concatenate([z[own] @ fit for own, fit in zip(parts, weights, strict=True)]).reshape(values.shape)


def first_stage_fit_by_run(
    instruments: Mapping[int, Array], values: Sequence[Array] | Mapping[int, Array], ridge: float = RIDGE
) -> dict[int, Array]:
    """Predict values of runs by their numbers, all runs together; see `first_stage_fit`."""
    if not instruments:
        return {}
    together = np.concatenate(list(instruments.values())), np.concatenate([values[number] for number in instruments])
    ends = np.cumsum([len(own) for own in instruments.values()])[:-1]
    return dict(zip(instruments, np.split(first_stage_fit(*together, ridge), ends), strict=True))


_STEPS, _STEPS_LEFT_OUT = 60, 4
_SETTLED, _FARTHEST = 1e-5, 0.7
"""Length of a step that is none any more, and of the longest."""
_LEAST_SHARE = 0.1
_NEARLY = 1e-2
"""Length of the last step from which the numbers were not found."""
_RIDGE = 1e-9
"""Information where there is none at all: nothing is divided by 0."""
_TINY = float(np.finfo(float).tiny)


class Normal(NamedTuple):
    """Normal equations of each block at values of the numbers.

    Attributes
    ----------
    information : array, shape (block, number, number)
        ``Z' W X``.
    score : array, shape (block, number)
        ``Z' W r``.
    chance : array, shape (number, number), or None
        Information that instruments without strength would show, all blocks together; None: as the blocks scatter.
    """

    information: Array
    score: Array
    chance: Array | None = None


Equations = Callable[[Array], Normal]
"""From values of the numbers, shape (number,), in units in which a step of 1 is a large one."""


class Prior(NamedTuple):
    """What is known of numbers before: normal, with infinite spread where nothing is.

    Attributes
    ----------
    mean, spread : array, shape (number,)
    """

    mean: Array
    spread: Array

    @classmethod
    def none(cls, numbers: int) -> Prior:
        """Know nothing."""
        return cls(np.zeros(numbers), np.full(numbers, np.inf))

    @classmethod
    def about_zero(cls, precision: Array) -> Prior:
        """Expect numbers near 0, by their inverse variances."""
        with np.errstate(divide="ignore"):
            return cls(np.zeros(len(precision)), precision**-0.5)

    @property
    def precision(self) -> Array:
        """Inverse variance, shape (number,)."""
        return np.asarray(self.spread**-2.0)

    def pull(self, values: Array) -> Array:
        """Give the score of the prior at values, shape (number,)."""
        return np.where(self.precision > 0, self.mean - values, 0.0) * self.precision


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Numbers with their uncertainty.

    Attributes
    ----------
    values : array, shape (number,)
    covariance : array, shape (number, number)
        Of the jackknife over blocks, and of what the prior leaves open.
    left_out : array, shape (block, number)
        Values without each block.
    strength : array, shape (number,)
        Conditional F statistic of the instruments of each number.
    information : array, shape (block, number, number)
    inverse : array, shape (number, number)
        Of the information of all blocks and the prior.
    settled : bool
        Whether the steps came to an end.
    """

    values: Array
    covariance: Array
    left_out: Array
    strength: Array
    information: Array
    inverse: Array
    settled: bool

    def half(self, direction: Array) -> float:
        """Give half of the 95 % interval of ``direction @ values``, by Student's t."""
        error = np.sqrt(max(float(direction @ self.covariance @ direction), 0.0))
        return float(half_width(np.array(error), np.array(self.blocks(direction))))

    def blocks(self, direction: Array) -> float:
        """Count the blocks of equal information on ``direction @ values`` that would scatter as much."""
        before, behind = self.inverse.T @ direction, self.inverse @ direction
        return effective_blocks(np.einsum("i,bij,j->b", before, self.information, behind))


Bounds = tuple[Array, Array]
"""Lowest and highest values of numbers, shape (number,) each."""


class Solved(NamedTuple):
    """Values at which equations hold, the equations there, and whether the steps came to an end."""

    values: Array
    normal: Normal
    settled: bool


def solve(
    equations: Equations,
    start: Array,
    prior: Prior,
    bounds: Bounds | None = None,
    leave_out: int | None = None,
    steps: int = _STEPS,
    settled: float = _SETTLED,
) -> Solved:
    """Solve equations by Gauss-Newton steps, all blocks or all but one.

    Parameters
    ----------
    start : array, shape (number,)
    settled : float
        Length of a step that is none any more.
    """
    values, share, before = np.asarray(start, dtype=float), 1.0, np.zeros(len(start))
    for _ in range(steps):
        normal = equations(values)
        information, score = normal.information.sum(axis=0), normal.score.sum(axis=0)
        if leave_out is not None:
            information = information - normal.information[leave_out]
            score = score - normal.score[leave_out]
        step = np.linalg.solve(_invertible(information + np.diag(prior.precision)), score + prior.pull(values))
        # One that turns back has gone too far.
        share = max(share / 2, _LEAST_SHARE) if step @ before < 0 else min(1.5 * share, 1.0)
        before, moved = step, values + step * min(share, _FARTHEST / max(float(np.abs(step).max()), _TINY))
        moved = moved if bounds is None else np.clip(moved, *bounds)
        step, values = moved - values, moved
        if np.abs(step).max() < settled:
            break
    return Solved(values, normal, bool(np.abs(step).max() < _NEARLY))


def estimate(equations: Equations, start: Array, prior: Prior | None = None, bounds: Bounds | None = None) -> Fit:
    """Solve equations, and again without each block.

    The error of a number with a prior has two parts: that of the data, which the jackknife shows, and that of the
    prior, ``(S + P)^-1 P (S + P)^-1`` for an information S and a precision P.

    References
    ----------
    Söderström and Stoica 2002 (instrumental variables in closed loop); Efron and Tibshirani 1993 (jackknife).
    """
    prior = Prior.none(len(start)) if prior is None else prior
    values, normal, settled = solve(equations, start, prior, bounds)
    left_out = np.array(
        [solve(equations, values, prior, bounds, block, _STEPS_LEFT_OUT).values for block in range(len(normal.score))]
    )
    total = normal.information.sum(axis=0)
    inverse = np.asarray(np.linalg.inv(_invertible(total + np.diag(prior.precision))), dtype=float)
    held = inverse @ np.diag(prior.precision) @ inverse.T
    return Fit(
        values=values,
        covariance=jackknife_covariance(left_out) + held,
        left_out=left_out,
        strength=conditional_strength(normal, prior),
        information=normal.information,
        inverse=inverse,
        settled=settled,
    )


def one_step(normal: Normal, prior: Prior, values: Array) -> tuple[Array, Array]:
    """Step once from values, which solves linear equations: of all blocks, and without each, (block, number)."""

    def kept(each: Array) -> Array:
        return np.asarray(each.sum(axis=0) - np.concatenate([np.zeros_like(each[:1]), each]))

    information = kept(normal.information) + np.diag(prior.precision)
    score = kept(normal.score) + prior.pull(values)
    moved = values + np.linalg.solve(_invertible(information), score[..., None])[..., 0]
    return moved[0], moved[1:]


def _invertible(information: Array) -> Array:
    """Add a little information, so that nothing is divided by 0, in any units."""
    own = np.diagonal(information, axis1=-2, axis2=-1)
    return information + _RIDGE * np.where(own == 0, 1.0, own)[..., None] * np.eye(information.shape[-1])


def conditional_strength(normal: Normal, prior: Prior, source: IntArray | None = None) -> Array:
    """Compute the F statistic of each number jointly with all others, shape (number,).

    What the instruments identify of a number, cleared of what identifies the others as far as the prior does not, over
    what chance would show of it; where that is not stated, over its scatter over blocks, with instruments that were
    found without the block.

    Parameters
    ----------
    source : array, shape (block,), optional
        Which equations a block has a part in; one scatters about the mean of its own. None: all are of the same.

    References
    ----------
    Sanderson and Windmeijer 2016; Stock and Yogo 2005 (below 10 the estimate falls back to least squares).
    """
    inverse = np.linalg.inv(_invertible(normal.information.sum(axis=0) + np.diag(prior.precision)))
    alone = np.where(np.diag(inverse) == 0, _TINY, np.diag(inverse))
    # Columns: the rest of each number when the others have moved with it.
    cleared = inverse / alone
    each = np.einsum("ji,bjk,ki->bi", inverse.T / alone, normal.information, cleared)
    explained = np.maximum(each.sum(axis=0), 0.0)
    if normal.chance is not None:
        chance = np.einsum("ji,jk,ki->i", cleared, normal.chance, cleared)
        return np.asarray(explained / np.maximum(chance, _TINY))
    groups = [each] if source is None else [each[source == own] for own in np.unique(source)]
    scatter = np.sqrt(sum(len(own) * own.var(axis=0, ddof=1) for own in groups))
    return np.asarray((explained / np.maximum(scatter, _TINY)) ** 2)


def effective_blocks(information: Array) -> float:
    """Count the blocks of equal information that would scatter as much, from that of each, shape (block,)."""
    known = np.maximum(information, 0.0)
    return float(max(known.sum() ** 2 / max(float((known**2).sum()), _TINY), 2.0))


def positive_ratio(numerator: Array, denominator: Array) -> tuple[float, float]:
    """Give the 95 % interval of a positive ratio of sums by Fieller, Anderson and Rubin, also for a weak denominator.

    It is what the ratio x may be for which ``sum (numerator - x denominator)`` is not significantly other than 0; from
    0, and to infinity, where that bounds nothing.

    Parameters
    ----------
    numerator, denominator : array, shape (block,)
        Independent contributions to both sums.
    """
    blocks = len(numerator)
    critical = float(half_width(np.array(1.0), blocks)) ** 2
    n, d = float(numerator.sum()), float(denominator.sum())
    apart = np.stack([numerator - n / blocks, denominator - d / blocks])
    (nn, nd), (_, dd) = apart @ apart.T * blocks / (blocks - 1)
    # (n - x d)^2 <= critical Var(n - x d): square x^2 - 2 line x + level <= 0.
    square, line, level = d * d - critical * dd, n * d - critical * nd, n * n - critical * nn
    root = line * line - square * level
    if root <= 0 or square == 0:
        return 0.0, np.inf
    ends = sorted(((line - np.sqrt(root)) / square, (line + np.sqrt(root)) / square))
    if square > 0:
        return max(float(ends[0]), 0.0), max(float(ends[1]), 0.0)
    # What lies between the ends is excluded.
    return (max(float(ends[1]), 0.0) if ends[0] <= 0 else 0.0), np.inf


def power_between(of: Array, by: Array, joint: Array | None = None, instruments: Array | None = None) -> Array:
    """Bound the power with which something goes with another, by logarithms of both, either of which may be noisy.

    The slope of one on the other is too small, and the inverse of that of the other on the one too large.

    Parameters
    ----------
    of, by : array, shape (sample,)
    joint : array, shape (sample, other), optional
        What `by` goes with too; as what answers `by` is no measure of it, `instruments` have to identify it.
    instruments : array, shape (sample, instrument), optional
        A constant among them.

    Returns
    -------
    array, shape (2 + other,)
        Lower and upper bound, infinite where neither rises with the other; slopes of `by` on `joint`.

    References
    ----------
    Frisch 1934 (bounds); Wooldridge 2010, chapter 5 (two-stage least squares).
    """
    constant = np.ones((len(of), 1))
    joint = constant[:, :0] if joint is None else joint

    def slopes(left: Array, right: Array) -> Array:
        first = np.column_stack([right, constant if instruments is None else instruments])
        columns = np.column_stack([right, joint, constant])
        fitted = first @ np.linalg.lstsq(first, columns)[0]
        return np.asarray(np.linalg.lstsq(fitted, left)[0][:-1], dtype=float)

    rise, *others = slopes(by, of)
    return np.array([slopes(of, by)[0], 1 / rise if rise > 0 else np.inf, *others])
