"""Prediction-error fit: the numbers with which free runs along flights come out closest to what was measured."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import ENOUGH_BLOCKS, contiguous, jackknife_covariance
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.estimation.estimate import Prior
from cpfls_cli.least_squares import damped_step
from cpfls_cli.playback.evaluation import JointNumbers, ParameterPoint
from cpfls_cli.playback.flight import MeasuredMotion, PlaybackFlight, motion_at
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.parameters import SLOW
from cpfls_cli.playback.player import still_runs
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.playback.windows import MOST_RUNS, Flown, Leg, Loss, Runs, Steps, legs, losses_of, sums_of
from cpfls_cli.rounding import smallest
from cpfls_cli.words import joined

_SIGNAL_WEIGHTS = (0.3, 0.5, 1.0)
"""Of velocity, attitude and rate: half of the attitude's error follows from the rate's, so that it says less that is
new, and position follows from velocity, and is not weighed."""

_STILL = 1e-9
"""Speed of a rotor that stands, rad/s."""

_ROBUST = 0.5
_LEAST = 0.1
"""Error at which the loss turns from square to absolute, in those of "rate stays"; at least a share of their mean."""


@dataclass(frozen=True)
class FitWindows:
    """Windows of a flight that runs are compared in, by their first samples and the samples of a step.

    The loss is in errors of "rate stays" on windows of the flight, or more for a quiet one (`windows_of`).
    """

    flight: PlaybackFlight
    starts: IntArray
    loss: Loss
    every: int = 1

    @property
    def horizon(self) -> int:
        """Steps of each window."""
        return len(self.loss.weight)

    @property
    def together(self) -> tuple[str, int, float, bool]:
        """What windows have in common that are flown side by side."""
        flight = self.flight
        return flight.group, self.horizon, self.every * flight.motion.period, flight.translates

    @cached_property
    def samples(self) -> IntArray:
        """Samples of the flight between steps, window by window: only there the weights are needed."""
        return np.asarray((self.starts[:, None] + self.every * np.arange(self.horizon + 1)).ravel())

    @cached_property
    def motion(self) -> MeasuredMotion:
        """Motion at these samples."""
        motion = self.flight.motion
        return motion_at(motion, self.samples)._replace(period=self.every * motion.period)

    def rotor_terms(self, at: ParameterPoint, by: str = "") -> Array:
        """Average the terms of the rotors, or their derivatives by a number, over steps, shape (step, run, column).

        The speed of several samples is the root of their mean square, which gives the mean thrust.
        """
        steps = self.starts + np.arange(self.every * self.horizon)[:, None]
        terms = at.rotor_terms(self.flight, steps, by)
        if self.every == 1:
            return terms
        means = np.asarray(terms.reshape(self.horizon, self.every, *terms.shape[1:]).mean(axis=1))
        rotors = terms.shape[-1] // 4
        speed, square = (slice(1 + n * rotors, 1 + (n + 1) * rotors) for n in range(2))
        if by:
            means[..., speed] = 0.5 * means[..., square] / np.maximum(self.rotor_terms(at)[..., speed], _STILL)
        else:
            means[..., speed] = np.sqrt(means[..., square])
        return means


def windows_of(
    flights: Sequence[PlaybackFlight], horizon_s: float, interval_s: float, step_s: float = 0.0
) -> list[FitWindows]:
    """Take windows of flights, errors weighed so that a lively flight counts more, by the square root.

    A model misses more of a lively flight, but not in proportion: the noise of rotor speeds is there in hover as well.
    In errors of "rate stays" a quiet flight would rule the fit, in plain errors the liveliest. All times in s; a step
    of runs is one sample at least.
    """
    found = []
    for flight in flights:
        period = flight.motion.period
        every = max(1, int(min(step_s, horizon_s) / period + 1e-9))
        horizon = max(1, round(horizon_s / (every * period)))
        starts = flight.starts(every * horizon, max(1, round(interval_s / period)))
        found.append((flight, starts, rate_stays(flight, starts, horizon, every), every))
    lively = np.array([scale.mean(axis=0) for *_, scale, _ in found])
    weight = np.sqrt(lively.max(axis=0) / np.where(lively > 0, lively, np.inf))
    return [
        FitWindows(flight, starts, loss_of(flight, scale * np.where(own > 0, own, 1.0)), every)
        for (flight, starts, scale, every), own in zip(found, weight, strict=True)
    ]


def rate_stays(flight: PlaybackFlight, starts: IntArray, horizon: int, every: int = 1) -> Array:
    """Compute mean errors of "rate stays" after steps of so many samples, shape (horizon, 4), m, m/s, rad, rad/s."""
    errors = still_runs(flight, starts, horizon, moves=True, every=every).errors
    return np.asarray(np.linalg.norm(errors, axis=3).mean(axis=0))


def loss_of(flight: PlaybackFlight, scale: Array) -> Loss:
    """Weigh errors by what is expected of a forecast that knows nothing, such as `rate_stays`.

    `scale`: shape (horizon, 4), in m, m/s, rad and rad/s.
    """
    shown, scale = flight.shown[1:], scale[:, 1:]
    total = np.where(shown & (scale.sum(axis=0) > 0), scale.sum(axis=0), np.inf)
    delta = np.maximum(_ROBUST * np.maximum(scale, _LEAST * scale.mean(axis=0)), 1e-12)
    return Loss(np.array(_SIGNAL_WEIGHTS) / total / delta, delta)


@dataclass(frozen=True)
class FittedNumbers:
    """Numbers fitted to windows, and the mean loss over windows without the prior; about 1.1 for rates that stay."""

    free: JointNumbers
    values: Array
    loss: float

    @property
    def model(self) -> VehicleModel:
        """Model of the vehicle of the config."""
        return self.free.at(self.values).model


@dataclass(frozen=True)
class Fitted(FittedNumbers):
    """Numbers fitted to windows, and how well these identify them.

    `hessian`: Gauss-Newton, of the mean loss with the prior, in scales of the numbers.
    """

    hessian: Array

    @property
    def condition_number(self) -> float:
        """Of the numbers in their scales, prior included."""
        eigenvalues = np.linalg.eigvalsh(self.hessian) if len(self.hessian) else np.ones(1)
        rounding = np.finfo(float)
        return float(eigenvalues[-1] / max(eigenvalues[0], rounding.eps * eigenvalues[-1], rounding.tiny))


@dataclass(frozen=True)
class FitPoint:
    """A fit at values of its numbers.

    `loss` is without the prior, which is in scales. `derivatives` gives gradient and Hessian: they cost ten times the
    loss, and a step that fails, or is the last one, needs none.
    """

    values: Array
    loss: float
    derivatives: Callable[[], tuple[Array, Array]]
    scales: Array
    prior: Prior

    @cached_property
    def objective(self) -> float:
        """Loss, and what was believed before."""
        away = self.values / self.scales - self.prior.mean
        return self.loss + 0.5 * float(self.prior.precision @ away**2)

    @property
    def gradient(self) -> Array:
        """Of the objective, in scales of the numbers."""
        return self._in_scales[0]

    @property
    def hessian(self) -> Array:
        """Of the objective, in scales of the numbers."""
        return self._in_scales[1]

    def step(self, damping: float, bounds: tuple[Array, Array]) -> Array:
        """Solve for a damped step within bounds, in scales of the numbers."""
        room = ((bound - self.values) / self.scales for bound in bounds)
        return damped_step(self.hessian, self.gradient, damping, *room)

    @cached_property
    def _in_scales(self) -> tuple[Array, Array]:
        (gradient, hessian), scales, prior = self.derivatives(), self.scales, self.prior
        return (
            gradient * scales - prior.pull(self.values / scales),
            hessian * scales[:, None] * scales + np.diag(prior.precision),
        )


_DAMPING = 1e-3
"""Share of the diagonal: that of the first step of a fit, nearly a Gauss-Newton step."""

_DAMPING_UP, _DAMPING_DOWN, _LEAST_DAMPING = 6.0, 5.0, 1e-9
"""It is raised by more than it is lowered, so that it settles."""

_TRIES = 8
"""Of one step: the damping is a million times larger then, and a step that still fails is rounding."""


def minimised(
    evaluate: Callable[[Array], FitPoint],
    point: FitPoint,
    bounds: tuple[Array, Array],
    steps: int,
    tolerance: float,
    damping: float = _DAMPING,
) -> FitPoint:
    """Minimise an objective by damped steps within bounds.

    Parameters
    ----------
    evaluate : callable
        Gives the point at values.
    point : FitPoint
        To start from.
    bounds : tuple of array, shape (number,)
    steps : int
        At most.
    tolerance : float
        Relative decrease of the objective, by a step or expected of an undamped one, below which it has come to its
        end.
    damping : float
        Share of the diagonal at first.
    """
    for _ in range(steps):
        if tolerance:
            # By how much the quadratic model falls with a step that is hardly damped.
            step = point.step(_LEAST_DAMPING, bounds)
            if -step @ (point.gradient + 0.5 * point.hessian @ step) < tolerance * point.objective:
                break
        for _ in range(_TRIES):
            step = point.scales * point.step(damping, bounds)
            following = evaluate(np.clip(point.values + step, *bounds))
            if following.objective < point.objective:
                break
            damping *= _DAMPING_UP
        else:
            break
        damping = max(damping / _DAMPING_DOWN, _LEAST_DAMPING)
        decrease, point = point.objective - following.objective, following
        if decrease < tolerance * point.objective:
            break
    return point


def fit(
    free: JointNumbers, windows: Sequence[FitWindows], known: Mapping[str, float], steps: int, tolerance: float
) -> Fitted:
    """Minimise the robust prediction error over windows by a damped Gauss-Newton method within bounds.

    It ends after so many `steps`, or when the loss decreases by less than the relative `tolerance`; `ComputationError`
    where the loss is not finite at the start. Ljung, System Identification, section 10.2; Jategaonkar, Flight Vehicle
    System Identification, chapter 4 (output error); Bock 1983 (multiple shooting: each window starts from what was
    measured).
    """
    together = WindowSet(tuple(windows))
    return fit_parts(free, together, np.zeros(len(windows), dtype=np.int64), [known], steps, tolerance)[0]


Fits = tuple[Fitted, list[tuple[FittedNumbers, list[Array]]], "WindowSums"]
"""A fit to all windows, those without each part with the errors of its windows, flight by flight, and the sums of the
first."""


def fit_parts(
    free: JointNumbers,
    windows: WindowSet,
    part: IntArray,
    starts: Sequence[Mapping[str, float]],
    steps: int,
    tolerance: float,
    enough: float = -np.inf,
) -> Fits:
    """Fit numbers to all windows, and from there, by one step, without each part, with the errors of its windows.

    Without a part the derivatives at the fit to all are known: they are those of all less those of the part. Each step
    has to lower the loss without the part. Parameters are those of `fit`, but that it begins at the best of several
    starts, or at the first whose loss is not above `enough`, and that `part` says which part the windows of each flight
    are; a single part cannot be left out.
    """
    bounds = free.lows, free.highs

    @cache
    def at(values: tuple[float, ...]) -> WindowSums:
        return WindowSums(free, windows, np.array(values))

    def best(kept: BoolArray, point: FitPoint, steps: int, tolerance: float) -> FitPoint:
        def evaluated(values: Array) -> FitPoint:
            return at(tuple(values.tolist())).mean(kept)

        return minimised(evaluated, point, bounds, steps, tolerance)

    every = part >= 0
    values = dict.fromkeys(tuple(np.clip(free.values(known), *bounds).tolist()) for known in starts)
    begun: list[FitPoint] = []
    for each in values:
        begun.append(at(each).mean(every))
        if begun[-1].loss <= enough:
            break
    finite = [each for each in begun if np.isfinite(each.objective)]
    if not finite:
        raise ComputationError("the prediction error is not finite with the stated numbers; check the units of the log")
    whole = best(every, smallest(finite, lambda each: each.objective), steps, tolerance)
    sums = at(tuple(whole.values.tolist()))

    held = []
    for kept in (part != number for number in range(part[-1] + 1) if part[-1]):
        point = best(kept, sums.mean(kept), 1, 0.0)
        errors = at(tuple(point.values.tolist())).errors
        aside = [own for own, other in zip(errors, kept, strict=True) if not other]
        held.append((FittedNumbers(free, point.values, point.loss), aside))
    return Fitted(free, whole.values, whole.loss, whole.hessian), held, sums


@dataclass(frozen=True)
class SideBySide:
    """Windows of several flights of one configuration that are flown at once.

    `places` says which of all flights they are, `owner` which of these flights each run is of.
    """

    places: IntArray
    windows: tuple[FitWindows, ...]
    _last: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def owner(self) -> IntArray:
        """Flight of each run."""
        return np.repeat(np.arange(len(self.windows)), [len(each.starts) for each in self.windows])

    @cached_property
    def runs(self) -> Runs:
        """All runs."""
        motions = [each.motion for each in self.windows]
        parts = zip(*(each[:4] for each in motions), strict=True)
        position, velocity, rotation, rate = (np.concatenate(each) for each in parts)
        starts = np.arange(len(self.owner), dtype=np.int64) * (self.windows[0].horizon + 1)
        return Runs(
            MeasuredMotion(position, velocity, rotation, rate, motions[0].period),
            starts,
            self.windows[0].flight.translates,
        )

    @cached_property
    def loss(self) -> Loss:
        """How their errors are weighed."""
        return Loss(
            *(np.stack(each, axis=2)[:, :, self.owner] for each in zip(*(w.loss for w in self.windows), strict=True))
        )

    def steps(self, at: ParameterPoint, numbers: Iterable[str] = ()) -> Steps:
        """Give the rotors over all steps, with derivatives by numbers of their response."""
        by = {at.free.index[name]: self._terms(at, name) for name in numbers}
        return Steps(self._terms(at), terms_by=by)

    def _terms(self, at: ParameterPoint, by: str = "") -> Array:
        """Give the terms of the rotors, or as last given: most vehicles respond alike."""
        key = by, *at.times_of_response
        if self._last.get("response") != key or by:
            found = np.concatenate([each.rotor_terms(at, by) for each in self.windows], axis=1)
            if by or len(self.owner) > MOST_RUNS:
                return found
            self._last.update(response=key, terms=found)
        terms: Array = self._last["terms"]
        return terms

    def losses(self, at: ParameterPoint) -> Array:
        """Weigh the errors of each run."""
        return losses_of(self._legs(at), self.loss)

    def sums(self, at: ParameterPoint, groups: IntArray) -> tuple[Array, Array]:
        """Sum gradient and Hessian by the numbers, by group of each run."""
        return sums_of(self._legs(at), at.slopes(), self.steps(at, at.times), self.loss, groups)

    def flown(self, at: ParameterPoint, *, pushed: bool = False) -> Flown:
        """Give a vehicle as these runs fly it, maybe pushed on top."""
        return at.flown(self.runs.motion.period, translates=self.runs.translates, pushed=pushed)

    def _legs(self, at: ParameterPoint) -> Iterable[Leg]:
        """Fly all runs, or give them as last flown where there are not many: derivatives follow the loss."""
        flown = legs(self.flown(at), self.runs, self.steps(at))
        if len(self.owner) > MOST_RUNS:
            return flown
        key = (at.free, at.values.tobytes())
        if self._last.get("key") != key:
            self._last.update(key=key, legs=list(flown))
        found: list[Leg] = self._last["legs"]
        return found


def side_by_side(windows: Sequence[FitWindows]) -> list[SideBySide]:
    """Put together what is flown at once."""
    alike: dict[tuple[str, int, float, bool], list[int]] = {}
    for place, each in enumerate(windows):
        alike.setdefault(each.together, []).append(place)
    return [SideBySide(np.array(own), tuple(windows[place] for place in own)) for own in alike.values()]


@dataclass(frozen=True)
class WindowSet:
    """Windows of flights, made ready to be flown again and again."""

    windows: tuple[FitWindows, ...]

    @cached_property
    def _together(self) -> list[SideBySide]:
        return side_by_side(self.windows)

    @cached_property
    def counts(self) -> IntArray:
        """Runs of each flight."""
        return np.array([len(each.starts) for each in self.windows])

    @cached_property
    def pieces(self) -> list[IntArray]:
        """Say of each flight which block of `block_errors` each run is in."""
        return _blocks(self.counts.tolist())

    @cached_property
    def owner(self) -> IntArray:
        """Flight of each piece."""
        return np.repeat(np.arange(len(self.pieces)), [int(own[-1]) + 1 for own in self.pieces])

    def _of_group(self, free: JointNumbers, values: Array, each: SideBySide) -> tuple[ParameterPoint, IntArray]:
        own, places = free.of_flight(each.windows[0].flight)
        return ParameterPoint(own, values[places]), places

    def errors(self, free: JointNumbers, values: Array) -> list[Array]:
        """Weigh the errors of each run, flight by flight, shapes (run,)."""
        found = [np.zeros(0)] * len(self.windows)
        for each in self._together:
            losses = each.losses(self._of_group(free, values, each)[0])
            for own, place in enumerate(each.places.tolist()):
                found[place] = losses[each.owner == own]
        return found

    def derivatives(self, free: JointNumbers, values: Array, groups: Sequence[IntArray]) -> list[tuple[Array, Array]]:
        """Sum gradient and Hessian by all numbers along each flight, the first axis that of the groups.

        `groups` says of each flight which sum each run is added to.
        """
        count = len(values)
        sizes = [int(own.max(initial=0)) + 1 for own in groups]
        found = [(np.zeros((size, count)), np.zeros((size, count, count))) for size in sizes]
        for each in self._together:
            at, places = self._of_group(free, values, each)
            firsts = np.cumsum([0, *(sizes[place] for place in each.places)])
            whole = np.concatenate([groups[p] + first for p, first in zip(each.places, firsts, strict=False)])
            gradient, hessian = each.sums(at, whole)
            for place, first, end in zip(each.places.tolist(), firsts, firsts[1:], strict=False):
                found[place][0][:, places] = gradient[first:end]
                found[place][1][:, places[:, None], places] = hessian[first:end]
        return found


@dataclass(frozen=True)
class WindowSums:
    """Numbers at values, and what they come to along each of several flights."""

    free: JointNumbers
    windows: WindowSet
    values: Array

    @cached_property
    def by_piece(self) -> tuple[Array, Array]:
        """Gradient and Hessian of the sums over the pieces of all flights."""
        sums = self.windows.derivatives(self.free, self.values, self.windows.pieces)
        gradient, hessian = zip(*sums, strict=True)
        return np.concatenate(gradient), np.concatenate(hessian)

    @cached_property
    def errors(self) -> list[Array]:
        """Errors of each run, flight by flight, shapes (run,)."""
        return self.windows.errors(self.free, self.values)

    def mean(self, kept: BoolArray) -> FitPoint:
        """Take the means over the runs of some of the flights."""
        count = self.windows.counts[kept].sum()

        def derivatives() -> tuple[Array, Array]:
            pieces = kept[self.windows.owner]
            gradient, hessian = (each[pieces].sum(axis=0) / count for each in self.by_piece)
            return gradient, hessian

        loss = float(np.array([each.sum() for each in self.errors])[kept].sum() / count)
        return FitPoint(self.values, loss, derivatives, self.free.scales, self.free.prior)


@dataclass(frozen=True)
class Uncertainty:
    """Covariance of the numbers of a fit from blocks of windows; determined where flights say more than the prior."""

    covariance: Array
    blocks: int
    determined: BoolArray


BLOCKS = 30
"""Blocks of all flights that a jackknife leaves out: Student's t is 4 % wider than for infinitely many."""

