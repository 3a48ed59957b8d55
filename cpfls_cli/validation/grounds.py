"""What a verdict on a model rests on, and what follows from it without any judgement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.identification.findings import HARDLY_EXCITED_SHARE
from cpfls_cli.identification.results import Identification
from cpfls_cli.validation.paired import Comparison, compare_windows
from cpfls_cli.validation.physical import Physics
from cpfls_cli.validation.residuals import ResidualAnalysis
from cpfls_cli.validation.steps import NOTHING_MOVES, StepErrors

MODEL, RIGID_BODY = "model", "rigid-body"

# Rounding of a mean over determined directions.
_ALL = 1 - 1e-6


@dataclass(frozen=True)
class Grounds:
    """Evidence on a model.

    Attributes
    ----------
    identification : Identification
        Its scores hold the training part first, then what was held out.
    torque : Comparison or None
        Errors of held-out torque, the model beside the rigid body; None where nothing was held out.
    steps : StepErrors
        Of predictors `MODEL`, `RIGID_BODY` and `NOTHING_MOVES`.
    residuals : ResidualAnalysis
    physics : Physics
    r2_min : float
        R2 of body torque that is good enough for control.
    band : array, shape (3,), or None
        Widest 95 % band of D11, D22 and D33 over the value itself, where training was; None if no bands were drawn.
    """

    identification: Identification
    torque: Comparison | None
    steps: StepErrors
    residuals: ResidualAnalysis
    physics: Physics
    r2_min: float
    band: Array | None = None

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
        """Whether what was learned holds at every attitude: one rule, seen all round, with all its coefficients."""
        return self.identification.model.same_everywhere and self.determined

    @property
    def hardly_excited(self) -> BoolArray:
        """Body axes, shape (3,), that move so little that their torque is mostly not inertia's."""
        acceleration = self.identification.axes.acceleration
        return np.asarray(acceleration < HARDLY_EXCITED_SHARE * np.max(acceleration))

    def r2(self, predictor: str) -> Array:
        """Give the worst R2 of body torque over the judged parts, shape (3,)."""
        scores = [self.identification.scores[part][predictor].r2_body for part in self.judged]
        return np.asarray(np.fmin.reduce(scores))

    def rate_error(self, predictor: str) -> Array:
        """Give the root mean square error of the body rate over the whole horizon, shape (3,), rad/s."""
        error = self.steps.body_rate[self.steps.model.index(predictor)]
        return np.asarray(np.sqrt(np.mean(error**2, axis=0)))

    def steps_beside(self, rival: str) -> Comparison:
        """Compare the errors of the body rate, window by window, the model beside a rival."""
        error = dict(zip(self.steps.model, self.steps.window_error, strict=True))
        still = error[NOTHING_MOVES]
        return compare_windows(error[MODEL], error[rival], float(np.mean(still)) if len(still) else 0.0)

    def lost(self, predictor: str) -> int:
        """Count the windows that a predictor did not come to the end of."""
        return int(self.steps.lost[self.steps.model.index(predictor), -1])

    @property
    def impossible(self) -> bool:
        """Whether no body has the inertia D(q), somewhere where training was."""
        return self.physics.indefinite > 0 or self.identification.indefinite > 0
