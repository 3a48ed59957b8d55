"""Weak form: averages over smooth windows, derivatives moved onto them by parts; blocks left out in turn."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Protocol, Self

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cpfls_cli.arrays import Array, BoolArray, IntArray, Numbers
from cpfls_cli.blocks import MOST_BLOCKS, contiguous
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError

_RIDGE = 1e-9  # Of columns brought to one length: far below noise, far above rounding.
_LEAST_SHARE = 10  # A shift is at least this part of a flight, so that slow motion does not meet itself.


@dataclass(frozen=True)
class BlockRows:
    """What normal equations are made of."""

    columns: Array  # Shape (window, channel, column).
    right: Array  # Shape (window, channel, draw).
    parts: list[slice | BoolArray]  # Windows of each block.

    def products(self, first: Array, second: Array) -> Array:
        """Multiply columns, shape (window, channel, column), over each block: shape (block, first, second column)."""
        pairs = ((first[rows], second[rows]) for rows in self.parts)
        return np.array([x.reshape(-1, x.shape[2]).T @ y.reshape(-1, y.shape[2]) for x, y in pairs])

    def by_channel(self, first: Array, second: Array) -> Array:
        """Multiply as `products`, over each channel alone, shape (block, channel, column, column)."""
        pairs = ((first[rows].swapaxes(0, 1), second[rows].swapaxes(0, 1)) for rows in self.parts)
        return np.array([x.swapaxes(1, 2) @ y for x, y in pairs])

    @cached_property
    def squares(self) -> Array:
        """Sums of squares of the right side, shape (block, channel, draw)."""
        return np.array([(self.right[rows] ** 2).sum(axis=0) for rows in self.parts])


@dataclass(frozen=True)
class Folds:
    """Normal equations of each block."""

    gram: Array  # Shape (block, column, column).
    moment: Array  # Shape (block, column, draw): columns times right side; several right sides are draws.
    square: Array  # Shape (block, draw): sums of squares of the right side.
    # Shape (column,): information that bounds give before any data: one over the square of the largest possible
    # coefficient.
    prior: Array
    made_of: BlockRows

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return len(self.gram)

    def solve(self, columns: IntArray) -> tuple[Array, Array]:
        """Fit a subset of columns without each block and evaluate it on that block.

        Result `coefficients`: shape (block, column, draw).
        Result `error`, shape (block, draw): sum of squares left on the block that the fit did not see.
        """
        gram, moment = self.gram[:, columns[:, None], columns], self.moment[:, columns]
        coefficients = _solve(gram.sum(axis=0) - gram + self._known(columns), moment.sum(axis=0) - moment)
        return coefficients, self._left(gram, moment, coefficients)

    def fit(self, columns: IntArray) -> tuple[Array, Array]:
        """Fit a subset of columns on all blocks.

        Result `coefficients`: shape (column, draw); Result `error`: shape (block, draw).
        """
        gram, moment = self.gram[:, columns[:, None], columns], self.moment[:, columns]
        coefficients = _solve(gram.sum(axis=0) + self._known(columns), moment.sum(axis=0))
        return coefficients, self._left(gram, moment, coefficients[None])

    def _known(self, columns: IntArray) -> Array:
        return np.diag(self.prior[columns])

    def _left(self, gram: Array, moment: Array, coefficients: Array) -> Array:
        explained = np.einsum(
            "bcd,bcd->bd", 2 * moment - gram @ coefficients, np.broadcast_to(coefficients, moment.shape)
        )
        return np.asarray(self.square - explained)

    def conditional_on(self, base: IntArray) -> "ConditionalNormalEquations":
        """Fit a base, so that a fit of it with a few columns more costs no more than those columns."""
        gram, moment = self.gram, self.moment
        # After the blocks comes the fit on all of them, judged on all of them.
        whole = gram.sum(axis=0, keepdims=True), moment.sum(axis=0, keepdims=True)
        seen, right = (np.concatenate([w - own, w]) for w, own in zip(whole, (gram, moment), strict=True))
        own, own_right = (np.concatenate([own, w]) for w, own in zip(whole, (gram, moment), strict=True))
        square = np.concatenate([self.square, self.square.sum(axis=0, keepdims=True)])
        across, inner, inner_right = seen[:, base], own[:, base], own_right[:, base]
        solved = _solve(across[:, :, base] + self._known(base), np.concatenate([across, right[:, base]], axis=2))
        shadow, fitted = solved[..., : seen.shape[2]], solved[..., seen.shape[2] :]
        turned, rest = shadow.swapaxes(1, 2), inner - inner[:, :, base] @ shadow
        missed = inner_right - inner[:, :, base] @ fitted
        return ConditionalNormalEquations(
            normal=self,
            base=base,
            gram=seen - across.swapaxes(1, 2) @ shadow,
            moment=right - across.swapaxes(1, 2) @ fitted,
            length=np.sqrt(np.diagonal(seen, axis1=1, axis2=2) + self.prior),
            own=own - turned @ inner - rest.swapaxes(1, 2) @ shadow,
            own_moment=own_right - inner.swapaxes(1, 2) @ fitted - turned @ missed,
            left=square - np.einsum("bcd,bcd->bd", inner_right + missed, fitted),
        )


@dataclass(frozen=True)
class ConditionalNormalEquations:
    """Normal equations of what a base leaves, by the Schur complement of the base; behind the blocks those of all."""

    normal: Folds
    base: IntArray
    # Shape (block + 1, column, column): of columns without what the base explains of them, over the blocks that a fit
    # sees.
    gram: Array
    moment: Array  # Shape (block + 1, column, draw).
    length: Array  # Shape (block + 1, column): of whole columns.
    own: Array  # As `gram`, on the block that a fit does not see, or on all blocks.
    own_moment: Array  # As `moment`, alike.
    left: Array  # Shape (block + 1, draw): sum of squares that the base leaves there.

    @property
    def before(self) -> Array:
        """What the base leaves of each block that its fit did not see, shape (block, draw)."""
        return self.left[:-1]

    def unseen(self, columns: IntArray) -> Array:
        """Compute what base and columns leave of each block that their fit did not see, shape (block, draw)."""
        return self._fit(columns, slice(0, -1))[1]

    def fit(self, columns: IntArray) -> tuple[Array, Array]:
        """Fit base and columns on all blocks to the first right side.

        Result `coefficients`: shape (column,).
        Result `errors`, shape (column,): standard errors as if rows were independent.
        """
        coefficients, left = self._fit(columns, slice(-1, None))
        gram, length = self._part(columns, slice(-1, None))
        variance = np.diagonal(_solve(gram, np.eye(len(columns)), length)[0])
        scale = max(float(left[0, 0]) / self.normal.made_of.right[..., 0].size, 1.0)
        return coefficients[0, :, 0], np.asarray(np.sqrt(np.maximum(variance, 0.0) * scale))

    def subtracted(self, column: int, weight: Array) -> Array:
        """Subtract a column with coefficient 1 from the right side, weigh the channels and fit the base anew.

        `weight`, shape (channel,): on the rows.
        Result: shape (block, draw); left of each block that the fit did not see.
        """
        if (weight == 1.0).all():
            own = self.own[:-1, column, column, None]
            return np.asarray(self.before - 2 * self.own_moment[:-1, column] + own)
        rows, base, power = self.normal.made_of, self.base, weight**2
        taken = rows.columns[..., [column]]
        weighed = power[:, None] * taken
        known, grams, moments = self._by_channel
        gram = (power @ grams).reshape(-1, len(base), len(base))
        moment = (power @ moments).reshape(len(gram), len(base), -1) - rows.products(known, weighed)
        own = rows.products(weighed, taken) - 2 * rows.products(weighed, rows.right)
        found = Folds(gram, moment, power @ rows.squares + own[:, 0], self.normal.prior[base], rows)
        return found.solve(np.arange(len(base)))[1]

    @cached_property
    def _by_channel(self) -> tuple[Array, Array, Array]:
        """Columns of the base; their grams and moments, flat behind the channel."""
        rows = self.normal.made_of
        known = rows.columns[..., self.base]
        grams, moments = rows.by_channel(known, known), rows.by_channel(known, rows.right)
        return known, grams.reshape(*grams.shape[:2], -1), moments.reshape(*moments.shape[:2], -1)

    def _fit(self, columns: IntArray, where: slice) -> tuple[Array, Array]:
        gram, length = self._part(columns, where)
        coefficients = _solve(gram, self.moment[where, columns], length)
        own, moment = self.own[where, columns[:, None], columns], self.own_moment[where, columns]
        explained = np.einsum("bcd,bcd->bd", 2 * moment - own @ coefficients, coefficients)
        return coefficients, np.asarray(self.left[where] - explained)

    def _part(self, columns: IntArray, where: slice) -> tuple[Array, Array]:
        gram = self.gram[where, columns[:, None], columns] + np.diag(self.normal.prior[columns])
        return gram, self.length[where, columns]


def folds(columns: Array, right: Array, block: IntArray, prior: Array | None = None) -> Folds:
    """Build the normal equations of each block.

    `columns`, shape (window, channel, column): weighted.
    `right`, shape (window, channel) or (window, channel, draw): weighted.
    `block`: shape (window,).
    `prior`, shape (column,): None for nothing known.
    """
    parts = [marked_rows(block == number) for number in range(int(block.max()) + 1)]
    rows = BlockRows(columns, right.reshape(*right.shape[:2], -1), parts)
    return Folds(
        rows.products(columns, columns),
        rows.products(columns, rows.right),
        rows.squares.sum(axis=1),
        np.zeros(columns.shape[2]) if prior is None else prior,
        rows,
    )


def marked_rows(marked: BoolArray) -> slice | BoolArray:
    """Say which rows are marked, as a slice where they are neighbours: nothing is copied then."""
    rows = np.flatnonzero(marked)
    neighbours = len(rows) > 0 and rows[-1] - rows[0] + 1 == len(rows)
    return slice(rows[0], rows[-1] + 1) if neighbours else marked


def blocks_of(flight_index: IntArray, centres: Array, block_s: float) -> IntArray:
    """Cut flights into contiguous blocks of about equal length.

    `flight_index`: shape (window,).
    `centres`, shape (window,), s: middle of each window in its own flight.
    `block_s`: wanted length; longer where there would be too many.
    Result: shape (window,); blocks from 0, without gaps.
    """
    spans = [np.ptp(centres[flight_index == f]) for f in np.unique(flight_index)]
    length = max(block_s, sum(spans) / MOST_BLOCKS)
    block = np.zeros(len(centres), dtype=int)
    first = 0
    for flight, span in zip(np.unique(flight_index), spans, strict=True):
        in_flight = flight_index == flight
        number = max(1, round(span / length))
        block[in_flight] = first + contiguous(int(in_flight.sum()), number)
        first += number
    return block


def _solve(gram: Array, moment: Array, length: Array | None = None) -> Array:
    """Solve normal equations with columns brought to one length; a column of zeros gets the coefficient 0."""
    if length is None:
        length = np.sqrt(np.diagonal(gram, axis1=-2, axis2=-1))
    scale = 1.0 / np.where(length > 0, length, 1.0)
    scaled = gram * scale[..., :, None] * scale[..., None, :] + _RIDGE * np.eye(gram.shape[-1])
    scaled += (length <= 0)[..., None] * np.eye(gram.shape[-1])
    # Of few columns and hundreds of right sides, which products take in a tenth of the time; one more step for those
    # that hardly differ.
    inverse, right = np.linalg.inv(scaled), moment * scale[..., None]
    found = inverse @ right
    return np.asarray((found + inverse @ (right - scaled @ found)) * scale[..., None])


def about_flight_mean(values: Array, flight_index: IntArray) -> Array:
    """Subtract from values, shape (window, ...), the mean over each flight, by the flight of each window."""
    flights, number = np.unique(flight_index, return_inverse=True)
    return np.asarray(values - np.array([values[number == f].mean(axis=0) for f in range(len(flights))])[number])


def mirror_shifted(residual: Array, flight_index: IntArray, shifts: int, rng: np.random.Generator) -> Array:
    """Draw circular shifts of the residual of each flight joined with its mirror image, with random signs.

    A plain circle joins the end of a flight to its start. Slow residuals jump there and slow signals do not, so chance
    explains less of the shifted residual than of a residual without any cause: with neighbouring windows correlated
    by 0.9, a test at 5 % is then wrong in 8 to 10 % of the cases. The mirrored circle has no seam.

    `residual`: shape (window, channel).
    `flight_index`: shape (window,).
    Result: shape (window, channel, shift); about the mean of each flight.
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