_INFORMED = 10.0
"""Curvature by the flights over that by the prior from which on a number counts as determined."""


def uncertainty(fitted: Fitted, windows: Sequence[FitWindows]) -> Uncertainty:
    """Estimate how far the numbers scatter, from blocks of neighbouring windows that they were fitted to.

    Without a block b, windows within which are alike, the fit moves by ``(H - H_b)^-1 g_b``; the covariance is ``(n -
    1) / n`` times the sum of the squares of these moves about their mean. A block that alone identifies a number has
    drawn the fit to itself, which a fixed ``H^-1`` would not see. Bell and McCaffrey 2002; MacKinnon, Nielsen and Webb
    2023 (jackknife by cluster); Ljung, section 9.4.
    """
    free, scale = fitted.free, fitted.free.scales
    count = sum(len(window.starts) for window in windows)
    blocks = [max(2, round(BLOCKS * len(window.starts) / count)) for window in windows]
    groups = [contiguous(len(window.starts), own) for window, own in zip(windows, blocks, strict=True)]
    sums = WindowSet(tuple(windows)).derivatives(free, fitted.values, groups)
    gradient, hessian = (np.concatenate(each) for each in zip(*sums, strict=True))
    # The prior stays in the difference, so that it can be inverted whatever a block takes with it.
    without = fitted.hessian * count - hessian * scale[:, None] * scale
    moved = np.linalg.solve(without, (gradient * scale)[:, :, None])[:, :, 0]
    covariance = jackknife_covariance(moved * scale)
    conditional = np.diag(fitted.hessian) - free.prior.precision
    return Uncertainty(covariance, len(gradient), np.asarray(conditional > _INFORMED * free.prior.precision))


