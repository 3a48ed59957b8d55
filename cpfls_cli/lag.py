"""Delay and lag of sampled signals: both applied by one formula for all rooms, and a delay estimated."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray, Numbers
from cpfls_cli.blocks import half_width, jackknife_error
from cpfls_cli.filters import recursion
from cpfls_cli.rounding import levelled

Between = Literal["cubic", "linear", "previous"]
"""What a signal is between samples.

``cubic`` is the curve through the four samples around, for whatever moves smoothly: measured speeds, and commands of a
controller that runs faster than its log. ``linear`` needs no sample behind the next one, so an exported model can take
it step by step. ``previous`` is a command that stays until the next sample.

Against the exact delay of signals of up to 8 Hz, sampled at 100 Hz, cubics are off by 0.04 % of the signal, a global
spline by 0.004 %, monotone cubics by 0.4 %, straight lines by 1 %, the nearest sample by 8 %; a lag of 30 ms alike. A
spline overshoots a step by 10 % and spreads an outlier over the flight, cubics by 6 % and over four samples.
"""

# Powers of the time since a sample, in samples, by which the samples at -1, 0, 1 and 2 count until the next one.
_CURVES: dict[Between, Array] = {
    "cubic": np.array([[0, -2, 3, -1], [6, -3, -6, 3], [0, 6, 3, -3], [0, -1, 0, 1]]) / 6.0,
    "linear": np.array([[0, 0, 0, 0], [1, -1, 0, 0], [0, 1, 0, 0], [0, 0, 0, 0]], dtype=float),
    "previous": np.array([[0, 0, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]], dtype=float),
}
_FORGOTTEN = 0.02
"""Lag in samples below which nothing of a sample is left at the next one: ``exp(-1 / 0.02)`` is 2e-22."""
_NODES, _LENGTHS = (0.5 * part for part in np.polynomial.legendre.leggauss(8))
"""Quadrature over a sample about its middle, exact to rounding for lags of a sample and more."""
_COLLINEAR = 1e-9
"""Squared share of a column of its own below which it goes with the others."""
_TINY = float(np.finfo(float).tiny)


def delayed(values: Numbers, steps: Any, between: Between = "cubic") -> Numbers:
    """Shift signals in time; beyond the ends the first or the last value is held.

    What is held and moved by a part of a sample has the mix of two samples as its mean over a sample, so ``previous``
    gives the same as ``linear``.

    Parameters
    ----------
    values : array, shape (time, ...)
        Evenly sampled.
    steps : float or complex
        Delay in samples; below 0 brings the signals forward. A complex one carries a derivative.
    between : {"cubic", "linear", "previous"}

    Returns
    -------
    array, shape of `values`
    """
    if steps == 0 or len(values) < 2:
        return values
    whole, length = int(np.floor(np.real(steps))), len(values)
    # All samples lie at the same place between two: this far behind the earlier one.
    taps = _CURVES["cubic" if between == "cubic" else "linear"] @ (1 - (steps - whole)) ** np.arange(4)
    extended, early = _extended(values, between), max(whole + 1, 0)
    held = np.repeat(extended[:1], early, axis=0), np.repeat(extended[-1:], max(-whole - 1, 0), axis=0)
    extended, first = np.concatenate([held[0], extended, held[1]]), early - whole - 1
    moved = _sum(taps, [extended[first + tap : first + tap + length] for tap in range(4)])
    moved[: max(whole + (steps != whole), 0)] = values[0]
    moved[max(length + whole, 0) :] = values[-1]
    return moved


def best_delay(delays: Array, misfit: Array) -> tuple[Array, BoolArray]:
    """Find the delays of the least misfit, between those that were tried by a parabola.

    Parameters
    ----------
    delays : array, shape (delay,)
        Evenly spaced.
    misfit : array, shape (delay, ...)

    Returns
    -------
    array, shape (...)
    array of bool, shape (...)
        Whether it is neither the first nor the last that was tried.
    """
    best = misfit.argmin(axis=0)
    inside = (best > 0) & (best < len(delays) - 1)
    if len(delays) < 3:
        return np.asarray(delays[best]), np.asarray(inside)
    middle = np.clip(best, 1, len(delays) - 2)
    before, least, after = (np.take_along_axis(misfit, (middle + step)[None], 0)[0] for step in (-1, 0, 1))
    bend = before - 2 * least + after
    step = np.where(inside & (bend > 0), 0.5 * (before - after) / np.where(bend > 0, bend, 1.0), 0.0)
    return np.asarray(delays[best] + step * (delays[1] - delays[0])), np.asarray(inside)


class DelayFit(NamedTuple):
    """Delays that were estimated, one of all axes, shape (), or one of each, shape (axis,).

    Attributes
    ----------
    delay : array, shape (...)
        Between those that were tried by a parabola.
    left_out : array, shape (block, ...)
        Without each block.
    error : array, shape (...)
        Standard error by the jackknife over blocks, NaN of a single one. Where two delays explain as much, leaving out
        a block moves from one to the other, and it is large; at the end of what was tried it holds that of a step.
    inside : array of bool, shape (...)
        Whether it is neither the first nor the last that was tried.
    unexplained : array, shape (delay, ...)
        Share of the signals at each that was tried; of all axes their geometric mean.
    coefficients : array, shape (1 and block, axis, column)
        At the best of those that were tried, of all and without each block.
    residual : array, shape (1 and block, axis)
        Mean square there.
    """

    delay: Array
    left_out: Array
    error: Array
    inside: BoolArray
    unexplained: Array
    coefficients: Array
    residual: Array

    @property
    def half(self) -> Array:
        """Half of the 95 % interval, shape (...)."""
        return half_width(self.error, len(self.left_out))


def fit_delay(
    delays: Array,
    moved: Callable[[float], tuple[Array, Array]],
    block: IntArray,
    *,
    each: bool = False,
    pooled: bool = False,
) -> DelayFit:
    """Estimate by which delay columns explain signals best: regressions with a constant at every delay, over blocks.

    A delay of all axes is the most likely one where each axis has noise of its own size, so that one that is hardly
    explained does not move it. Where an autopilot answers what else moves the vehicle, as gusts, the delay of the loop
    pulls the estimate, and the interval does not hold it.

    Parameters
    ----------
    delays : array, shape (delay,)
        Evenly spaced, one or more.
    moved : callable
        Gives columns, shape (sample, axis, column), and signals, shape (sample, axis), at a delay: whichever is
        delayed.
    block : array of int, shape (sample,)
        Ascending from 0: independent parts.
    each : bool
        A delay of each axis.
    pooled : bool
        All axes share the coefficients.

    References
    ----------
    Ljung 1999, *System Identification*, section 10.1 (least squares); Efron and Tibshirani 1993 (jackknife).
    """
    products = np.array([_products(*moved(float(delay)), block) for delay in delays])
    total = products.sum(axis=1, keepdims=True)
    kept = np.concatenate([total, total - products], axis=1) if block[-1] else total
    # About the means of what is kept.
    count, sums = kept[..., 0, 0], kept[..., 1:, :1]
    kept = kept[..., 1:, 1:] - sums @ sums.swapaxes(-1, -2) / count[..., None, None]
    gram, cross, power = kept[..., :-1, :-1], kept[..., :-1, -1:], kept[..., -1, -1]
    shared = (own.sum(axis=2, keepdims=True) if pooled else own for own in (gram, cross))
    found = np.broadcast_to(_solved(*shared), cross.shape)
    rest = power - (found * (2 * cross - gram @ found)).sum(axis=(-2, -1))
    # What does not move says nothing.
    moves = power > 0
    misfit = np.log(np.maximum(np.divide(rest, power, out=np.ones_like(rest), where=moves), _TINY))
    if not each:
        misfit = misfit.sum(axis=2) / np.maximum(moves.sum(axis=2), 1)
    misfit = np.apply_along_axis(levelled, 0, np.exp(misfit))
    values, inside = best_delay(delays, misfit)
    error = jackknife_error(values[1:]) if len(values) > 1 else np.full(values.shape[1:], np.nan)
    best = np.broadcast_to(misfit.argmin(axis=0).reshape(len(values), -1), rest.shape[1:])[None]
    return DelayFit(
        delay=values[0],
        left_out=values[1:],
        error=np.where(inside[0], error, np.hypot(error, np.diff(delays[:2]).sum() / np.sqrt(12))),
        inside=inside[0],
        unexplained=misfit[:, 0],
        coefficients=np.take_along_axis(found[..., 0], best[..., None], 0)[0],
        residual=np.take_along_axis(rest / count, best, 0)[0],
    )


def _products(columns: Array, signals: Array, block: IntArray) -> Array:
    """Multiply a one, columns and the signal of each axis with each other over blocks, shape (block, axis, ...)."""
    signals = (signals - signals.mean(axis=0))[..., None]
    both = np.concatenate([np.ones_like(signals), columns, signals], axis=2)
    by_axis = np.ascontiguousarray(both.transpose(1, 2, 0))
    ends = np.searchsorted(block, np.arange(block[-1] + 2))
    parts = (by_axis[..., begin:end] for begin, end in pairwise(ends))
    return np.array([part @ part.swapaxes(1, 2) for part in parts])


def _solved(gram: Array, cross: Array) -> Array:
    """Solve normal equations of columns of any length; one of zeros gets 0."""
    size = np.sqrt(np.maximum(np.diagonal(gram, axis1=-2, axis2=-1), 0.0))
    size = np.where(size > 0, size, 1.0)[..., None]
    among = gram / size / size.swapaxes(-1, -2) + _COLLINEAR * np.eye(gram.shape[-1])
    return np.asarray(np.linalg.solve(among, cross / size) / size)


class Lagged(NamedTuple):
    """Signals behind a lag, each of the shape of the signals: over the step from each sample, at its end, its start."""

    mean: Numbers
    end: Numbers
    start: Numbers


def lagged(values: Numbers, ratio: Any, between: Between = "cubic") -> Lagged:
    """Filter signals by a first-order lag, ``tau y' + y = u``, exactly for what u is between samples.

    Parameters
    ----------
    values : array, shape (time, ...)
        u, evenly sampled; y starts at its first value.
    ratio : float or complex
        tau in samples, at least 0. A complex one carries a derivative.
    between : {"cubic", "linear", "previous"}
    """
    extended = _extended(values, between)
    parts = [extended[first : first + len(values)] for first in range(4)]
    decay = np.exp(-1 / ratio) if np.real(ratio) > _FORGOTTEN else 0.0
    end = _sum(_CURVES[between] @ _moments(ratio, decay), parts)
    if decay != 0.0:
        end = recursion([-decay], np.concatenate([end[:1] + decay * values[:1], end[1:]]))
    start = np.concatenate([values[:1], end[:-1]])
    # The equation of the lag, averaged over the step.
    mean = _sum(_CURVES[between] @ (1.0 / np.arange(1, 5)), parts) - ratio * (end - start)
    return Lagged(mean, end, start)


def _moments(ratio: Any, decay: Any) -> Numbers:
    """Compute what powers 0 to 3 of the time since a sample have left behind the lag at the next one."""
    if np.real(ratio) > 1:
        weight = _LENGTHS / ratio * np.exp((_NODES - 0.5) / ratio)
        return np.asarray(weight @ (_NODES[:, None] + 0.5) ** np.arange(4))
    moments = [1 - decay]
    for power in (1, 2, 3):
        moments.append(1 - power * ratio * moments[-1])
    return np.array(moments)


def _sum(taps: Numbers, parts: list[Numbers]) -> Numbers:
    return np.asarray(sum(tap * part for tap, part in zip(taps, parts, strict=True) if tap != 0))


def _extended(values: Numbers, between: Between) -> Numbers:
    """Continue signals by one sample before and two after: cubics in a straight line, others as they are."""
    first, last = values[:1], values[-1:]
    if between == "cubic" and len(values) > 1:
        first, last = 2 * first - values[1:2], 2 * last - values[-2:-1]
    return np.concatenate([first, values, last, last])
