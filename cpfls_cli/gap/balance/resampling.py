"""Resampling of windows: blocks left out by cross-validation as normal equations, and residuals shifted in time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray

_LARGEST_NUMBER = 24
_RIDGE = 1e-9
_LEAST_SHARE = 10
_ALONE = 0.95
"""Share of the information on a coefficient from which on one block alone shows it."""


@dataclass(frozen=True)
class Folds:
    """Normal equations of each block.

    Attributes
    ----------
    grams : array, shape (block, channel, column, column)
    moments : array, shape (block, channel, column, draw)
        Columns times right side; several right sides are draws.
    squares : array, shape (block, channel, draw)
        Sums of squares of the right side.
    rows : int
        Rows of all blocks.
    prior : array, shape (column,)
        Information that bounds give before any data: one over the square of the largest possible coefficient.
    """

    grams: Array
    moments: Array
    squares: Array
    rows: int
    prior: Array

    @cached_property
    def gram(self) -> Array:
        """Over all channels, shape (block, column, column)."""
        return np.asarray(self.grams.sum(axis=1))

    @cached_property
    def moment(self) -> Array:
        """Over all channels, shape (block, column, draw)."""
        return np.asarray(self.moments.sum(axis=1))

    @cached_property
    def square(self) -> Array:
        """Over all channels, shape (block, draw)."""
        return np.asarray(self.squares.sum(axis=1))

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return len(self.grams)

    def solve(self, columns: IntArray, believed: int = 0) -> tuple[Array, Array]:
        """Fit a subset of columns without each block and evaluate it on that block.

        Parameters
        ----------
        columns : array of int
        believed : int
            So many of the first columns are not in question: a block that alone shows one of these stays in the fit,
            because without it nothing is known of that coefficient.

        Returns
        -------
        coefficients : array, shape (block, column, draw)
        error : array, shape (block, draw)
            Sum of squares left on the block that the fit did not see.
        """
        gram, moment = self.gram[:, columns[:, None], columns], self.moment[:, columns]
        out = np.where(self.alone(columns[:believed]), 0.0, 1.0)[:, None, None]
        coefficients = _solve(gram.sum(axis=0) - out * gram + self._known(columns), moment.sum(axis=0) - out * moment)
        return coefficients, self._left(gram, moment, coefficients)

    def alone(self, columns: IntArray) -> BoolArray:
        """Mark blocks that alone show the coefficient of one of some columns, shape (block,)."""
        own = self.gram[:, columns, columns]
        return np.asarray((own > _ALONE * own.sum(axis=0)).any(axis=1))

    def fit(self, columns: IntArray) -> tuple[Array, Array]:
        """Fit a subset of columns on all blocks.

        Returns
        -------
        coefficients : array, shape (column, draw)
        error : array, shape (block, draw)
        """
        gram, moment = self.gram[:, columns[:, None], columns], self.moment[:, columns]
        coefficients = _solve(gram.sum(axis=0) + self._known(columns), moment.sum(axis=0))
        return coefficients, self._left(gram, moment, coefficients[None])

    def errors(self, columns: IntArray) -> Array:
        """Give standard errors of a fit on all blocks as if rows were independent; one draw.

        Returns
        -------
        array, shape (column,)
        """
        gram = self.gram[:, columns[:, None], columns].sum(axis=0) + self._known(columns)
        _, left = self.fit(columns)
        inverse = _solve(gram, np.eye(len(columns)))
        return np.asarray(np.sqrt(np.maximum(np.diagonal(inverse), 0.0) * max(left.sum() / self.rows, 1.0)))

    def _known(self, columns: IntArray) -> Array:
        return np.diag(self.prior[columns])

    def _left(self, gram: Array, moment: Array, coefficients: Array) -> Array:
        explained = np.einsum(
            "bcd,bcd->bd", 2 * moment - gram @ coefficients, np.broadcast_to(coefficients, moment.shape)
        )
        return np.asarray(self.square - explained)

    def subtracted(self, column: int, kept: IntArray, weight: Array) -> Folds:
        """Subtract a column with coefficient 1 from the right side and weigh the channels.

        Parameters
        ----------
        column : int
        kept : array of int
            Columns that the result has.
        weight : array, shape (channel,)
            On the rows.
        """
        inner = self.grams[:, :, kept, column, None]
        square = self.squares - 2 * self.moments[:, :, column] + self.grams[:, :, column, column, None]
        power = weight[:, None] ** 2
        grams = power[..., None] * self.grams[:, :, kept[:, None], kept]
        return Folds(
            grams, power[..., None] * (self.moments[:, :, kept] - inner), power * square, self.rows, self.prior[kept]
        )


def folds(columns: Array, right: Array, block: IntArray, prior: Array | None = None) -> Folds:
    """Build the normal equations of each block.

    Parameters
    ----------
    columns : array, shape (window, channel, column)
        Weighted.
    right : array, shape (window, channel) or (window, channel, draw)
        Weighted.
    block : array of int, shape (window,)
    prior : array, shape (column,), or None
        None for nothing known.
    """
    draws = right.reshape(*right.shape[:2], -1)
    in_block = [block == b for b in range(int(block.max()) + 1)]
    parts = [(columns[rows].swapaxes(0, 1), draws[rows].swapaxes(0, 1)) for rows in in_block]
    return Folds(
        np.array([x.swapaxes(1, 2) @ x for x, _ in parts]),
        np.array([x.swapaxes(1, 2) @ y for x, y in parts]),
        np.array([(y**2).sum(axis=1) for _, y in parts]),
        columns.shape[0] * columns.shape[1],
        np.zeros(columns.shape[2]) if prior is None else prior,
    )


def blocks_of(flight_index: IntArray, centres: Array, block_s: float) -> IntArray:
    """Cut flights into contiguous blocks of about equal length.

    Parameters
    ----------
    flight_index : array of int, shape (window,)
    centres : array, shape (window,), s
        Middle of each window in its own flight.
    block_s : float
        Wanted length; longer where there would be too many.

    Returns
    -------
    array of int, shape (window,)
        Blocks from 0, without gaps.
    """
    spans = [np.ptp(centres[flight_index == f]) for f in np.unique(flight_index)]
    length = max(block_s, sum(spans) / _LARGEST_NUMBER)
    block = np.zeros(len(centres), dtype=int)
    first = 0
    for flight, span in zip(np.unique(flight_index), spans, strict=True):
        in_flight = flight_index == flight
        number = max(1, round(span / length))
        order = np.arange(in_flight.sum()) * number // max(1, in_flight.sum())
        block[in_flight] = first + order
        first += number
    return block


def _solve(gram: Array, moment: Array) -> Array:
    """Solve normal equations with columns brought to one length; a column of zeros gets the coefficient 0."""
    length = np.sqrt(np.diagonal(gram, axis1=-2, axis2=-1))
    scale = 1.0 / np.where(length > 0, length, 1.0)
    scaled = gram * scale[..., :, None] * scale[..., None, :] + _RIDGE * np.eye(gram.shape[-1])
    empty = (length <= 0)[..., None] * np.eye(gram.shape[-1])
    return np.asarray(np.linalg.solve(scaled + empty, moment * scale[..., None]) * scale[..., None])


def about_flight_mean(values: Array, flight_index: IntArray) -> Array:
    """Subtract the mean over each flight.

    Parameters
    ----------
    values : array, shape (window, ...)
    flight_index : array of int, shape (window,)

    Returns
    -------
    array, shape (window, ...)
    """
    flights, number = np.unique(flight_index, return_inverse=True)
    return np.asarray(values - np.array([values[number == f].mean(axis=0) for f in range(len(flights))])[number])


def mirror_shifted(residual: Array, flight_index: IntArray, shifts: int, rng: np.random.Generator) -> Array:
    """Draw circular shifts of the residual of each flight joined with its mirror image, with random signs.

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
        indices = np.flatnonzero(flight_index == flight)
        circle = np.concatenate([residual[indices], residual[indices][::-1]])
        least = max(1, len(indices) // _LEAST_SHARE)
        offsets = rng.integers(least, max(least + 1, len(circle) - least + 1), size=shifts)
        sources = (np.arange(len(indices))[:, None] - offsets) % len(circle)
        rows = np.moveaxis(circle[sources], 1, 2) * rng.choice([-1.0, 1.0], size=shifts)
        draws[indices] = rows - rows.mean(axis=0)
    return draws
