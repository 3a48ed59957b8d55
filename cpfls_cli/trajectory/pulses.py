"""Closed forms of one sine wave of pop, and of coasting between waves."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array


def pulse(elapsed: Array, period: float) -> Array:
    """Integrate one wave of pop from rest, ``p(t) = w sin(w t)`` with ``w = 2 pi / P``.

    Parameters
    ----------
    elapsed : array, shape (time,), s
        Time since the wave began.
    period : float, s
        P.

    Returns
    -------
    array, shape (time, 7)
        Displacement, velocity, acceleration, jerk, snap, crackle, pop, for a crackle amplitude of 1.

    References
    ----------
    Section 7 of the paper.
    """
    t, w = elapsed, 2 * np.pi / period
    sine, cosine = np.sin(w * t), np.cos(w * t)
    return np.column_stack(
        [
            t**5 / 120 - t**3 / (6 * w**2) + t / w**4 - sine / w**5,
            t**4 / 24 - t**2 / (2 * w**2) + (1 - cosine) / w**4,
            t**3 / 6 - t / w**2 + sine / w**3,
            t**2 / 2 - (1 - cosine) / w**2,
            t - sine / w,
            1 - cosine,
            w * sine,
        ]
    )


def carry(state: Array, elapsed: Array) -> Array:
    """Carry displacement and its derivatives on while the crackle is zero.

    Parameters
    ----------
    state : array, shape (time, 7)
        Displacement, velocity, acceleration, jerk, snap, and two columns that are not read.
    elapsed : array, shape (time,), s

    Returns
    -------
    array, shape (time, 7)
        The Taylor polynomial of the state; crackle and pop are zero.
    """
    r, v, a, j, s = state[:, :5].T
    t = elapsed
    moved = np.zeros_like(state)
    moved[:, 0] = r + t * (v + t / 2 * (a + t / 3 * (j + t / 4 * s)))
    moved[:, 1] = v + t * (a + t / 2 * (j + t / 3 * s))
    moved[:, 2] = a + t * (j + t / 2 * s)
    moved[:, 3] = j + t * s
    moved[:, 4] = s
    return moved