FEWEST_SAMPLES = 8  # Of a window: fewer do not follow its curve.
FEWEST_WINDOWS = 16  # Windows below which a flight is too short.
_SAME_RATE = 1e-3  # Relative difference of sampling periods that clocks of one logger have, and that no floor shows.
_WHOLE = (slice(None),)


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows ``phi(s) = sin(pi s)^4``, scaled to integral 1 and repeated at a hop."""

    weight: Array  # Shape (window,): phi dt.
    slope: Array  # Shape (window,), 1/s: phi' dt.
    hop: int  # Samples from one window to the next.
    period: float  # Sampling period, s.

    def count(self, samples: int) -> int:
        """Count the windows that fit into a flight."""
        return max(0, (samples - len(self.weight)) // self.hop + 1)

    def centres(self, time: Array) -> Array:
        """Compute the middle of each window, shape (window,), s, of a flight by its time, shape (time,), s."""
        first = time[0] + 0.5 * (len(self.weight) - 1) * self.period
        return np.asarray(first + np.arange(self.count(len(time))) * self.hop * self.period)

    def average(self, values: Array, stretches: Iterable[slice] = _WHOLE) -> Array:
        """Average values, shape (time, ...), over windows of each stretch, ``int phi x dt``, shape (window, ...)."""
        return self._over(values, self.weight, stretches)

    def derivative(self, values: Array, stretches: Iterable[slice] = _WHOLE) -> Array:
        """Average the time derivative as `average` does, ``-int phi' x dt``; nothing is differentiated."""
        return -self._over(values, self.slope, stretches)

    def balance(self, direct: Array, momentum: Array | None = None, stretches: Sequence[slice] = _WHOLE) -> Array:
        """Average ``direct + d/dt momentum``, shapes (time, ...), as `average` does, shape (window, ...)."""
        averaged = self.average(direct, stretches)
        return averaged if momentum is None else averaged + self.derivative(momentum, stretches)

    def _over(self, values: Array, kernel: Numbers, stretches: Iterable[slice]) -> Array:
        if stretches is _WHOLE:
            return np.asarray(self.laid(values, kernel))
        return np.concatenate([self.laid(values[part], kernel) for part in (slice(0), *stretches)])

    def middles(self, stretches: Iterable[slice]) -> IntArray:
        """Give the sample in the middle of each window of these stretches, shape (window,)."""
        half = len(self.weight) // 2
        counts = ((part.start + half, self.count(part.stop - part.start)) for part in stretches)
        return np.concatenate([first + self.hop * np.arange(count) for first, count in counts])

    def modulated(self, frequency: float | Array) -> Self:
        """Shift windows to a frequency, Hz: ``phi(t) exp(-2 pi i f t)``, complex.

        Of several frequencies weight and slope have shape (sample, frequency).
        """
        turn = 2j * np.pi * np.asarray(frequency)
        phase = np.exp(-self.period * np.multiply.outer(turn, np.arange(len(self.weight))))
        slope = self.slope - np.multiply.outer(turn, self.weight)
        return replace(self, weight=(self.weight * phase).T, slope=(slope * phase).T)

    def alternating(self) -> Self:
        """Turn the sign of every other sample: white noise stays as large as it was, and what is smooth vanishes."""
        sign = 1.0 - 2.0 * (np.arange(len(self.weight)) % 2)
        return replace(self, weight=sign * self.weight, slope=sign * self.slope)

    def less(self, longer: Self) -> Self:
        """Take what windows twice as long or longer see, with the same middle, from what these see: a band is left."""
        weight, slope = -longer.weight, -longer.slope
        first = (len(weight) - len(self.weight)) // 2
        inside = slice(first, first + len(self.weight))
        weight[inside] += self.weight
        slope[inside] += self.slope
        return replace(self, weight=weight, slope=slope)

    def laid(self, values: Array, kernel: Numbers) -> Any:
        """Lay a kernel of the windows' length, or several, over values, shape (window, ..., kernel)."""
        if len(values) < len(kernel):
            return np.zeros((0, *values.shape[1:], *kernel.shape[1:]))
        views = sliding_window_view(values, len(kernel), axis=0)[:: self.hop]
        return views @ kernel


