"""Residuals shifted in time without a seam: what is left of them when nothing of the flight causes them."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, IntArray

_LEAST_SHARE = 10


def about_flight_mean(values: Array, flight_index: IntArray) -> Array:
    """Take out the mean over each flight.

    Parameters
    ----------
    values : array, shape (window, ...)
    flight_index : array of int, shape (window,)

    Returns
    -------
    array, shape (window, ...)
    """
    flights, own = np.unique(flight_index, return_inverse=True)
    return np.asarray(values - np.array([values[own == f].mean(axis=0) for f in range(len(flights))])[own])


def mirror_shifted(residual: Array, flight_index: IntArray, shifts: int, rng: np.random.Generator) -> Array:
    """Shift the residual of each flight around a circle that holds it forwards and backwards, with random signs.

    A plain circle joins the end of a flight to its start. Slow residuals jump there and slow signals do not, so chance
    explains less of the shifted residual than of a residual without any cause: with neighbouring windows correlated
    by 0.9, a test at 5 % is then wrong in 8 to 10 % of the cases. The mirrored circle has no seam.

    Parameters
    ----------
    residual : array, shape (window, channel)
    flight_index : array of int, shape (window,)
    shifts : int
    rng : numpy.random.Generator

    Returns
    -------
    array, shape (window, channel, shift)
        About the mean of each flight.
    """
    draws = np.zeros((*residual.shape, shifts))
    for flight in np.unique(flight_index):
        own = np.flatnonzero(flight_index == flight)
        circle = np.concatenate([residual[own], residual[own][::-1]])
        least = max(1, len(own) // _LEAST_SHARE)
        offsets = rng.integers(least, max(least + 1, len(circle) - least + 1), size=shifts)
        places = (np.arange(len(own))[:, None] - offsets) % len(circle)
        rows = np.moveaxis(circle[places], 1, 2) * rng.choice([-1.0, 1.0], size=shifts)
        draws[own] = rows - rows.mean(axis=0)
    return draws
