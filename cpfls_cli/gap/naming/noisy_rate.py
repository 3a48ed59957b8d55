"""Numbers of an effect that filters the measured rate, where the gyroscope's noise passes its filter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cpfls_cli.arrays import Array
from cpfls_cli.blocks import FEWEST_BLOCKS, MOST_BLOCKS, contiguous
from cpfls_cli.effects.signals import white_noise
from cpfls_cli.gap.balance.balance_system import residual_along
from cpfls_cli.gap.naming.estimate import NamedFit, estimates_of, places_of
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.rounding import tied
from cpfls_cli.weak_form.windows import FEWEST_SAMPLES, windows


def with_noisy_rate(found: NamedFit) -> NamedFit:
    """Estimate the numbers of an effect that filters the measured rate with noise in rate and torque.

    Where its filter resonates it amplifies the gyroscope's noise in its own column, by which least squares make its
    numbers too small. By maximum likelihood each frequency of the torque about each axis counts by the variance that
    both noises have in it, which depends on the numbers themselves: of the sum of ``|r|^2 / (|g - c F|^2 w^2 s_rate^2 +
    s_torque^2)`` the least is sought, with the filter F, its coefficients c, and the gains g of the inertia, which are
    free. Noise is taken for white, as the signals' third differences show it. Other effects stay as they are, and all
    do in gusts, which are no noise of a sensor, in flights too short for an error, and where a coefficient ends as
    large as it may be: another valley is deeper there.

    Reference: Pintelon and Schoukens 2012, System Identification, chapter 9 (errors in variables, noise known).
    """
    hypothesis, linear = found.hypothesis, found.estimates.linear
    index = next((at for at, each in enumerate(hypothesis.chosen) if each.effect.filters is not None), None)
    if index is None or hypothesis.gusty.any():
        return found
    balance = _Balance(found, index)
    if balance.blocks < FEWEST_BLOCKS or not ((balance.rate > 0) & (balance.torque > 0)).all():
        return found
    number, without = balance.fitted()
    most = np.array([each.bounds(balance.vehicle)[1] for each in balance.effect.coefficients])
    if tied(number[: len(most)], most).any():
        return found
    own, shapes = places_of(hypothesis)[index]
    places = np.r_[own, shapes]
    values, left_out = found.values, np.tile(found.values, (len(without), 1))
    values[places], left_out[:, places] = number, without
    moved = hypothesis.with_shapes(values[len(linear) :])
    new = estimates_of(moved, values, left_out)
    effects = [*found.estimates.effects]
    effects[index] = balance.open_ends(new.effects[index])
    kept = replace(new, effects=tuple(effects), parameters=found.estimates.parameters)
    return found._replace(hypothesis=moved, estimates=kept)


class _Balance:
    """The torque of all flights over long windows by frequency, and what noise does to it.

    `rest`, `inertial`, shape (window, frequency, 3), N m: residual without the effect, inertial torque of the config.
    `rate`, `torque`, shape (3,), N m s and N m: standard deviations of the noise of a sample of momentum and torque.
    `blocks`: of time, 0 where flights are too short for these windows or logged too slowly for their frequencies.
    """

    def __init__(self, found: NamedFit, index: int) -> None:
        hypothesis = found.hypothesis
        self.effect = hypothesis.chosen[index].effect
        self.period = hypothesis.flights[0].signals.period
        linear = found.estimates.linear.copy()
        linear[places_of(hypothesis)[index][0]] = 0.0
        self.blocks = 0
        # As long as a block, their spectrum is about as narrow as the resonance of lightly damped springs.
        longest = max(len(flight.signals) for flight in hypothesis.flights) * self.period
        seconds = min(found.settings.block_s, longest / 4)
        if seconds < FEWEST_SAMPLES * self.period:
            return
        own = windows(self.period, seconds, found.settings.overlap)
        used = [number for number, flight in enumerate(hypothesis.flights) if own.count(len(flight.signals)) > 1]
        samples, size = len(own.weight), np.sqrt((own.weight**2).sum())
        # Beyond the highest frequency that the effect may have, as far as the log goes.
        ends = [
            1.5 * self.effect.shapes[0].grid[-1],
            0.5 / self.period,
            *(f.cut_off[:3].min() for f in hypothesis.flights),
        ]
        highest = int(min(ends) * samples * self.period)
        if highest < FEWEST_SAMPLES:
            return
        at = own.modulated(np.arange(1, highest) / (samples * self.period))
        self.hop, self.average, self.differentiate = own.hop, at.weight / size, -at.slope / size
        power, fine = np.abs(np.fft.fft(self.average, 4 * samples, axis=0)).T ** 2, np.fft.fftfreq(4 * samples)
        near = np.abs(fine) < (highest + 3) / samples
        self.share = power[:, near] / power.sum(axis=1, keepdims=True)
        self.turn = 2j * np.pi * fine[near]
        along = [residual_along(hypothesis, number, linear) for number in used]
        self.vehicle = hypothesis.vehicle
        moments = np.array(hypothesis.vehicle.inertia_kg_m2[:3])
        self.momenta = [hypothesis.signals[number].body_rate * moments for number in used]
        turned = [each.momentum for each in along if each.momentum is not None]
        self.rest = self._rows([each.direct for each in along], self.average) + self._rows(turned, self.differentiate)
        self.inertial = self._rows(self.momenta, self.differentiate)
        self.rate, self.torque = (
            np.sqrt(np.mean([white_noise(each[:, :3]) ** 2 for each in signals], axis=0))
            for signals in (self.momenta, [each.direct for each in along])
        )
        self.blocks = min(MOST_BLOCKS, len(self.rest) // 4)

    def _rows(self, signals: list[Array], kernel: Array) -> Array:
        views = (sliding_window_view(each[:, :3], len(kernel), axis=0)[:: self.hop] for each in signals)
        return np.concatenate([(view @ kernel).swapaxes(1, 2) for view in views])

    def _column(self, shapes: Array) -> tuple[Array, Array]:
        """Compute the column at shapes, shape (window, frequency, 3), and the gain of its filter, shape (fine,)."""
        named = {each.name: float(value) for each, value in zip(self.effect.shapes, shapes, strict=True)}
        assert self.effect.filters is not None, "asked for"
        passing = self.effect.filters(named, self.period)
        column = self._rows([passing.along(each) for each in self.momenta], self.differentiate)
        return column, passing.gain(np.exp(-self.turn))

    def _products(self, columns: Sequence[Array]) -> Array:
        """Multiply torque of the rest, inertial torque and columns, shape (window, frequency, 3, side, side)."""
        every = np.stack([self.rest - self.inertial, self.inertial, *columns], axis=-1)
        return np.asarray((every.conj()[..., None] * every[..., None, :]).real)

    def _misfit(self, number: Array, products: Array, gains: Array) -> float:
        """Give twice the negative logarithm of the likelihood of a window, but for what is constant."""
        coefficient, gain, along = number[:3], number[3:6], np.array([1.0, *number[6:]])
        sides = np.column_stack([np.ones(3), gain, -np.outer(coefficient, along)])
        square = ((products @ sides[:, :, None])[..., 0] * sides).sum(axis=2)
        through = np.abs((gain - np.outer(along @ gains, coefficient)) * self.turn[:, None] / self.period) ** 2
        return float((square / (self.share @ through * self.rate**2 + self.torque**2)).sum())

    def _least(
        self, products: Array, gains: Array, start: Array, bounds: Sequence[tuple[float, float]]
    ) -> tuple[float, Array]:
        """Find coefficients, gains of the inertia and, within bounds, changes of the shapes with the least misfit."""
        from scipy.optimize import minimize

        known = [each.bounds(self.vehicle) for each in self.effect.coefficients]
        every = [*known, *[(0.1, 10.0)] * 3, *bounds]
        done = minimize(self._misfit, start, args=(products, gains), method="L-BFGS-B", bounds=every)
        return float(done.fun), done.x

    def fitted(self) -> tuple[Array, Array]:
        """Estimate coefficients and shapes, shape (number,), and without each block of time, (block, number)."""
        from scipy.optimize import minimize

        bounds = [each.bounds(self.vehicle) for each in self.effect.shapes]
        start = np.array([0.3] * 3 + [1.0] * 3)

        def profile(shapes: Array) -> float:
            column, gain = self._column(shapes)
            return self._least(self._products([column]).mean(axis=0), gain[None], start, [])[0]

        # Over the frequency there are several valleys.
        grid = [
            min((np.array([f, d]) for d in self.effect.shapes[1].grid[:2]), key=profile)
            for f in self.effect.shapes[0].grid
        ]
        starts = sorted(grid, key=profile)[:3]
        ends = [
            minimize(profile, each, method="Nelder-Mead", bounds=bounds, options={"xatol": 2e-3, "fatol": 1e-3})
            for each in starts
        ]
        shapes = min(ends, key=lambda end: end.fun).x
        # Within the width of the resonance column and gain are taken to be linear in the shapes, both alike: else the
        # noise in the column would be more than what its gain says.
        step = np.array([shapes[0], 0.5]) * shapes[1]
        sides = [self._column(shapes)]
        for by in np.diag(step / 10):
            ahead, behind = self._column(shapes + by), self._column(shapes - by)
            sides.append(tuple((a - b) / (2 * by.sum()) for a, b in zip(ahead, behind, strict=True)))
        columns, gains = zip(*sides, strict=True)
        products, gain = self._products(columns), np.array(gains)
        block = contiguous(len(products), self.blocks)
        sums = np.array([products[block == number].sum(axis=0) for number in np.unique(block)])
        low, high = np.array(bounds).T - shapes
        within = list(zip(np.maximum(-step, low), np.minimum(step, high), strict=True))
        whole = sums.sum(axis=0)
        best = self._least(whole / len(block), gain, np.append(start, 0.0 * step), within)[1]
        without = [
            self._least((whole - own) / (len(block) - count), gain, best, within)[1]
            for own, count in zip(sums, np.bincount(block), strict=True)
        ]
        exact = self._least(whole[..., :3, :3] / len(block), gain[:1], start, [])[1]
        number = np.append(exact[:3], shapes)
        return number, number + (np.array(without) - best)[:, [0, 1, 2, 6, 7]]

    def open_ends(self, numbers: Sequence[Estimate]) -> tuple[Estimate, ...]:
        """Widen the interval of a shape on a bound to the next point of its grid: nothing else identifies it there."""
        ends = {s.name: ((s.grid[0], s.grid[1]), (s.grid[-1], s.grid[-2])) for s in self.effect.shapes}
        for name, (bound, inside) in ((name, end) for name, both in ends.items() for end in both):
            numbers = [
                replace(n, low=min(n.low, inside), high=max(n.high, inside))
                if n.name == name and tied(np.array(n.value), np.array(bound))
                else n
                for n in numbers
            ]
        return tuple(numbers)
