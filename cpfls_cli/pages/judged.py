"""How a model was judged beside its baselines, read from its artifact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.pages.source import Source
from cpfls_cli.report.numbers import ROUNDING

AXES = ("roll", "pitch", "yaw")
TRAINING = "training"
MODEL, RIGID_BODY, ZERO = "model", "rigid-body", "torque-zero"
Winner = Literal["model", "rigid-body", "tie"]
_TIE = 0.01


@dataclass(frozen=True)
class Judged:
    """Scores of one model and its baselines.

    Attributes
    ----------
    samples : array, shape (parts,)
    mse, max_error, relative_error, r2, r2_body : array, shape (models, parts, 3)
    """

    models: list[str]
    parts: list[str]
    samples: Array
    mse: Array
    max_error: Array
    relative_error: Array
    r2: Array
    r2_body: Array

    def of(self, measure: str, model: str, part: str) -> Array:
        """Get a measure by axis, shape (3,); NaN where this model or part was not judged."""
        if model not in self.models or part not in self.parts:
            return np.full(3, np.nan)
        return np.asarray(getattr(self, measure)[self.models.index(model), self.parts.index(part)])

    def nrmse(self, model: str, part: str) -> Array:
        """Get the root mean square error by axis over the standard deviation of the torque, shape (3,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            variance = self.of("mse", ZERO, part) / (1.0 - self.of("r2", ZERO, part))
            return np.asarray(np.sqrt(self.of("mse", model, part) / variance))

    def worst(self, model: str, part: str) -> tuple[float, str]:
        """Get the largest relative error and its axis."""
        values = self.of("relative_error", model, part)
        if np.isnan(values).all():
            return float("nan"), ""
        axis = int(np.nanargmax(values))
        return float(values[axis]), AXES[axis]

    def winner(self, part: str, axis: int) -> Winner:
        """Tell whether the model or the rigid body has the smaller mean squared error about an axis.

        Returns
        -------
        {"model", "rigid-body", "tie"}
            A tie is a difference of at most one per cent, or of nothing but rounding.
        """
        model, rigid, scale = (float(self.of("mse", name, part)[axis]) for name in (MODEL, RIGID_BODY, ZERO))
        floor = ROUNDING * scale if np.isfinite(scale) else 0.0
        if max(model, rigid) <= floor or abs(model - rigid) <= _TIE * max(model, rigid) or np.isnan(model + rigid):
            return "tie"
        return "model" if model < rigid else "rigid-body"

    def winners(self, part: str) -> list[Winner]:
        """Tell who is better, for every axis."""
        return [self.winner(part, axis) for axis in range(len(AXES))]


def judged(model: Source) -> Judged:
    """Read the scores of a model."""
    artifact = model.artifact
    measures = ("mse", "max_error", "relative_error", "r2", "r2_body")
    return Judged(
        models=artifact.texts("judged/models"),
        parts=artifact.texts("judged/parts"),
        samples=artifact.array("judged/samples"),
        **{measure: artifact.array(f"judged/{measure}") for measure in measures},
    )
