"""Innovations of a residual: whether the past predicts them, or how large they are.

A gust blows whatever the vehicle does: nothing before predicts its innovations, nor any loop, and they are as large in
gentle flight as in fierce. Those of an effect come from the motion, which goes on as it was, and are large where that
is fierce.

They are taken of windows that do not overlap, or of samples: ``r(t+1) - a r(t)`` is new since t, and so is the noise in
it. Such differences correlate with those next to them, by noise that is differentiated. A filter that looks ahead makes
them white and leaves the past an instrument; one that looks back would bring in old noise, which the past has as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import BLOCK_S
from cpfls_cli.estimation.estimate import FOLDS, OF_MANY, RIDGE, first_stage_fit_by_run, fits_of_others
from cpfls_cli.rounding import levelled
from cpfls_cli.weak_form.windows import FEWEST_SAMPLES, Windows, blocks_of

PER_WINDOW = FEWEST_SAMPLES
"""Windows that begin within one where what they see is followed in time: as many as samples follow its curve."""
_LATER = 0.25
"""Innovations come so much later, share of a window."""
_BEFORE = range(PER_WINDOW, 2 * PER_WINDOW, round(_LATER * PER_WINDOW))

MOST_PREDICTED = 1 / 5
"""Share of innovations that may be predicted where they are called the air, at 95 %: of an effect a third is."""

_DRAWS = 999
"""Of chance, so many that a rare one is known to a third."""

ROW_S = 0.01
"""Length of a row, s, of faster logs, whose samples are averaged; of slower ones a sample is a row."""
STRETCH = 40
"""Rows that errors are taken over: longer than the filter."""
_PAST = (2, 4, 8, 16, 32, 64)
"""Rows ago between which the past is averaged; the nearest one has no sample of the innovations."""
_AHEAD = 20
"""Rows that the filter looks ahead: beyond, noise of usual sensors shows no more; and over which a memory is taken."""
_TINY = 1e-9
"""Share of noise that is taken for none: what has no spectrum at some frequency cannot be made white there."""


class Innovations(NamedTuple):
    """Quasi-differences of windows of runs; of each run those of the last windows.

    `rows`, and what the past predicts of them: shape (window, axis, column); `kept`: share of the residual that lasts
    from one window to the later one, shape (axis, 1).
    """

    rows: list[Array]
    predicted: list[Array]
    kept: Array


def innovations(
    rows: Sequence[Array],
    residual: Sequence[Array],
    signals: Sequence[Array],
    per_window: int = PER_WINDOW,
    before: Sequence[int] = _BEFORE,
    ridge: float = RIDGE,
) -> Innovations:
    """Take quasi-differences of windows, and what signals of windows that ended before predict of them.

    With r the residual, a moment later and now, and a the share of it that lasts so long, ``r' - a r`` has of a gust
    only what has come since the window began. Whatever ended before that knows nothing of it, the loop's answers to
    older gusts and noise included. a is the residual's regression on itself, with its past as instrument.

    Parameters
    ----------
    rows : sequence of array, shape (window, axis, column)
        Of each run, linear in what acts.
    residual : sequence of array, shape (window, axis)
    signals : sequence of array, shape (window, signal) or (window, axis, signal)
        What is known of each window when it has ended; of each axis by itself, where all are predicted alike.
    per_window : int
        Windows that begin within one.
    before : sequence of int
        How many windows ago those of the signals began, the longest last; the first of them no longer overlap.
    ridge : float
        Of the predictions, see `first_stage_fit`.

    References
    ----------
    Holtz-Eakin, Newey and Rosen 1988 (quasi-differences, with the past as instrument); Söderström and Stoica 2002.
    """
    first, ahead = before[-1], round(_LATER * per_window)

    def moved(values: Sequence[Array], by: int) -> list[Array]:
        return [own[first + by :][: max(0, len(own) - first - ahead)] for own in values]

    # What a run is off by throughout is no gust.
    off = [own - own.mean(axis=0) if len(own) else own for own in residual]
    past = [np.sum(each, axis=0) for each in zip(*(moved(off, -lag) for lag in before), strict=True)]
    # By the past of both, which the noise of neither has a part in.
    later, now = (
        sum((each * own).sum(axis=0) for each, own in zip(moved(off, by), past, strict=True)) for by in (ahead, 0)
    )
    kept = np.clip(later / np.where(now > 0, now, np.inf), 0.0, 1.0)[:, None]
    new = [then - kept * own for then, own in zip(moved(rows, ahead), moved(rows, 0), strict=True)]
    seen = [np.concatenate(each, axis=-1) for each in zip(*(moved(signals, -lag) for lag in before), strict=True)]
    flat = {number: own.reshape(-1, own.shape[-1]) for number, own in enumerate(seen) if len(own)}
    known = first_stage_fit_by_run(flat, {n: new[n].reshape(len(own), -1) for n, own in flat.items()}, ridge)
    predicted = [known[number].reshape(own.shape) if number in known else own for number, own in enumerate(new)]
    return Innovations(new, predicted, kept)


@dataclass(frozen=True)
class ResidualInnovations:
    """Innovations of a residual.

    Attributes
    ----------
    new, predicted : array, shape (window, axis), N m and N
        And what the past predicts of them.
    noise : array, shape (axis,)
        Variance of the noise in them, which nothing predicts either.
    moved : array, shape (window, signal)
        Signals of the motion in windows that ended as each began, and their squares about the mean.
    block : array of int, shape (window,)
    """

    new: Array
    predicted: Array
    noise: Array
    moved: Array
    block: IntArray

    @property
    def shares(self) -> tuple[Array, Array]:
        """Shares that are predicted, shape (axis,), and without each block, (block, axis); NaN where all is noise."""
        known, size = _by_block(self.new * self.predicted, self.block), _by_block(self.new**2 - self.noise, self.block)
        whole = np.where(size.sum(axis=0) > 0, size.sum(axis=0), np.nan)
        return known.sum(axis=0) / whole, (known.sum(axis=0) - known) / (whole - size)

    def grows(self, rare: float) -> BoolArray:
        """Mark axes whose innovations are surely the larger, or the smaller, the more a signal moved before.

        By ranks; what chance has to offer, over all axes and signals, have blocks whose signs are drawn.

        References
        ----------
        Engle 1982 (a variance that the past predicts); Winkler et al. 2014, permutation with the largest statistic.
        """
        rows = ranks(np.abs(self.new))[:, None] * ranks(self.moved)[..., None]
        products = _by_block(rows.reshape(len(rows), -1), self.block)
        scale = np.sqrt(np.maximum((products**2).sum(axis=0), 1.0))
        alike = np.abs(products.sum(axis=0) / scale).reshape(rows.shape[1:]).max(axis=0)
        # The same draws each time that it is asked of flights, for other names too.
        signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(_DRAWS, len(products)))
        chance = np.abs(signs @ products / scale).max(axis=1)
        return np.asarray((chance[:, None] >= alike).sum(axis=0) < rare * (1 + _DRAWS))


def blows(like: BoolArray, known: BoolArray) -> bool:
    """Check whether axes that look like air can be: it turns a vehicle about every known axis, and pushes it.

    Parameters
    ----------
    like, known : array of bool, shape (axis,)
        Torques, and forces behind them where there are any.
    """
    return bool((like | ~known)[:3].all() and (like[3:].any() or not known[3:].any()))


def residual_innovations(
    windows: Windows,
    residual: Sequence[Array],
    signals: Sequence[Array],
    moving: BoolArray,
    noise: Array,
    block_s: float = BLOCK_S,
) -> ResidualInnovations:
    """Take innovations of a residual along runs, and what the past predicts of them.

    Parameters
    ----------
    windows : Windows
        A `PER_WINDOW`-th of one apart.
    residual : sequence of array, shape (window, axis), N m and N
        Of each run.
    signals : sequence of array, shape (window, signal)
        Of motion and rotors.
    moving : array of bool, shape (signal,)
        Those of the motion.
    noise : array, shape (axis, 2)
        Variances of white noise in the residual, and in what a derivative is taken of, as of samples.
    """
    rows, predicted, kept = innovations([own[..., None] for own in residual], residual, signals, ridge=OF_MANY)
    last = [np.arange(len(own) - len(new), len(own)) for own, new in zip(residual, rows, strict=True)]
    variance, ahead = np.zeros(len(noise)), round(_LATER * PER_WINDOW)
    for own, kernel in zip(noise.T, (windows.weight, windows.slope), strict=True):
        later, now = (np.pad(kernel, pad) for pad in ((ahead * windows.hop, 0), (0, ahead * windows.hop)))
        variance += own * ((later - kept * now) ** 2).sum(axis=1)
    mean = np.concatenate(signals)[:, moving].mean(axis=0)
    moved = np.concatenate([own[at - ahead - PER_WINDOW][:, moving] for own, at in zip(signals, last, strict=True)])
    index = np.repeat(np.arange(len(last)), [len(at) for at in last])
    return ResidualInnovations(
        np.concatenate(rows)[..., 0],
        np.concatenate(predicted)[..., 0],
        variance,
        np.hstack([moved, (moved - mean) ** 2]),
        blocks_of(index, np.asarray(np.concatenate(last) * float(windows.hop * windows.period)), block_s),
    )


def _by_block(values: Array, block: IntArray) -> Array:
    """Sum rows over blocks, shape (block, column)."""
    return np.array([values[block == own].sum(axis=0) for own in np.unique(block)])


def ranks(rows: Array) -> Array:
    """Rank the rows of each column, equal ones alike, doubled and about their mean, so that products are exact."""
    places = [np.unique(levelled(column), return_inverse=True)[1] for column in rows.T]
    return np.array([2.0 * each - each.max(initial=0) for each in places]).T


class Whitening(NamedTuple):
    """What makes the innovations of a residual white, by channel.

    Attributes
    ----------
    kept : array, shape (channel,)
        Share of the disturbance that lasts from a row to the next.
    ahead : array, shape (channel, row)
        Weights of a difference and of those that follow.
    scale : array, shape (channel,)
        Standard deviation of the white residual; infinite for channels that are left out.
    """

    kept: Array
    ahead: Array
    scale: Array

    def white(self, rows: Array, channel: int) -> Array:
        """Filter rows of a channel, shape (row, ...), without the first ones, which have no past, and the last ones."""
        from scipy.signal import lfilter

        new = rows[1:] - self.kept[channel] * rows[:-1]
        white = lfilter(self.ahead[channel], [1.0], new[::-1], axis=0)[::-1] / self.scale[channel]
        return np.asarray(white[_PAST[-1] : max(_PAST[-1], len(new) - _AHEAD)])


def whitening(residual: Sequence[Array], used: BoolArray) -> Whitening:
    """Find what makes the innovations of a residual white.

    What lasts is the regression of the residual on itself, with its past as the instrument; the filter is that of an
    autoregression in reversed time.

    Parameters
    ----------
    residual : sequence of array, shape (row, channel)
        Of each run.
    used : array of bool, shape (channel,)

    References
    ----------
    Hayashi and Sims 1983 (forward filtering, with instruments that are predetermined but not exogenous).
    """
    from scipy.linalg import solve_toeplitz

    # What a run is off by throughout is no innovation.
    off = [rows - rows.mean(axis=0) for rows in residual]
    past = [before(rows)[..., 1:-1].mean(axis=-1) for rows in off]
    later, now = (
        np.sum([(own[_PAST[-1] + by :][: len(z)] * z).sum(axis=0) for own, z in zip(off, past, strict=True)], axis=0)
        for by in (_AHEAD, 0)
    )
    kept = np.clip(later / np.where(now > 0, now, np.inf), 0.0, 1.0) ** (1 / _AHEAD)
    new = [rows[1:] - kept * rows[:-1] for rows in off]
    ahead, scale = np.eye(1, _AHEAD + 1) * np.ones((len(kept), 1)), np.full(len(kept), np.inf)
    for channel in np.flatnonzero(used):
        own = [rows[:, channel] for rows in new]
        alike = np.array([sum(each[lag:] @ each[: len(each) - lag] for each in own) for lag in range(_AHEAD + 1)])
        if alike[0] > 0:
            alike[0] *= 1 + _TINY
            weights = solve_toeplitz(alike[:-1], alike[1:])
            ahead[channel, 1:] = -weights
            scale[channel] = np.sqrt((alike[0] - weights @ alike[1:]) / sum(map(len, own)))
    return Whitening(kept, ahead, scale)


def before(rows: Array) -> Array:
    """Average what was before each row that `Whitening.white` gives, shape (row, ..., part): over longer parts of it.

    Parameters
    ----------
    rows : array, shape (row, ...)
    """
    # Products over time are twice as fast where it is last in memory.
    total = np.zeros((*rows.shape[1:], len(rows) + 1))
    np.cumsum(np.moveaxis(rows, 0, -1), axis=-1, out=total[..., 1:])
    first, count = _PAST[-1] + 1, max(0, len(rows) - 1 - _AHEAD - _PAST[-1])
    ends = [total[..., first - ago : first - ago + count] for ago in _PAST]
    parts = np.empty((*rows.shape[1:], len(_PAST) - 1, count))
    for part, ((one, other), own) in enumerate(zip(pairwise(ends), np.diff(_PAST), strict=True)):
        parts[..., part, :] = (one - other) / own
    return np.moveaxis(parts, -1, 0)


def about_mean(rows: Array) -> Array:
    """Take off the mean of a run, shape (row, ...): slow gusts have one too, and windows show it as well as samples."""
    if not len(rows):
        return rows
    away = rows - rows.mean(axis=0)
    return np.asarray(np.where(np.abs(away).max(axis=0) > _TINY * np.abs(rows).max(axis=0), away, 0.0))


def predicted(motion: Sequence[Array], columns: Sequence[Array], white: Sequence[Array]) -> list[Array]:
    """Predict white columns of each run by the other runs, of a single one parts by the other parts; about the mean.

    Instruments are a constant, and what was before of the motion and of the column itself.

    Parameters
    ----------
    motion : sequence of array, shape (row, signal)
    columns : sequence of array, shape (row, column)
    white : sequence of array
        As `Whitening.white` gives them.

    Returns
    -------
    list of array
        Of the shapes of `white`.
    """
    parts = FOLDS if len(white) == 1 else 1

    def instruments(number: int) -> list[tuple[Array, Array]]:
        past, own = before(motion[number]), before(columns[number])
        common = np.column_stack([np.ones(len(past)), past.reshape(len(past), -1)])
        return list(zip(np.array_split(common, parts), np.array_split(own, parts), strict=True))

    def products(number: int) -> list[tuple[Array, Array]]:
        both = zip(instruments(number), np.array_split(white[number], parts), strict=True)
        return [_products_of_columns(*own, values) for own, values in both]

    def fitted() -> Array:
        sums = (each for number in range(len(white)) for each in products(number))
        gram, moment = (np.array(each) for each in zip(*sums, strict=True))
        own = np.diagonal(gram, axis1=2, axis2=3)
        whole = np.where(own.any(axis=0), own.sum(axis=0), 1.0)
        size, others = np.sqrt(whole), (whole - own) / whole
        # Of what is fitted: a fierce run is no measure of gentle ones. What no other run has is not fitted.
        ridge = RIDGE * np.where(others > RIDGE, others, 1.0)[..., None]
        gram /= size[:, :, None] * size[:, None, :]
        return fits_of_others(gram, (moment / size)[..., None], ridge)[..., 0] / size

    # Instruments are made twice, and sums go before: those of all runs at once take five times the memory of columns.
    fit = fitted()
    return [
        about_mean(np.concatenate([_weighted(*each) for each in zip(instruments(number), weights, strict=True)]))
        for number, weights in enumerate(fit.reshape(len(white), parts, *fit.shape[1:]))
    ]


def _weighted(instruments: tuple[Array, Array], weights: Array) -> Array:
    common, own = instruments
    of_common, of_own = np.split(weights, [common.shape[1]], axis=1)
    return np.asarray(common @ of_common.T + np.einsum("tkp,kp->tk", own, of_own))


def _products_of_columns(z: Array, own: Array, values: Array) -> tuple[Array, Array]:
    """Multiply the instruments of each column with each other, and with the column."""
    count, width, parts = own.shape
    cross = (z.T @ own.reshape(count, -1)).reshape(-1, width, parts).transpose(1, 0, 2)
    turned = own.transpose(1, 2, 0)
    common = np.broadcast_to(z.T @ z, (width, z.shape[1], z.shape[1]))
    gram = np.block([[common, cross], [cross.transpose(0, 2, 1), turned @ turned.transpose(0, 2, 1)]])
    return gram, np.concatenate([(z.T @ values).T, (turned @ values.T[..., None])[..., 0]], axis=1)