@lru_cache(maxsize=64)
def windows(period: float, window_s: float, overlap: float) -> Windows:
    """Make windows of a length for a sampling period.

    `period`: s.
    `window_s`: length, s.
    `overlap`: share that neighbours have in common.
    Raises InputError if a window holds too few samples.
    Reference: Weak form of differential equations: Shinbrot 1957 (modulating functions); Messenger and Bortz 2021.
    """
    samples = round(window_s / period)
    if samples < FEWEST_SAMPLES:
        raise InputError(
            f"gap.window_s = {window_s:g}: holds {samples} samples at {1 / period:.4g} Hz; at least {FEWEST_SAMPLES}"
        )
    phase = np.pi * (np.arange(samples) + 0.5) / samples
    shape = np.sin(phase) ** 4
    slope = np.sin(phase) ** 3 * np.cos(phase)
    # The derivative of time is 1, which eight samples of the window's own slope miss by 0.2 percent.
    slope /= -(slope @ np.arange(samples)) * period
    return Windows(shape / shape.sum(), slope, max(1, round(samples * (1 - overlap))), period)


class WindowSettings(Protocol):
    """Length of windows in s, and the share that neighbours have in common."""

    @property
    def window_s(self) -> float:
        """Length, s."""

    @property
    def overlap(self) -> float:
        """Share that neighbours have in common."""


