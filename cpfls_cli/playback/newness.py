"""What comes newly of a residual: whether what was before foretells it, or how large it is.

A gust blows whatever the vehicle does: what is new in it nobody knew before, and it blows alike in gentle flight and in
fierce. What is new of an effect comes from the motion, which goes on as it was, and is large where that is fierce.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import BLOCK_S
from cpfls_cli.playback.past import LATER, News, what_is_new
from cpfls_cli.rounding import levelled
from cpfls_cli.weak_form.resampling import blocks_of
from cpfls_cli.weak_form.windows import FEWEST_SAMPLES, Windows

PER_WINDOW = FEWEST_SAMPLES
"""Windows that begin within one where what they see is followed in time: as many as samples follow its curve."""

MOST_FORETOLD = 1 / 5
"""Share of what is new that may be foretold where it is called the air, at 95 %: of an effect a third is."""

_DRAWS = 999
"""Of chance, so many that a rare one is known to a third."""


def news(rows: Sequence[Array], left: Sequence[Array], told: Sequence[Array], *, many: bool = False) -> News:
    """Give what comes newly after windows of runs, a `PER_WINDOW`-th of one apart; see `what_is_new`."""
    ahead = round(LATER * PER_WINDOW)
    return what_is_new(rows, left, told, ahead, range(PER_WINDOW, 2 * PER_WINDOW, ahead), many=many)


@dataclass(frozen=True)
class NewlyLeft:
    """What comes newly of a residual.

    Attributes
    ----------
    new, foretold : array, shape (window, axis), N m and N
        And what was foretold of it.
    noise : array, shape (axis,)
        Variance of the noise in it, which nothing foretells either.
    moved : array, shape (window, signal)
        Signals of the motion in windows that ended as it began, and their squares about the mean.
    block : array of int, shape (window,)
    """

    new: Array
    foretold: Array
    noise: Array
    moved: Array
    block: IntArray

    @property
    def shares(self) -> tuple[Array, Array]:
        """Shares that were foretold, shape (axis,), and without each block, (block, axis); NaN where all is noise."""
        told, size = _by_block(self.new * self.foretold, self.block), _by_block(self.new**2 - self.noise, self.block)
        whole = np.where(size.sum(axis=0) > 0, size.sum(axis=0), np.nan)
        without = (told.sum(axis=0) - told) / (whole - size)
        return told.sum(axis=0) / whole, without

    def grows(self, rare: float) -> BoolArray:
        """Mark axes whose new part is surely the larger, or the smaller, the more a signal moved before.

        By ranks; what chance has to offer, over all axes and signals, have blocks whose signs are drawn.

        References
        ----------
        Engle 1982 (a variance that the past foretells); Winkler et al. 2014, permutation with the largest statistic.
        """
        rows = ranks(np.abs(self.new))[:, None] * ranks(self.moved)[..., None]
        products = _by_block(rows.reshape(len(rows), -1), self.block)
        scale = np.sqrt(np.maximum((products**2).sum(axis=0), 1.0))
        alike = np.abs(products.sum(axis=0) / scale).reshape(rows.shape[1:]).max(axis=0)
        # The same draws each time that it is asked of flights, beside other names too.
        signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(_DRAWS, len(products)))
        chance = np.abs(signs @ products / scale).max(axis=1)
        return np.asarray((chance[:, None] >= alike).sum(axis=0) < rare * (1 + _DRAWS))


def blows(like: BoolArray, known: BoolArray) -> bool:
    """Tell whether axes that look like air can be: it turns a vehicle about every axis that is known, and pushes it.

    Parameters
    ----------
    like, known : array of bool, shape (axis,)
        Torques, and forces behind them where there are any.
    """
    return bool((like | ~known)[:3].all() and (like[3:].any() or not known[3:].any()))


def newly_left(
    windows: Windows,
    left: Sequence[Array],
    told: Sequence[Array],
    moving: BoolArray,
    noise: Array,
    block_s: float = BLOCK_S,
) -> NewlyLeft:
    """Take what comes newly of what is left along runs, and what was told of it before.

    Parameters
    ----------
    windows : Windows
        A `PER_WINDOW`-th of one apart.
    left : sequence of array, shape (window, axis), N m and N
        Of each run.
    told : sequence of array, shape (window, signal)
        Of motion and rotors.
    moving : array of bool, shape (signal,)
        Those of the motion.
    noise : array, shape (axis, 2)
        Variances of white noise in what is left, and in what a derivative is taken of, as of samples.
    """
    rows, foretold, lasts = news([own[..., None] for own in left], left, told, many=True)
    last = [np.arange(len(own) - len(new), len(own)) for own, new in zip(left, rows, strict=True)]
    variance, ahead = np.zeros(len(noise)), round(LATER * PER_WINDOW)
    for own, kernel in zip(noise.T, (windows.weight, windows.slope), strict=True):
        later, now = (np.pad(kernel, pad) for pad in ((ahead * windows.hop, 0), (0, ahead * windows.hop)))
        variance += own * ((later - lasts * now) ** 2).sum(axis=1)
    mean = np.concatenate(told)[:, moving].mean(axis=0)
    moved = np.concatenate([own[at - ahead - PER_WINDOW][:, moving] for own, at in zip(told, last, strict=True)])
    hop_s = float(windows.hop * windows.period)
    index = np.repeat(np.arange(len(last)), [len(at) for at in last])
    return NewlyLeft(
        np.concatenate(rows)[..., 0],
        np.concatenate(foretold)[..., 0],
        variance,
        np.hstack([moved, (moved - mean) ** 2]),
        blocks_of(index, np.asarray(np.concatenate(last) * hop_s), block_s),
    )


def _by_block(values: Array, block: IntArray) -> Array:
    """Sum rows over blocks, shape (block, column)."""
    return np.array([values[block == own].sum(axis=0) for own in np.unique(block)])


def ranks(rows: Array) -> Array:
    """Rank the rows of each column, equal ones alike, doubled and about their mean, so that products are exact."""
    places = [np.unique(levelled(column), return_inverse=True)[1] for column in rows.T]
    return np.array([2.0 * each - each.max(initial=0) for each in places]).T