def stays_error(window: FitWindows) -> float:
    """Weigh the mean errors of "rate stays" on windows of a flight as the fit does."""
    size = rate_stays(window.flight, window.starts, window.horizon, window.every)
    return float(window.loss.of(size[:, 1:, None] ** 2).sum())


_STEP_S = 0.01
"""Longest step of the runs that structures are compared by; what is kept is fitted at all samples."""

_QUICK = 100
"""Windows of a quick search at most."""

_UNSEEN = 3.0
"""How many times as fast about an axis a part turns, at least, that is nothing like the others."""


def parts_of(flights: Sequence[PlaybackFlight], settings: PlaybackSettings) -> list[list[FitWindows]]:
    """Split flights into parts that are kept aside in turn: neighbours in their order, or pieces of each.

    Neighbours are kept aside together because flights of one kind usually stand side by side: what a model has to
    predict is a kind of flight that it has not seen. Pieces are taken of a single flight, and where a part turns about
    an axis about which hardly anything turns in the others: no model can be asked for what nothing identifies.
    `InputError` where a flight shows nothing that a model predicts, or all are too short.
    """
    flown = sum(len(flight) * flight.motion.period for flight in flights)
    most = min(settings.search_windows, _QUICK) if settings.quick else settings.search_windows
    interval = max(settings.window_interval_s, flown / most)
    windows = windows_of(flights, settings.horizon_s, interval, _STEP_S)
    for each in windows:
        if not each.loss.weight.any():
            raise InputError(
                f"{each.flight.name}: no body rate changes, and no attitude was measured, so that no prediction of a "
                "model can be judged; log body rates or attitude"
            )
    count = min(settings.folds, len(windows))
    ends = np.linspace(0, len(windows), count + 1).round().astype(int).tolist()
    together = [windows[start:end] for start, end in pairwise(ends)]
    if count > 1 and not _lacks_an_axis(together):
        return together
    cut = [_pieces(each, settings.folds) for each in windows]
    parts = [part for pieces in zip(*cut, strict=True) if (part := [piece for piece in pieces if len(piece.starts)])]
    if len(parts) < 2:
        raise InputError(
            f"{joined(flight.name for flight in flights)}: too short for a horizon of {settings.horizon_s:g} s to be "
            "judged; give longer flights, or set a shorter playback.horizon_s"
        )
    return parts


