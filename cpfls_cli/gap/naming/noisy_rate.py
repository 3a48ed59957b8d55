"""Numbers of an effect that filters the measured rate, where the gyroscope's noise passes its filter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cpfls_cli.arrays import Array
from cpfls_cli.blocks import MOST_BLOCKS, contiguous
from cpfls_cli.effects.signals import white_noise
from cpfls_cli.filters import SecondOrder
from cpfls_cli.gap.balance.balance_system import residual_along
from cpfls_cli.gap.balance.noise_floor import modulated
from cpfls_cli.gap.naming.estimate import NamedFit, estimates_of, places_of
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.rounding import tied
from cpfls_cli.weak_form.windows import windows

_WINDOW_S = 4.0
"""Of windows whose spectrum is about as narrow as the resonance of springs."""


def with_noisy_rate(found: NamedFit) -> NamedFit:
    """Estimate the numbers of an effect that filters the measured rate with noise in rate and torque.

    Where its filter resonates it amplifies the gyroscope's noise in its own column, by which least squares make its
    numbers too small. By maximum likelihood each frequency of the torque about each axis counts by the variance that
    both noises have in it, which depends on the numbers themselves: of the sum of ``|r|^2 / (|g - c F|^2 w^2 s_rate^2 +
    s_torque^2)`` the least is sought, with the filter F, its coefficients c, and the gains g of the inertia, which are
    free. Noise is taken for white, as the signals' third differences show it. Other effects stay as they are, and all
    do in gusts, which are no noise of a sensor.

    Reference: Pintelon and Schoukens 2012, System Identification, chapter 9 (errors in variables, noise known).
    """
    hypothesis, linear = found.hypothesis, found.estimates.linear
    index = next((at for at, each in enumerate(hypothesis.chosen) if each.effect.filters is not None), None)
    if index is None or hypothesis.gusty.any():
        return found
    balance = _Balance(found, index)
    if not ((balance.rate > 0) & (balance.torque > 0)).all():
        return found
    number, without = balance.fitted()
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
    """

    def __init__(self, found: NamedFit, index: int) -> None:
        hypothesis = found.hypothesis
        self.effect = hypothesis.chosen[index].effect
        self.period = hypothesis.flights[0].signals.period
        linear = found.estimates.linear.copy()
        linear[places_of(hypothesis)[index][0]] = 0.0
        shortest = min(len(flight.signals) for flight in hypothesis.flights)
        own = windows(self.period, min(_WINDOW_S, shortest * self.period / 4), found.settings.overlap)
        samples, size = len(own.weight), np.sqrt((own.weight**2).sum())
        # Beyond the highest frequency that the effect may have, as far as the log goes.
        ends = [
            1.5 * self.effect.shapes[0].grid[-1],
            0.5 / self.period,
            *(f.cut_off[:3].min() for f in hypothesis.flights),
        ]
        highest = int(min(ends) * samples * self.period)
        at = [modulated(own, cycles / (samples * self.period)) for cycles in range(1, highest)]
        self.hop, self.average = own.hop, np.stack([each.weight for each in at], axis=1) / size
        self.differentiate = -np.stack([each.slope for each in at], axis=1) / size
        power, fine = np.abs(np.fft.fft(self.average, 4 * samples, axis=0)).T ** 2, np.fft.fftfreq(4 * samples)
        near = np.abs(fine) < (highest + 3) / samples
        self.share = power[:, near] / power.sum(axis=1, keepdims=True)
        self.turn = 2j * np.pi * fine[near]
        along = [residual_along(hypothesis, number, linear) for number in range(len(hypothesis.flights))]
        self.vehicle = hypothesis.vehicle
        moments = np.array(hypothesis.vehicle.inertia_kg_m2[:3])
        self.momenta = [signals.body_rate * moments for signals in hypothesis.signals]
        turned = [each.momentum for each in along if each.momentum is not None]
        self.rest = self._rows([each.direct for each in along], self.average) + self._rows(turned, self.differentiate)
        self.inertial = self._rows(self.momenta, self.differentiate)
        self.rate, self.torque = (
            np.sqrt(np.mean([white_noise(each[:, :3]) ** 2 for each in signals], axis=0))
            for signals in (self.momenta, [each.direct for each in along])
        )

    def _rows(self, signals: list[Array], kernel: Array) -> Array:
        views = (sliding_window_view(each[:, :3], len(kernel), axis=0)[:: self.hop] for each in signals)
        return np.concatenate([(view @ kernel).swapaxes(1, 2) for view in views])

    def _column(self, shapes: Array) -> Array:
        passing = self._filter(shapes)
        return self._rows([passing.along(each) for each in self.momenta], self.differentiate)

    def _filter(self, shapes: Array) -> SecondOrder:
        named = {each.name: float(value) for each, value in zip(self.effect.shapes, shapes, strict=True)}
        assert self.effect.filters is not None, "asked for"
        return self.effect.filters(named, self.period)

    def _products(self, columns: Sequence[Array]) -> Array:
        """Multiply torque of the rest, inertial torque and columns, shape (window, frequency, 3, side, side)."""
        every = np.stack([self.rest - self.inertial, self.inertial, *columns], axis=-1)
        return np.asarray((every.conj()[..., None] * every[..., None, :]).real)

    def _misfit(self, number: Array, products: Array, at: Array) -> float:
        """Give twice the negative logarithm of the likelihood of a window, but for what is constant."""
        coefficient, gain, away = number[:3], number[3:6], number[6:]
        sides = np.stack([np.ones(3), gain, -coefficient, *(-coefficient * each for each in away)], axis=1)
        square = ((products @ sides[:, :, None])[..., 0] * sides).sum(axis=2)
        passes = self._filter(at + away if len(away) else at).gain(self.turn)
        through = np.abs((gain - coefficient * passes[:, None]) * self.turn[:, None] / self.period) ** 2
        return float((square / (self.share @ through * self.rate**2 + self.torque**2)).sum())

    def _least(
        self, products: Array, at: Array, start: Array, bounds: Sequence[tuple[float, float]]
    ) -> tuple[float, Array]:
        """Find coefficients, gains and, within bounds, changes of the shapes with the least misfit."""
        from scipy.optimize import minimize

        known = [each.bounds(self.vehicle) for each in self.effect.coefficients]
        first = np.concatenate([start, np.zeros(len(bounds))])
        every = [*known, *[(0.1, 10.0)] * 3, *bounds]
        done = minimize(self._misfit, first, args=(products, at), method="L-BFGS-B", bounds=every)
        return float(done.fun), done.x

    def fitted(self) -> tuple[Array, Array]:
        """Estimate coefficients and shapes, shape (number,), and without each block of time, (block, number)."""
        from scipy.optimize import minimize

        bounds = [each.bounds(self.vehicle) for each in self.effect.shapes]
        start = np.array([0.3] * 3 + [1.0] * 3)

        def profile(shapes: Array) -> float:
            return self._least(self._products([self._column(shapes)]).mean(axis=0), shapes, start, [])[0]

        grid = [np.array([f, d]) for f in self.effect.shapes[0].grid for d in self.effect.shapes[1].grid[:2]]
        shapes = minimize(
            profile, min(grid, key=profile), method="Nelder-Mead", bounds=bounds, options={"xatol": 2e-3, "fatol": 1e-2}
        ).x
        # Half the width of a resonance: less bends it little, and more is not looked at.
        step = np.array([0.1, 0.3]) * shapes
        near = np.diag(step / 10)
        apart = [(self._column(shapes + each) - self._column(shapes - each)) / (2 * each.sum()) for each in near]
        products = self._products([self._column(shapes), *apart])
        block = contiguous(len(products), min(MOST_BLOCKS, len(products) // 4))
        sums = np.array([products[block == number].sum(axis=0) for number in np.unique(block)])
        low, high = np.array(bounds).T - shapes
        within = list(zip(np.maximum(-step, low), np.minimum(step, high), strict=True))
        counts = np.bincount(block)
        best = self._least(sums.sum(axis=0) / len(block), shapes, start, within)[1]
        without = [
            self._least((sums.sum(axis=0) - own) / (len(block) - count), shapes, best[:6], within)[1]
            for own, count in zip(sums, counts, strict=True)
        ]
        every = np.array([best, *without])
        number = np.column_stack([every[:, :3], shapes + every[:, 6:]])
        return number[0], number[1:]

    def open_ends(self, numbers: Sequence[Estimate]) -> tuple[Estimate, ...]:
        """Widen the interval of a shape on a bound to the next point of its grid: nothing else identifies it there."""
        ends = {s.name: ((s.grid[0], s.grid[1]), (s.grid[-1], s.grid[-2])) for s in self.effect.shapes}
        for name, (bound, beside) in ((name, end) for name, both in ends.items() for end in both):
            numbers = [
                replace(n, low=min(n.low, beside), high=max(n.high, beside))
                if n.name == name and tied(np.array(n.value), np.array(bound))
                else n
                for n in numbers
            ]
        return tuple(numbers)
