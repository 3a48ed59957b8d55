"""Fit of the observer by which a forecast uses the past: its few numbers, by the loss of free runs over the horizon.

The forecast itself is what it is. What pushes a run is linear in what its model misses of the steps before, so the
derivatives of that enter the compiled sums over runs as those of further weights.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.blocks import mean_error
from cpfls_cli.estimation.estimate import Prior
from cpfls_cli.playback.evaluation import PRIOR, ParameterPoint
from cpfls_cli.playback.fit import (
    FitPoint,
    Fitted,
    FittedNumbers,
    FitWindows,
    SideBySide,
    WindowSet,
    block_errors,
    minimised,
    parts_of,
    side_by_side,
    windows_of,
)
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.player import Observer, missed_before, player_of
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.playback.structure import Judged
from cpfls_cli.playback.windows import Leg, Steps, legs, losses_of, sums_of

_AXES = np.array([0, 0, 1, 2, 2, 3])
"""Which numbers an axis of torque and force has: roll and pitch share theirs, so do ahead and left."""

_FIRST = np.log([[30.0, 0.15]] * 4)
"""What is believed of rates in 1/s and memories in s, as logarithms, shape (4, 2): the fit begins there."""

_BOUNDS = np.log([[0.1, 0.005], [300.0, 5.0]])
_SPREAD = 2.0
"""Bounds of these logarithms, and the standard deviation of what is believed of them."""

_STEP = 1e-4
"""Of forward differences by them."""

_STEPS, _TOLERANCE, _DAMPING = 25, 1e-4, 10.0
"""Of the fit: it begins with short steps."""


def find_history(
    chosen: Judged, fitted: Fitted, flights: Sequence[PlaybackFlight], settings: PlaybackSettings
) -> Observer | None:
    """Fit the observer of a forecast; None where it lowers no error on parts of the flights kept aside.

    `chosen` is the structure fitted without each part, which its observer is fitted to, without the part too; `fitted`
    the same, fitted to all flights.
    """
    windows = windows_of(flights, settings.horizon_s, settings.window_interval_s)
    observer = fit_observer(fitted, windows, settings.history_s)
    between = tuple(map(_between, windows))
    # What gains nothing where it was fitted gains nothing elsewhere.
    plain, observed = WindowSet(between).errors(fitted.free, fitted.values), _with_past(fitted, observer, between)
    if not _lowers(block_errors(plain), block_errors(observed)):
        return None
    parts, errors = parts_of(flights, settings), []
    for place, (part, without) in enumerate(zip(parts, chosen.without, strict=True)):
        training = [windows for other, kept in enumerate(parts) if other != place for windows in kept]
        errors += _with_past(without, fit_observer(without, training, settings.history_s), part)
    return observer if _lowers(chosen.by_block, block_errors(errors)) else None


def _with_past(fitted: FittedNumbers, observer: Observer, windows: Sequence[FitWindows]) -> list[Array]:
    return [errors_with_past(fitted, observer, each) for each in windows]


def _lowers(without: Array, found: Array) -> bool:
    """Tell whether errors by block are lower than without, beyond their own error."""
    better = without - found
    return bool(better.mean() > mean_error(better))


def fit_observer(fitted: FittedNumbers, windows: Sequence[FitWindows], past_s: float) -> Observer:
    """Minimise the prediction error of a forecast by the numbers of its observer, over windows between given ones.

    The forecast was fitted to the given ones, and misses less of them than of others: little would be left to observe.
    `past_s`: how much of the past is used, s.
    """
    at = fitted.free.at(fitted.values)
    begun = [_Begun.of(at, each, past_s) for each in side_by_side([_between(each) for each in windows])]
    ends = tuple(np.broadcast_to(end, _FIRST.shape).ravel() for end in _BOUNDS)
    point = partial(_point, at, begun, past_s)
    first = point(_FIRST.ravel())
    found = minimised(point, first, (ends[0], ends[1]), _STEPS, _TOLERANCE, _DAMPING)
    return _observer(found.values, past_s)


def errors_with_past(fitted: FittedNumbers, observer: Observer, windows: FitWindows) -> Array:
    """Weigh the errors of windows as the fit does, shape (window,)."""
    at = fitted.free.at(fitted.values)
    (begun,) = (_Begun.of(at, each, observer.past_s) for each in side_by_side([windows]))
    return losses_of(begun.flown(at, begun.pushed(observer)), begun.windows.loss)


def _observer(values: Array, past_s: float) -> Observer:
    rate, memory = np.exp(values.reshape(_FIRST.shape)[_AXES]).T
    return Observer(rate=rate, memory_s=memory, past_s=past_s)


def _between(windows: FitWindows) -> FitWindows:
    """Take windows that begin in the middle between two that follow each other; those there are of a single one."""
    middle = windows.starts[:-1] + np.diff(windows.starts) // 2
    # Not across a pause.
    known = middle[np.isin(middle, windows.flight.starts(windows.every * windows.horizon, 1))]
    return replace(windows, starts=known if len(known) else windows.starts)


class _Begun(NamedTuple):
    """Windows side by side, and what is missed before them.

    `terms` of the rotors, shape (step, run, 1 + 4 rotors); `missed` by the model at each step of the past, shape (run,
    step, 6), N m and N, 0 where there is none.
    """

    windows: SideBySide
    terms: Array
    missed: Array

    @classmethod
    def of(cls, at: ParameterPoint, windows: SideBySide, past_s: float) -> _Begun:
        """Run a model along the measured samples before windows."""
        model, missed = at.model, []
        for each in windows.windows:
            flight, samples = each.flight, round(past_s / each.flight.motion.period)
            missed.append(missed_before(player_of(model, flight), flight, each.starts, samples))
        return cls(windows, windows.steps(at).terms, np.concatenate(missed))

    def pushed(self, observer: Observer) -> Array:
        """Give what pushes the runs, shape (step, run, 6)."""
        window, *_ = self.windows.windows
        period, steps = window.flight.motion.period, (window.horizon, window.every)
        begun = np.einsum("rsa,sa->ra", self.missed, observer.weights(period))
        fading = observer.fading(period, window.every * window.horizon).reshape(*steps, 1, -1)
        return np.asarray(begun * fading.mean(axis=1))

    def flown(self, at: ParameterPoint, pushed: Array) -> Iterator[Leg]:
        """Fly all runs, pushed on top of what the model gives."""
        return legs(self.windows.flown(at, pushed=True), self.windows.runs, Steps(self.terms, pushed))


def _point(at: ParameterPoint, begun: Sequence[_Begun], past_s: float, values: Array) -> FitPoint:
    """Take the mean loss over windows, with its derivatives by the logarithms."""
    count = len(values)
    moved = [_observer(values + step, past_s) for step in _STEP * np.eye(count)]
    pushed = [each.pushed(_observer(values, past_s)) for each in begun]
    flown = [[*each.flown(at, push)] for each, push in zip(begun, pushed, strict=True)]
    total = sum(len(each.missed) for each in begun)
    loss = sum(losses_of(own, each.windows.loss).sum() for own, each in zip(flown, begun, strict=True))

    def derivatives() -> tuple[Array, Array]:
        gradient, hessian = np.zeros(count), np.zeros((count, count))
        slopes = at.slopes(count)
        for each, own, push in zip(begun, flown, pushed, strict=True):
            by = {place: (each.pushed(observer) - push) / _STEP for place, observer in enumerate(moved)}
            group = np.zeros(len(each.missed), dtype=np.int64)
            sums = sums_of(own, slopes, Steps(each.terms, push, push_by=by), each.windows.loss, group)
            gradient, hessian = gradient + sums[0][0], hessian + sums[1][0]
        return gradient / total, hessian / total

    prior = Prior(_FIRST.ravel(), np.full(count, _SPREAD / np.sqrt(PRIOR)))
    return FitPoint(values, float(loss / total), derivatives, np.ones(count), prior)