def _pieces(windows: FitWindows, count: int) -> list[FitWindows]:
    """Cut the windows of a flight; those that reach into the next piece are left out, so that none shares a sample."""
    pieces = np.array_split(windows.starts, count)
    ends = [*(piece[0] if len(piece) else np.inf for piece in pieces[1:]), np.inf]
    samples = windows.every * windows.horizon
    kept = [piece[piece + samples < end] for piece, end in zip(pieces, ends, strict=True)]
    return [replace(windows, starts=piece) for piece in kept]


def _lacks_an_axis(parts: Sequence[Sequence[FitWindows]]) -> bool:
    """Tell whether a part turns about an axis about which hardly anything turns in the others."""
    squares = np.array([sum((each.motion.rate**2).sum(axis=0) for each in part) for part in parts])
    samples = np.array([sum(len(each.motion.rate) for each in part) for part in parts])[:, None]
    others = np.sqrt((squares.sum(axis=0) - squares) / (samples.sum() - samples))
    return bool(np.any(np.sqrt(squares / samples) > _UNSEEN * others))


def block_errors(errors: Sequence[Array]) -> Array:
    """Take the means of errors by flight, which is what is independent; few of them are cut."""
    blocks = _blocks([len(each) for each in errors])
    pairs = zip(errors, blocks, strict=True)
    return np.array([each[own == block].mean() for each, own in pairs for block in range(own[-1] + 1)])


