"""How durations, holds and peaks of a move hang together: every derivative is the ramp of the one below.

With ``T1 = P``, ``T2 = T1 + Ts``, ``T3 = T1 + T2 + Tj``, ``T4 = T1 + T2 + T3 + Ta`` and
``T5 = T1 + T2 + T3 + T4 + Tv`` the peaks are ``s = A T1``, ``j = s T2``, ``a = j T3``, ``v = a T4``, ``D = v T5``,
and the whole move lasts ``T1 + T2 + T3 + T4 + T5``. These are called spans here.
"""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array

# A hold shorter than this part of its span is what rounding left of none.
_NO_HOLD = 8 * float(np.finfo(float).eps)


def spans_of(period: float | Array, holds: Array) -> Array:
    """Add up the spans.

    Parameters
    ----------
    period : float or array, shape (moves,), s
        P.
    holds : array, shape (4,) or (4, moves), s
        Holds of snap, jerk, acceleration and velocity.

    Returns
    -------
    array, shape (5,) or (5, moves), s
        T1 to T5.
    """
    spans = np.empty((5, *holds.shape[1:]))
    spans[0] = period
    # A sum too large for numbers is infinite, and told by whoever asked for it.
    with np.errstate(over="ignore"):
        for level in range(1, 5):
            spans[level] = spans[:level].sum(axis=0) + holds[level - 1]
    return spans


def holds_of(spans: Array) -> Array:
    """Find what of each span is hold, the inverse of `spans_of`.

    Parameters
    ----------
    spans : array, shape (5, moves), s

    Returns
    -------
    array, shape (4, moves), s
    """
    holds = spans[1:] - np.cumsum(spans, axis=0)[:-1]
    holds[holds <= _NO_HOLD * spans[1:]] = 0.0
    return holds


def peaks_of(displacement: float | Array, spans: Array) -> Array:
    """Find the peak of every derivative.

    Parameters
    ----------
    displacement : float or array, shape (moves,), m
        Of any sign.
    spans : array, shape (5,) or (5, moves), s
        The first of them may be zero; what rises in no time has a derivative without bound.

    Returns
    -------
    array, shape (7,) or (7, moves), m and s
        Largest absolute displacement, velocity, acceleration, jerk, snap, crackle and pop.

    References
    ----------
    Section 7 of the paper; method.md section 3.
    """
    peaks = np.zeros((7, *spans.shape[1:]))
    peaks[0] = np.abs(displacement)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for order, span in enumerate(spans[::-1], start=1):
            peaks[order] = peaks[order - 1] / span
        peaks[6] = 2 * np.pi * peaks[5] / spans[0]
        peaks[5] *= 2
    return np.where(peaks[0] > 0, peaks, 0.0)
