"""Fit of the observer by which a forecast uses the past: its few numbers, by the loss of free runs over the horizon.

The forecast itself is what it is. What pushes a run is linear in what its model misses of the steps before, so the
derivatives of that enter the compiled sums over runs as those of further weights.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.blocks import mean_error
from cpfls_cli.gauss_newton import minimised
from cpfls_cli.playback.evaluation import Evaluated
from cpfls_cli.playback.fit import Believed, FitPoint, Fitted, FittedNumbers, FitWindows, weighed, windows_of
from cpfls_cli.playback.flight import PlaybackFlight, motion_at
from cpfls_cli.playback.history import Observer, missed_wrench, past_of
from cpfls_cli.playback.judging import block_errors, parts_of
from cpfls_cli.playback.kernels import Parameters, errors_of_runs, sensitivities
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.playback.structure import Judged

_AXES = np.array([0, 0, 1, 2, 2, 3])
"""Which numbers an axis of torque and force has: roll and pitch share theirs, so do ahead and left."""

_RATES, _MEMORIES = (10.0, 30.0, 90.0), (0.05, 0.15, 0.5)
"""Rates in 1/s and memories in s of all axes that are looked at first: of far ones the fit may end in flat ground."""

_FIRST = np.log([[_RATES[1], _MEMORIES[1]]] * 4)
"""What is believed of both, as logarithms, shape (4, 2)."""

_BOUNDS = np.log([[0.1, 0.005], [300.0, 5.0]])
_SPREAD = 2.0
"""Bounds of these logarithms, and the standard deviation of what is believed of them."""

_STEP = 1e-4
"""Of forward differences by them."""

_CHUNK = 250
"""Windows at a time, each with weights of its own."""

_STEPS, _TOLERANCE, _DAMPING = 25, 1e-4, 10.0
"""Of the fit: it begins with short steps."""


def find_history(
    chosen: Judged, fitted: Fitted, flights: Sequence[PlaybackFlight], settings: PlaybackSettings
) -> Observer | None:
    """Fit the observer of a forecast; None where it lowers no error on parts of the flights kept aside.

    Parameters
    ----------
    chosen : Judged
        The structure of the forecast, fitted without each part: the observer is fitted to that, without the part too.
    fitted : Fitted
        The same, fitted to all flights.
    flights : sequence of PlaybackFlight
        Those that train, of the configuration of the config.
    """
    parts = parts_of(flights, settings)

    def errors(part: int) -> list[Array]:
        training = [windows for other, kept in enumerate(parts) if other != part for windows in kept]
        observer = fit_observer(chosen.without[part], training, settings.history_s)
        return [errors_with_past(chosen.without[part], observer, windows) for windows in parts[part]]

    with ThreadPoolExecutor(2) as threads:
        found = block_errors([each for kept in threads.map(errors, range(len(parts))) for each in kept])
    better = chosen.by_block - found
    if better.mean() <= mean_error(better):
        return None
    windows = windows_of(flights, settings.horizon_s, settings.window_interval_s)
    return fit_observer(fitted, windows, settings.history_s)


def fit_observer(fitted: FittedNumbers, windows: Sequence[FitWindows], past_s: float) -> Observer:
    """Minimise the prediction error of a forecast by the numbers of its observer, over windows between given ones.

    A forecast was fitted to the given ones, and misses less of them than of others: little would be left to observe.

    Parameters
    ----------
    windows : sequence of FitWindows
        That it was fitted to, of flights of the configuration of the config.
    past_s : float, s
        How much of the past is used.
    """
    at = _evaluated(fitted)
    begun = [_Begun.of(at, each, past_s) for each in _chunks([_between(each) for each in windows])]
    ends = tuple(np.broadcast_to(end, _FIRST.shape).ravel() for end in _BOUNDS)
    point = partial(_point, at, begun, past_s)
    looked_at = (np.tile(np.log(pair), len(_FIRST)) for pair in product(_RATES, _MEMORIES))
    first = min((point(values) for values in looked_at), key=lambda each: each.objective)
    scales = np.ones(len(first.values))
    found = minimised(point, first, scales, (ends[0], ends[1]), _STEPS, _TOLERANCE, _DAMPING)
    return _observer(found.values, past_s)


def errors_with_past(fitted: FittedNumbers, observer: Observer, windows: FitWindows) -> Array:
    """Weigh the errors of windows as the fit does; see `window_errors`."""
    at, found = _evaluated(fitted), []
    for each in _chunks([windows]):
        begun = _Begun.of(at, each, observer.past_s)
        errors = np.empty((len(each.starts), each.horizon, 4, 3))
        weights = begun.weights(at, begun.pushed(observer))
        errors_of_runs(each.motion, at.body, at.flown, weights, each.places, each.flight.translates, errors)
        found.append(weighed(each.loss, errors))
    return np.concatenate(found)


def _observer(values: Array, past_s: float) -> Observer:
    rate, memory = np.exp(values.reshape(_FIRST.shape)[_AXES]).T
    return Observer(rate=rate, memory_s=memory, past_s=past_s)


def _between(windows: FitWindows) -> FitWindows:
    """Take windows that begin in the middle between two that follow each other; those there are of a single one."""
    middle = windows.starts[:-1] + np.diff(windows.starts) // 2
    # Not across a pause.
    known = middle[np.isin(middle, windows.flight.starts(windows.horizon, 1))]
    return FitWindows(windows.flight, known if len(known) else windows.starts, windows.loss)


def _chunks(windows: Sequence[FitWindows]) -> Iterator[FitWindows]:
    for window in windows:
        for first in range(0, len(window.starts), _CHUNK):
            yield FitWindows(window.flight, window.starts[first : first + _CHUNK], window.loss)


def _evaluated(fitted: FittedNumbers) -> Evaluated:
    """Evaluate a forecast with the constant among its terms: that is what pushes."""
    return Evaluated.of(fitted.free.base, fitted.values[: len(fitted.free.base.numbers)])


class _Begun(NamedTuple):
    """Windows, and what is missed before them.

    Attributes
    ----------
    terms : array, shape (sample, 1 + 4 rotors)
        Of the rotors, window by window.
    missed : array, shape (run, step, 6), N m and N
        By the model, of each step of the past; 0 where there is none.
    """

    window: FitWindows
    terms: Array
    missed: Array

    @classmethod
    def of(cls, at: Evaluated, window: FitWindows, past_s: float) -> _Begun:
        """Run a model along the measured samples before windows."""
        flight = window.flight
        steps, known = past_of(flight, window.starts, round(past_s / flight.motion.period))
        samples = np.arange(int(steps.min(initial=window.starts[0])), int(window.starts.max()) + 1)
        errors = np.empty((len(samples) - 1, 1, 4, 3))
        motion = motion_at(flight.motion, samples)
        weights = at.weights(at.rotor_terms(flight, samples), at.flown)
        errors_of_runs(motion, at.body, at.flown, weights, np.arange(len(errors)), flight.translates, errors)
        missed = np.zeros((len(samples), 6))
        missed[:-1] = missed_wrench(flight, samples[:-1], errors[:, 0], at.body)
        terms = at.rotor_terms(flight, window.samples)
        return cls(window, terms, missed[steps - samples[0]] * known[:, :, None])

    def pushed(self, observer: Observer) -> Array:
        """Give what pushes the runs, shape (sample, 6)."""
        period = self.window.flight.motion.period
        begun = np.einsum("rsa,sa->ra", self.missed, observer.weights(period))
        return np.asarray(begun[:, None] * observer.fading(period, self.window.horizon + 1)).reshape(-1, 6)

    def weights(self, at: Evaluated, pushed: Array) -> Array:
        """Evaluate the weights of the runs with what pushes them, shape (sample, 6, active)."""
        weights = at.weights(self.terms, at.flown)
        weights[:, :, 0] += pushed
        return weights


def _point(at: Evaluated, begun: Sequence[_Begun], past_s: float, values: Array) -> FitPoint:
    """Take the mean loss over windows, with its derivatives by the logarithms."""
    count = len(values)
    loss, gradient, hessian = 0.0, np.zeros((1, count)), np.zeros((1, count, count))
    moved = [_observer(values + step, past_s) for step in _STEP * np.eye(count)]
    for each in begun:
        window, pushed = each.window, each.pushed(_observer(values, past_s))
        loss += float(
            sensitivities(
                window.motion,
                at.body,
                at.flown,
                each.weights(at, pushed),
                _pushing(np.hstack([(each.pushed(observer) - pushed) / _STEP for observer in moved])),
                window.loss,
                window.places,
                window.flight.translates,
                np.zeros(len(window.starts), dtype=np.int64),
                gradient,
                hessian,
            )
        )
    total, lower = sum(len(each.window.starts) for each in begun), hessian[0]
    curvature = np.tril(lower) + np.tril(lower, -1).T
    believed = Believed(_FIRST.ravel(), np.ones(count), np.full(count, _SPREAD))
    return FitPoint(values, loss / total, lambda: (gradient[0] / total, curvature / total), believed)


def _pushing(value: Array) -> Parameters:
    """Arrange numbers that move torque and force alone, shape (sample, number x 6), for the compiled sums."""
    count = value.shape[1] // 6
    return Parameters(
        row=np.tile(np.arange(6), count),
        term=np.zeros(6 * count, dtype=np.int64),
        first=6 * np.arange(count + 1),
        value=np.ascontiguousarray(value),
        inertia=np.zeros((count, 3, 3)),
        moves=np.zeros(count, dtype=bool),
    )