def fitting_windows(period: float, settings: WindowSettings) -> Windows:
    """Make windows as long as asked for, or as long as a slow log needs."""
    return windows(period, max(settings.window_s, FEWEST_SAMPLES * period), settings.overlap)


def common_windows(flights: Sequence[Signals], settings: WindowSettings) -> Windows:
    """Make the windows that all flights share.

    Raises InputError if a flight is too short or has another sampling period than the first.
    """
    period = flights[0].period
    for flight in flights:
        other = flight.period
        if abs(other - period) > _SAME_RATE * period:
            raise InputError(
                f"{flight.name}: sampled at {1 / other:.6g} Hz, {flights[0].name} at {1 / period:.6g} Hz; set "
                "import.rate_hz to one rate for all flights"
            )
    shortest = min(flights, key=len)
    span_s = max(flight.rotor_span_s for flight in flights)
    window_s = max(settings.window_s, FEWEST_SAMPLES * span_s)
    length = f"gap.window_s = {window_s:g}"
    if window_s > settings.window_s:
        length = f"{window_s:.3g} s, {FEWEST_SAMPLES} updates of rotors that are logged every {span_s:.2g} s"
    if window_s > len(shortest) * period:
        raise InputError(f"{length}: longer than {shortest.name}, {len(shortest) * period:.3g} s")
    shared = windows(period, window_s, settings.overlap)
    for flight in flights:
        if shared.count(len(flight)) < FEWEST_WINDOWS:
            raise InputError(
                f"{flight.name}: {len(flight) * period:.3g} s are too short; {FEWEST_WINDOWS} windows of {length} are"
                " needed"
            )
    return shared
