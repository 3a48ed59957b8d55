"""Which signal a residual follows: a smooth curve per signal, judged on unseen blocks and against shifted residuals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.gap.balance.folds import folds
from cpfls_cli.gap.balance.mirrored import about_flight_mean, mirror_shifted
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.residual.state_signals import ANGLES

_DEGREE = 4
_HARMONICS = (1, 2, 3)
_OUTER_PERCENT = 0.5
_FEWEST_BLOCKS = 3


class Dependence(NamedTuple):
    """How well one signal alone tells a channel of the residual.

    Attributes
    ----------
    channel : str
        One of `CHANNELS`.
    signal : str
    r2 : float
        Share of the variance about the mean of each flight that the curve explains on blocks its fit did not see;
        negative where the curve is worse than none.
    p_value : float
        Probability that chance reaches as much in any channel with any signal.
    """

    channel: str
    signal: str
    r2: float
    p_value: float


def rank_dependence(
    residual: Array,
    flight_index: IntArray,
    block: IntArray,
    state: Mapping[str, Array],
    shifts: int,
    rng: np.random.Generator,
) -> tuple[Dependence, ...]:
    """Rank what each signal alone explains of each channel.

    The curve is a quartic polynomial of the scaled signal, for roll and yaw three harmonics. Curve and residual are
    taken about their mean over each flight, so that differences between flights, of which there are few, explain
    nothing. Neighbouring windows are alike, which makes tests for independent rows useless: here the residual of each
    flight is shifted in time against the signals (`mirror_shifted`), and the best share of all channels and signals is
    what chance has to offer (family-wise).

    Parameters
    ----------
    residual : array, shape (window, 6), N m and N, or floors
        A channel that a flight lacks is 0 all through it.
    flight_index : array of int, shape (window,)
    block : array of int, shape (window,)
        From 0, without gaps; left out one by one.
    state : mapping of str to array, shape (window,)
        Not a number where a flight lacks the signal; it is judged on the other flights.
    shifts : int
        Number of draws of chance.
    rng : numpy.random.Generator

    Returns
    -------
    tuple of Dependence
        Largest share first; channels without residual and signals that stand still are left out.

    References
    ----------
    Winkler et al. 2014, permutation inference with the largest statistic; Politis and Romano 1992, circular blocks.
    """
    shifted = mirror_shifted(residual, flight_index, shifts, rng)
    draws = np.concatenate([about_flight_mean(residual, flight_index)[..., None], shifted], axis=2)
    judged: list[tuple[int, str, Array]] = []
    for name, signal in state.items():
        for channels, rows in _where_known(residual, flight_index, np.isfinite(signal)):
            curve = _curve(name, signal[rows])
            if curve.size and len(np.unique(block[rows])) >= _FEWEST_BLOCKS:
                curve = about_flight_mean(curve, flight_index[rows])
                share = _share(curve, draws[np.ix_(rows, channels)], block[rows])
                judged += [(int(channel), name, own) for channel, own in zip(channels, share, strict=True)]
    return _ranked(judged, shifts)


def _ranked(judged: list[tuple[int, str, Array]], shifts: int) -> tuple[Dependence, ...]:
    if not judged:
        return ()
    chance = np.max([share[1:] for _, _, share in judged], axis=0)
    found = [
        Dependence(CHANNELS[channel], name, float(share[0]), float((1 + (chance >= share[0]).sum()) / (1 + shifts)))
        for channel, name, share in judged
    ]
    return tuple(sorted(found, key=lambda one: -one.r2))


def _where_known(residual: Array, flight_index: IntArray, finite: BoolArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Group channels by the flights that have them: channels, and windows with both channel and signal."""
    flights, own = np.unique(flight_index, return_inverse=True)
    present = np.array([(residual[own == f] != 0).any(axis=0) for f in range(len(flights))])
    for pattern in np.unique(present, axis=1).T:
        channels = np.flatnonzero((present == pattern[:, None]).all(axis=0))
        rows = np.flatnonzero(pattern[own] & finite)
        if len(rows):
            yield channels, rows


def _curve(name: str, signal: Array) -> Array:
    if name in ANGLES:
        turns = np.multiply.outer(signal, _HARMONICS)
        return np.concatenate([np.sin(turns), np.cos(turns)], axis=1)
    low, high = np.percentile(signal, [_OUTER_PERCENT, 100 - _OUTER_PERCENT])
    if not high > low:
        return np.zeros((len(signal), 0))
    # Beyond the outer percents the curve stays constant, or a few windows would decide a quartic.
    scaled = np.clip(2 * (signal - low) / (high - low) - 1, -1, 1)
    return np.asarray(chebyshev.chebvander(scaled, _DEGREE)[:, 1:])


def _share(curve: Array, draws: Array, block: IntArray) -> Array:
    """Give the share explained of unseen blocks, shape (channel, draw)."""
    normal = folds(curve[:, None], draws.reshape(len(draws), 1, -1), block)
    _, error = normal.solve(np.arange(curve.shape[1]))
    total = np.maximum(normal.square.sum(axis=0), np.finfo(float).tiny)
    return np.asarray((1 - error.sum(axis=0) / total).reshape(draws.shape[1:]))
