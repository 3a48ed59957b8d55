"""Evidence that the verdict on a model rests on, and the facts that follow from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.blocks import MOST_COMPARED
from cpfls_cli.identification.findings import HARDLY_EXCITED_SHARE
from cpfls_cli.identification.identify import Identification
from cpfls_cli.validation.paired import Comparison, compare_windows, non_overlapping
from cpfls_cli.validation.physical import Physics
from cpfls_cli.validation.replay import NOTHING_MOVES, StepErrors
from cpfls_cli.validation.residuals import ResidualAnalysis

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

    def replay_beside(self, part: str, predictor: str, rival: str, axes: Sequence[int] = (0, 1, 2)) -> Comparison:
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
            [self.replay_beside(part, predictor, NOTHING_MOVES, (axis,)).lower for axis in range(3)]
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
