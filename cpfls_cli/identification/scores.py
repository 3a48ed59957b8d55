"""The scores of a model and its baselines, and who is better."""

from __future__ import annotations

from typing import Any, Literal, Self

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.identification.identify import TRAINING as TRAINING
from cpfls_cli.identification.identify import Identification
from cpfls_cli.result import about, result

AXES = ("roll", "pitch", "yaw")
"""Euler axes, in the order in which scores have them."""

MODEL, RIGID_BODY, ZERO = "model", "rigid-body", "torque-zero"
"""Names of the model and of two of its baselines among the judged models."""

Winner = Literal["model", "rigid-body", "tie"]

# A mean squared error that is smaller by less than a hundredth, or beside that of no torque at all, decides nothing.
_TIE, _ROUNDING = 0.01, 1e-12
_MEASURES = ("mse", "max_error", "relative_error", "r2", "vaf", "r2_body")
_EULER = "Euler angles (intrinsic ZYX)"


@result
class Judged:
    """Scores of the model and its baselines, by model, part of the data and axis."""

    models: tuple[str, ...] = about("the model and its baselines", "judged_model")
    parts: tuple[str, ...] = about("training, held-out rest, other flights", "part")
    samples: IntArray = about("samples judged", "part")
    outside: IntArray = about("of them outside the attitudes that training visited", "part")
    mse: Array = about(
        "mean squared torque error", "judged_model", "part", "axis", unit="(N m)^2", frame=_EULER, brief=False
    )
    max_error: Array = about(
        "largest torque error", "judged_model", "part", "axis", unit="N m", frame=_EULER, brief=False
    )
    relative_error: Array = about(
        "largest error over largest torque", "judged_model", "part", "axis", gaps=True, frame=_EULER, brief=False
    )
    r2: Array = about(
        "share of the torque's variance explained", "judged_model", "part", "axis", gaps=True, frame=_EULER, brief=False
    )
    vaf: Array = about(
        "the same without the mean of the error: variance accounted for",
        "judged_model",
        "part",
        "axis",
        gaps=True,
        frame=_EULER,
        brief=False,
    )
    r2_body: Array = about(
        "the same for body torque, not near a pitch of +-90 deg",
        "judged_model",
        "part",
        "axis",
        gaps=True,
        frame="body (FLU)",
        brief=False,
    )

    @classmethod
    def of(cls, found: Identification) -> Self:
        """Arrange the scores of an identification."""
        parts, models = list(found.scores), list(found.scores[TRAINING])

        def table(measure: str) -> Array:
            return np.array([[getattr(found.scores[part][model], measure) for part in parts] for model in models])

        return cls(
            models=tuple(models),
            parts=tuple(parts),
            samples=np.array([found.samples[part] for part in parts]),
            outside=np.array([found.outside[part] for part in parts]),
            **{measure: table(measure) for measure in _MEASURES},
        )

    @property
    def measures(self) -> dict[str, Array]:
        """All scores by name, each of shape (models, parts, 3)."""
        return {measure: getattr(self, measure) for measure in _MEASURES}

    @property
    def held_out(self) -> tuple[str, ...]:
        """Parts that nothing was learned from."""
        return self.parts[1:]

    @property
    def baselines(self) -> tuple[str, ...]:
        """Models that were judged beside the model itself."""
        return tuple(name for name in self.models if name != MODEL)

    def samples_of(self, part: str) -> int:
        """Count the samples of a part."""
        return int(self.samples[self.parts.index(part)])

    def of_axes(self, measure: str, model: str, part: str) -> Array:
        """Get a measure by axis, shape (3,); NaN where this model or part was not judged."""
        if model not in self.models or part not in self.parts:
            return np.full(3, np.nan)
        return np.asarray(getattr(self, measure)[self.models.index(model), self.parts.index(part)])

    def nrmse(self, model: str, part: str) -> Array:
        """Get the root mean square error by axis over the standard deviation of the torque, shape (3,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            variance = self.of_axes("mse", ZERO, part) / (1.0 - self.of_axes("r2", ZERO, part))
            return np.asarray(np.sqrt(self.of_axes("mse", model, part) / variance))

    def worst(self, model: str, part: str) -> tuple[float, str]:
        """Get the largest relative error and its axis; NaN and no axis where none has torque."""
        values = self.of_axes("relative_error", model, part)
        if np.isnan(values).all():
            return float("nan"), ""
        axis = int(np.nanargmax(values))
        return float(values[axis]), AXES[axis]

    def worst_r2(self, model: str, part: str) -> float:
        """Get the smallest R2 of the axes whose torque varies; NaN where none does."""
        values = self.of_axes("r2", model, part)
        return float("nan") if np.isnan(values).all() else float(np.nanmin(values))

    def winner(self, part: str, axis: int) -> Winner:
        """Tell whether model or rigid body has the smaller mean squared error; one per cent or rounding is a tie."""
        model, rigid, scale = (float(self.of_axes("mse", name, part)[axis]) for name in (MODEL, RIGID_BODY, ZERO))
        floor = _ROUNDING * scale if np.isfinite(scale) else 0.0
        if max(model, rigid) <= floor or abs(model - rigid) <= _TIE * max(model, rigid) or np.isnan(model + rigid):
            return "tie"
        return "model" if model < rigid else "rigid-body"

    def winners(self, part: str) -> list[Winner]:
        """Tell who is better, for every axis."""
        return [self.winner(part, axis) for axis in range(len(AXES))]

    def summary_of(self, model: str, part: str) -> dict[str, Any]:
        """Gather the scores of a model on a part for machines."""
        relative = self.of_axes("relative_error", model, part)
        return {
            "mse": float(np.mean(self.of_axes("mse", model, part))),
            "max_error": float(np.max(self.of_axes("max_error", model, part))),
            "relative_error": float(np.max(relative[np.isfinite(relative)], initial=0.0)),
            "mse_by_axis": self.of_axes("mse", model, part).tolist(),
            "r2": self.of_axes("r2", model, part).tolist(),
            "r2_body": self.of_axes("r2_body", model, part).tolist(),
        }