def _blocks(counts: Sequence[int]) -> list[IntArray]:
    """Say which block each window of a flight is in, from the numbers of the windows."""
    pieces = -(-ENOUGH_BLOCKS // len(counts))
    found = (np.array_split(np.zeros(count), min(pieces, count)) for count in counts)
    return [np.repeat(np.arange(len(own)), [len(piece) for piece in own]) for own in found]


@dataclass(frozen=True)
class Outlook:
    """Loss of free runs near values of numbers, to second order, by pieces of the flights; sums, in scales.

    A model with fewer numbers has the others at where they are absent, and one with more has them there at first: both
    are predicted by the step that a fit would take from there, without each part and then judged on it. Errors of the
    step make what is predicted too large rather than too small, as the loss grows by less than the square. Rao 1948
    (score test); Lawless and Singhal 1978 (subsets from one fit by its Hessian).
    """

    sums: WindowSums
    part: IntArray

    @property
    def free(self) -> JointNumbers:
        """Numbers of the models that are predicted."""
        return self.sums.free

    @cached_property
    def blocks(self) -> set[str]:
        """Blocks of the models that are predicted."""
        return {number.block for number in self.free.numbers}

    def errors(self, blocks: Collection[str]) -> Array:
        """Predict the mean errors of a model of some of the blocks, on each piece, shape (piece,)."""
        own, errors = self._own(blocks), np.empty(len(self.sums.windows.owner))
        for without, (aside, loss, gradient, hessian) in zip(self._without, self._by_part, strict=True):
            step = self._step(without, own)
            errors[aside] = loss + (gradient + 0.5 * (hessian @ step)) @ step
        return errors

    def start(self, blocks: Collection[str]) -> dict[str, float]:
        """Predict the values of the fit of a model of some of the blocks to all parts, by name."""
        step = self._step(self.sums.mean(self.part >= 0), self._own(blocks))
        return self.free.named(self.sums.values + self.free.scales * step)

    @cached_property
    def _by_part(self) -> list[tuple[BoolArray, Array, Array, Array]]:
        """Say of each part which pieces are of it, and give their mean loss, gradient and Hessian of it in scales."""
        sums, scale = self.sums, self.free.scales
        pieces = sums.windows.pieces
        count = np.concatenate([np.bincount(own) for own in pieces])
        loss = np.concatenate([np.bincount(own, each) for own, each in zip(pieces, sums.errors, strict=True)])
        gradient, hessian = sums.by_piece
        means = (
            loss / count,
            gradient * scale / count[:, None],
            hessian * scale[:, None] * scale / count[:, None, None],
        )
        asides = (self.part[sums.windows.owner] == part for part in range(len(self._without)))
        return [(aside, *(each[aside] for each in means)) for aside in asides]

    @cached_property
    def _without(self) -> list[FitPoint]:
        """The means without each part."""
        return [self.sums.mean(self.part != part) for part in range(int(self.part.max()) + 1)]

    @cached_property
    def _room(self) -> tuple[Array, Array, Array]:
        """How far numbers are from where they are absent, and from their bounds, in scales."""
        free, values = self.free, self.sums.values
        # Without shares of slow actuation its time constant says nothing.
        absent = [value if n.name == SLOW else n.absent for n, value in zip(free.numbers, values, strict=True)]
        gone, low, high = ((each - values) / free.scales for each in (np.array(absent), free.lows, free.highs))
        return gone, np.minimum(low, 0.0), np.maximum(high, 0.0)

    def _step(self, mean: FitPoint, own: BoolArray) -> Array:
        """Step to the fit of some of the numbers, the others absent, in scales, shape (number,)."""
        gone, low, high = self._room
        step = np.where(own, 0.0, gone)
        moved = (mean.gradient + mean.hessian @ step)[own]
        step[own] = damped_step(mean.hessian[np.ix_(own, own)], moved, _DAMPING, low[own], high[own])
        return step

    def _own(self, blocks: Collection[str]) -> BoolArray:
        """Tell which numbers a model of some of the blocks has; what is not known of a vehicle every one has."""
        held = {*blocks, *self.free.base.vehicle.unknown}
        return np.array([number.block in held for number in self.free.numbers], dtype=bool)
