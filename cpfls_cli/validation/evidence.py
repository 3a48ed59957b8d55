"""Evidence that the verdict on a model rests on: facts that follow from it, and models compared on the same blocks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import fft

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import FEWEST_BLOCKS, MOST_COMPARED, contiguous, half_width, mean_error
from cpfls_cli.dynamics import vertical
from cpfls_cli.identification.data import TorqueData, TorqueSource
from cpfls_cli.identification.findings import HARDLY_EXCITED_SHARE
from cpfls_cli.identification.identify import Identification
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.validation.bands import Physics
from cpfls_cli.validation.replay import NOTHING_MOVES, StepErrors
from cpfls_cli.validation.residuals import ResidualAnalysis

# What two solutions of the same equations may differ by, and rounding as a share of what is predicted, squared.
_SAME, _ROUNDING = 1e-6, 1e-18

_SHORTEST_BLOCK = 20
# Neighbouring blocks of four correlation times share little of what is common to their errors.
_CORRELATION_TIMES = 4
_MOST_SAMPLES = 200_000

# How much worse than any run that comes to its end one is that does not.
_LOST = 10.0


@dataclass(frozen=True)
class Comparison:
    """Mean squared errors of a model and of a rival.

    Ratio ``ours / theirs`` is 1 where they differ by no more than rounding, infinite where theirs alone are rounding.
    Ours are lower, or higher, by more than chance: so is the mean over all blocks, and the mean logarithm of the ratio
    by block is outside its 95 % interval about 0.
    """

    ours: float
    theirs: float
    ratio: float
    lower: bool
    higher: bool
    blocks: int


def compare_errors(ours: Array, theirs: Array, size: float) -> Comparison:
    """Compare mean squared errors of the same blocks by Student's test of the paired logarithms.

    Logarithms, since errors differ from block to block by orders of magnitude, and one bad block should neither decide
    nor, by the scatter that it makes, hide that all the others agree. Errors below 1e-18 of the mean square of what is
    predicted, `size`, are rounding. Fewer than four blocks can prove nothing.
    """
    if len(ours) == 0:
        return Comparison(float("nan"), float("nan"), 1.0, False, False, 0)
    mean, rival, rounding = float(np.mean(ours)), float(np.mean(theirs)), _ROUNDING * size
    apart = mean - rival
    if abs(apart) <= _SAME * rival + rounding:
        return Comparison(mean, rival, 1.0, False, False, len(ours))
    least = max(rounding, np.finfo(float).tiny)
    logarithm = np.log(np.maximum(ours, least) / np.maximum(theirs, least))
    enough = len(ours) >= FEWEST_BLOCKS
    typical = float(np.mean(logarithm))
    chance = float(half_width(mean_error(logarithm), len(ours))) if enough else float("inf")
    ratio = mean / rival if rival > rounding else float("inf")
    return Comparison(mean, rival, ratio, apart < 0 and typical < -chance, apart > 0 and typical > chance, len(ours))


def _block_means(errors: Array, block: IntArray) -> Array:
    """Average errors, shape (n,), by their block, from 0; blocks without any are left out."""
    counts = np.bincount(block)
    return np.asarray(np.bincount(block, weights=errors)[counts > 0] / counts[counts > 0])


def block_count(errors: Array) -> int:
    """Count the contiguous blocks, 1 to 20, independent of each other, that errors of samples can be cut into.

    Each block has 20 samples at least, and four correlation times of the errors.
    """
    longest = max(_SHORTEST_BLOCK, _CORRELATION_TIMES * correlation_time(errors[:_MOST_SAMPLES]))
    return min(max(len(errors) // longest, 1), MOST_COMPARED)


def correlation_time(signals: Array) -> int:
    """Find the first lag, in samples, at which the autocorrelation of every signal is down to 1/e; 0 for constants."""
    if len(signals) == 0:
        return 0
    centred = signals - np.mean(signals, axis=0)
    # Twice the length, so that the end is not correlated with the start.
    spectrum = fft.rfft(centred, fft.next_fast_len(2 * len(signals), real=True), axis=0)
    covariance = fft.irfft(np.abs(spectrum) ** 2, axis=0)[: len(signals)]
    return int(np.max(np.argmax(covariance <= covariance[0] / np.e, axis=0)))


def mean_missing_torque(source: TorqueSource, torque: Callable[[Motion], Array]) -> Array:
    """Average the body torque that a model misses, measured minus predicted, N m, away from a vertical pitch."""
    total, count = np.zeros(3), 0
    for data in source.chunks():
        missing = _upright(data, data.torque - torque(data.motion))
        total += np.sum(missing, axis=0)
        count += len(missing)
    return total / max(count, 1)


def _upright(data: TorqueData, torque: Array) -> Array:
    """Give a torque about the body axes away from a vertical pitch, shape (samples, 3)."""
    kept = ~vertical(data.motion.attitude)
    return rotations.body_torque(data.motion.attitude[kept], torque[kept])


def with_constant(torque: Callable[[Motion], Array], constant: Array) -> Callable[[Motion], Array]:
    """Add a constant body torque, N m, to the generalised torque that a model predicts of a motion."""

    def predicted(motion: Motion) -> Array:
        everywhere = np.broadcast_to(constant, (len(motion), 3))
        return torque(motion) + rotations.generalised_torque(motion.attitude, everywhere)

    return predicted


def compare_torque(
    source: TorqueSource, ours: Callable[[Motion], Array], theirs: Callable[[Motion], Array]
) -> Comparison:
    """Compare the errors of body torque over contiguous blocks of a held-out part, as many as `block_count` grants.

    Errors are scaled by the root mean square of the torque about each axis, so that the smallest counts as much as the
    largest, and left out near a pitch of +-90 degrees, as in `Score.r2_body`.
    """
    scale = _scale(source)
    chunks = (
        [_upright(data, data.torque - torque(data.motion)) for torque in (ours, theirs)] for data in source.chunks()
    )
    both = [np.concatenate(errors) / scale for errors in zip(*chunks, strict=True)]
    samples = len(both[0])
    # What one of both leaves of an exact flight is rounding, and how long that remembers itself says nothing.
    above = [errors for errors in both if np.sum(errors**2) > _ROUNDING * errors.size] or both
    block = contiguous(samples, block_count(np.hstack(above)))
    own, rival = (_block_means(np.sum(errors**2, axis=1), block) for errors in both)
    # Each of three axes has a mean square of 1 after scaling.
    return compare_errors(own, rival, size=3.0)


def _scale(source: TorqueSource) -> Array:
    """Root mean square of the body torque; an axis without torque counts by the size of the largest."""
    square, count = np.zeros(3), 0
    for data in source.chunks():
        torque = _upright(data, data.torque)
        square += np.sum(torque**2, axis=0)
        count += len(torque)
    size = square / max(count, 1)
    return np.sqrt(np.where(size > _ROUNDING * np.max(size), size, np.max(size) or 1.0))


def compare_windows(ours: Array, theirs: Array, size: float, block: IntArray) -> Comparison:
    """Compare mean squared errors of windows that do not overlap, by the block of each; without blocks for no window.

    A window that one of both lost counts as ten times the largest error of all; one that both lost is left out.
    """
    both, kept = np.stack([ours, theirs]), np.isfinite(ours) | np.isfinite(theirs)
    worst = _LOST * max(float(np.max(both[np.isfinite(both)], initial=0.0)), size)
    own, rival = (_block_means(errors[kept], block[kept]) for errors in np.where(np.isfinite(both), both, worst))
    return compare_errors(own, rival, size)


def non_overlapping(start: IntArray, horizon: int) -> IntArray:
    """Select windows that do not overlap, from the first on, by their first samples and the samples behind them."""
    chosen, free = [], 0
    for number, first in enumerate(start):
        if first >= free:
            chosen.append(number)
            free = int(first) + horizon
    return np.array(chosen, dtype=np.int64)


MODEL, RIGID_BODY = "model", "rigid-body"

# Rounding of a mean over determined directions.
_ALL = 1 - 1e-6
_MANY_LOST = 0.05


@dataclass(frozen=True)
class Evidence:
    """Evidence that the verdict on a model rests on.

    `torque`: errors of torque of the model and of the rigid body, by held-out part, each with the constant torque that
    it misses in training; `steps`: of the predictors as they are, to be shown; `replayed`: the same of each judged
    part, without the constant torque that each misses; `r2_min`: R2 of body torque that is good enough for control;
    `band`: widest 95 % band of D11, D22 and D33 over the value itself, where training was; `definite`: share of the
    bootstrap draws whose D(q) is positive definite in all cells visited. None without draws.
    """

    identification: Identification
    torque: Mapping[str, Comparison]
    steps: StepErrors
    replayed: Mapping[str, StepErrors]
    residuals: ResidualAnalysis
    physics: Physics
    r2_min: float
    band: Array | None = None
    definite: float | None = None

    @property
    def held_out(self) -> tuple[str, ...]:
        """Parts that nothing was learned from."""
        return tuple(self.identification.scores)[1:]

    @property
    def judged(self) -> tuple[str, ...]:
        """Parts that scores are taken from: what was held out, or for want of it the training part."""
        return self.held_out or tuple(self.identification.scores)

    @property
    def fuzzy_part_off(self) -> bool:
        """Whether cross-validation switched the fuzzy part off."""
        return bool(np.isinf(self.identification.fit.ridge_weight))

    @property
    def determined(self) -> bool:
        """Whether the samples determine every coefficient beyond their noise."""
        return bool(np.all(self.identification.excitation.determined > _ALL))

    @property
    def everywhere(self) -> bool:
        """Whether the model holds at every attitude: one rule, trained all round, determined, definite everywhere."""
        return self.one_rule and self.physics.indefinite_anywhere == 0

    @property
    def one_rule(self) -> bool:
        """Whether one rule acts at all attitudes, training went all round, and all its coefficients are determined."""
        return self.identification.model.same_everywhere and self.determined

    @property
    def hardly_excited(self) -> BoolArray:
        """Body axes, shape (3,), that accelerate so little that their torque is mostly not inertial."""
        acceleration = self.identification.axes.acceleration
        return np.asarray(acceleration < HARDLY_EXCITED_SHARE * np.max(acceleration))

    def r2(self, predictor: str) -> Array:
        """Find the worst R2 of body torque over the judged parts, shape (3,)."""
        scores = [self.identification.scores[part][predictor].r2_body for part in self.judged]
        return np.asarray(np.fmin.reduce(scores))

    def rate_error(self, predictor: str) -> Array:
        """Compute the root mean square error of the body rate over a window, worst judged part, shape (3,), rad/s."""
        errors = [steps.window_error[steps.model.index(predictor)] for steps in self.replayed.values()]
        return np.asarray(np.max([np.sqrt(_mean(squares)) for squares in errors], axis=0))

    def replay_compared(self, part: str, predictor: str, rival: str, axes: Sequence[int] = (0, 1, 2)) -> Comparison:
        """Compare the errors of the body rate of two predictors in windows of a part that do not overlap."""
        steps, samples = self.replayed[part], self.identification.samples[part]
        kept = non_overlapping(steps.start, len(steps.samples))
        summed = np.sum(steps.window_error[:, kept][:, :, list(axes)], axis=2)
        error = dict(zip(steps.model, summed, strict=True))
        # Errors that remember each other for long leave few blocks, of torque as of rate.
        blocks = self.torque[part].blocks if part in self.torque else MOST_COMPARED
        size = float(_mean(error[NOTHING_MOVES]))
        return compare_windows(error[predictor], error[rival], size, steps.start[kept] * blocks // samples)

    def beats_nothing_moves(self, predictor: str) -> BoolArray:
        """Flag axes whose rate is replayed better than if nothing moved, by more than chance, in each part.

        Shape (3,).
        """
        lower = [
            [self.replay_compared(part, predictor, NOTHING_MOVES, (axis,)).lower for axis in range(3)]
            for part in self.replayed
        ]
        return np.asarray(np.all(np.array(lower, dtype=bool), axis=0))

    def predicts(self, predictor: str) -> BoolArray:
        """Flag axes whose rate is replayed better than if nothing moved, on average, in each part, shape (3,).

        True where no window could be replayed, so that nothing speaks against it.
        """
        better = np.ones(3, dtype=bool)
        for steps in self.replayed.values():
            mine, still = (_mean(steps.window_error[steps.model.index(name)]) for name in (predictor, NOTHING_MOVES))
            better &= ~(mine >= still) | (still == 0)
        return better

    def lost(self, predictor: str) -> int:
        """Count the windows of all judged parts in which a predictor was lost."""
        return sum(_lost(steps, predictor) for steps in self.replayed.values())

    @property
    def windows(self) -> int:
        """Windows replayed, of all judged parts."""
        return sum(steps.windows for steps in self.replayed.values())

    @property
    def loses_many(self) -> bool:
        """Whether the model loses more than one in twenty windows of some judged part."""
        return any(_lost(steps, MODEL) > _MANY_LOST * steps.windows for steps in self.replayed.values())

    @property
    def impossible(self) -> bool:
        """Whether D(q) is not positive definite at an attitude that training visited."""
        return self.physics.indefinite > 0 or self.identification.indefinite > 0


def _lost(steps: StepErrors, predictor: str) -> int:
    return int(steps.lost[steps.model.index(predictor), -1])


def _mean(windows: Array) -> Array:
    """Mean over windows; NaN of none."""
    return np.asarray(np.sum(windows, axis=0) / len(windows) if len(windows) else np.full(windows.shape[1:], np.nan))
