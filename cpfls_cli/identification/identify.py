"""Identify a model: search partitions, solve coefficients, judge on data not used for either, score."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.dynamics import InertiaFunctions, not_positive_definite, vertical, visited_cells
from cpfls_cli.errors import ComputationError
from cpfls_cli.evolution.engine import History
from cpfls_cli.identification.closed_loop import FreedTorque, freed_torque, loop_along, source_of
from cpfls_cli.identification.data import TRAINING, TorqueSource, axis_scale
from cpfls_cli.identification.evaluator import Evaluator, decode, uniform_chromosome
from cpfls_cli.identification.findings import (
    AXES,
    Baseline,
    FitDiagnostics,
    axis_evidence,
    findings,
    fit_baselines,
    rule_excitation,
    score_of,
)
from cpfls_cli.identification.samples import Ready, Samples
from cpfls_cli.identification.search import UNWATCHED, Front, SearchResult, SearchRun, StopReason, is_end, search
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.identification.solver import Fit, RidgeCurve, Solver, with_folds
from cpfls_cli.least_squares import LeastSquares
from cpfls_cli.regressor.regressor import data_ranges, joined_ranges
from cpfls_cli.regressor.structure import model_structure
from cpfls_cli.result import BODY, EULER, about, result

MODEL, RIGID_BODY, ZERO, UNIFORM = "model", "rigid-body", "torque-zero", "uniform-partitions"
"""Names of the model and of its baselines among the judged models."""


class FoundModel(NamedTuple):
    """The model that a search chose, solved in full precision, and what it was solved from."""

    evaluator: Evaluator
    freed: FreedTorque | None
    result: SearchResult
    model: InertiaFunctions
    fit: Fit
    system: LeastSquares


def find_model(
    training: TorqueSource,
    learned: TorqueSource,
    settings: IdentificationSettings,
    rng: np.random.Generator,
    run: SearchRun = UNWATCHED,
    kept: TorqueSource | None = None,
) -> FoundModel:
    """Search for a model and solve it, as `identify` does, which then judges it; parameters are those of `identify`.

    ComputationError if no chromosome gives a finite model.
    """
    freed = freed_torque(training, learned)
    evaluator = model_evaluator(*source_of(freed, training, learned), settings)
    result = search(evaluator, settings, rng, run, kept)
    solved = _solve(evaluator, training, result.front.chromosomes[result.front.chosen])
    if solved is None:
        raise ComputationError("no chromosome gave a finite model; perhaps nothing moves in the data")
    return FoundModel(evaluator, freed, result, *solved)


@dataclass(frozen=True)
class Identification(FitDiagnostics):
    """Result of an identification: the model, its diagnostics and the warnings that follow from them.

    Attributes
    ----------
    stop_reason : str
        Why the search ended: generations, converged, time-limit or interrupted.
    ridge : RidgeCurve or None
        For a rigid-body base: how the ridge weight was chosen.
    baselines : tuple of Baseline
        Fitted to the same samples.
    findings : tuple of str
        Warnings: what failed or was not excited.
    """

    model: InertiaFunctions
    front: Front
    history: History
    stop_reason: StopReason
    ridge: RidgeCurve | None
    baselines: tuple[Baseline, ...]
    findings: tuple[str, ...]

    @property
    def complete(self) -> bool:
        """Whether the search came to its end."""
        return is_end(self.stop_reason)


def identify(
    training: TorqueSource,
    learned: TorqueSource,
    held_out: Mapping[str, TorqueSource],
    settings: IdentificationSettings,
    rng: np.random.Generator,
    run: SearchRun = UNWATCHED,
    stated_inertia: Array | None = None,
    kept: TorqueSource | None = None,
) -> Identification:
    """Identify a model and compare it with its baselines.

    Where instruments or past windows identify the vehicle and not its loop, parameters and the errors that the search
    minimises are those of the torque that they know (`freed_torque`); scores are those of the torque as measured.

    Parameters
    ----------
    training : TorqueSource
        The whole training part; input ranges and visited attitudes are taken from it, and it is judged.
    learned : TorqueSource
        The samples of it that parameters are learned from: all, or a selection, in the order of time.
    held_out : mapping of str to TorqueSource
        Data that nothing is learned from, by name (not ``training``); judged once, at the end.
    run : SearchRun, optional
        How the search is run; by default from the start to its end, without being watched.
    stated_inertia : array, shape (6,), kg m^2, optional
        Inertia stated for the vehicle, to compare with what the flight says.
    kept : TorqueSource, optional
        Data to choose on among the members of the Pareto front, for the choice `held-out`; neither learned from nor
        judged in the end.

    Raises
    ------
    ComputationError
        If no chromosome gives a finite model.
    SettingError
        If the settings ask for more than the samples give, or for a choice that the data do not allow.

    References
    ----------
    Paper section 9; method.md sections 4, 5, 7 and 8.
    """
    found = find_model(training, learned, settings, rng, run, kept)
    evaluator, freed, model, fit = found.evaluator, found.freed, found.model, found.fit
    baselines = fit_baselines(source_of(freed, training, learned)[1], fit.row_scale, settings.rank_tolerance)
    predictors = {MODEL: model.torque} | {baseline.name: baseline.torque for baseline in baselines}
    uniform = _solve(evaluator, training, uniform_chromosome(model.structure))
    if uniform is not None and model.structure.genes > 0:
        predictors[UNIFORM] = uniform[0].torque
    parts = {TRAINING: training, **held_out}
    scores = {
        part: {name: score_of(data, torque) for name, torque in predictors.items()} for part, data in parts.items()
    }
    # How much of the fuzzy part alone the samples determine beyond their noise.
    noise = float(np.sqrt(min(np.mean(scores[TRAINING][name].mse) for name in (MODEL, baselines[0].name))))
    inertia = float(np.mean(np.abs(baselines[0].parameters[:3])))
    diagnostics = FitDiagnostics(
        fit=fit,
        system=found.system,
        excitation=rule_excitation(evaluator.solver.learned, model.partitions, noise, inertia, settings.rank_tolerance),
        axes=axis_evidence(training, settings.rank_tolerance),
        rigid_body=baselines[0].parameters,
        stated=stated_inertia,
        indefinite=_count(training, lambda attitude: not_positive_definite(model.inertia(attitude).value, attitude)),
        samples={part: len(data) for part, data in parts.items()},
        outside={part: _count(data, model.outside) for part, data in parts.items()},
        vertical={part: _count(data, vertical) for part, data in parts.items()},
        scores=scores,
        learned=scores[TRAINING][MODEL] if len(learned) == len(training) else score_of(learned, model.torque),
        freed=freed,
        loop=loop_along(training, model.torque) if freed is None or freed.instrument_kind == "past" else None,
    )
    return Identification(
        **vars(diagnostics),
        **vars(found.result),
        model=model,
        ridge=evaluator.solver.curve(model.partitions),
        baselines=baselines,
        findings=tuple(findings(diagnostics)),
    )


def model_evaluator(training: TorqueSource, learned: TorqueSource, settings: IdentificationSettings) -> Evaluator:
    """Prepare the evaluator of chromosomes.

    Parameters
    ----------
    training : TorqueSource
        Gives the input ranges, and judges where the settings do not say otherwise.
    learned : TorqueSource
        Solves.

    Raises
    ------
    ComputationError
        If there is no torque to learn from.
    """
    if not any(data.torque.any() for data in learned.chunks()):
        raise ComputationError("the torque is zero at all samples to learn from; nothing can be identified from it")
    structure, over_rigid_body = model_structure(settings), settings.base == "rigid-body"
    ranges = joined_ranges(data_ranges(structure, data.motion.attitude) for data in training.chunks())
    whole = Samples.of(Ready(training, over_rigid_body), structure, ranges)
    part = whole if len(learned) == len(training) else Samples.of(Ready(learned, over_rigid_body), structure, ranges)
    judge = part if settings.judged_on == "learned" else whole
    ridge = None
    if over_rigid_body:
        scale = 1.0 / axis_scale(learned)
        part, ridge = with_folds(replace(part, scale=scale), replace(whole, scale=scale), settings.ridge)
    return Evaluator(Solver(part, ridge, settings.rank_tolerance), judge, settings.local_search, over_rigid_body)


def _solve(
    evaluator: Evaluator, training: TorqueSource, chromosome: IntArray
) -> tuple[InertiaFunctions, Fit, LeastSquares] | None:
    """Solve one chromosome in full precision; None where it has no finite model."""
    fit = evaluator.fit(chromosome)
    if fit is None:
        return None
    learned = evaluator.solver.learned
    partitions = decode(learned.structure, chromosome.astype(float))
    exact, system = evaluator.solver.exact(partitions, fit)
    visited = visited_cells(data.motion.attitude for data in training.chunks())
    model = InertiaFunctions(
        learned.structure, learned.ranges, partitions, exact.coefficients, exact.rigid_body, visited
    )
    return model, exact, system


def _count(source: TorqueSource, flag: Callable[[Array], BoolArray]) -> int:
    return sum(int(np.sum(flag(data.motion.attitude))) for data in source.chunks())


Winner = Literal["model", "rigid-body", "tie"]

# A mean squared error that is smaller by less than a hundredth, or negligible to that of no torque, decides nothing.
_TIE, _ROUNDING = 0.01, 1e-12
_MEASURES = ("mse", "max_error", "relative_error", "r2", "vaf", "r2_body")


def _score(text: str, *, frame: str = EULER, **more: Any) -> Any:
    """Describe scores by model, part and axis."""
    return about(text, "judged_model", "part", "axis", frame=frame, brief=False, **more)


@result
class Judged:
    """Scores of the model and its baselines, by model, part of the data and axis."""

    models: tuple[str, ...] = about("the model and its baselines", "judged_model")
    parts: tuple[str, ...] = about("training, held-out rest, other flights", "part")
    samples: IntArray = about("samples judged", "part")
    outside: IntArray = about("of them outside the attitudes that training visited", "part")
    mse: Array = _score("mean squared torque error", unit="(N m)^2")
    max_error: Array = _score("largest torque error", unit="N m")
    relative_error: Array = _score("largest error over largest torque", gaps=True)
    r2: Array = _score("share of the torque's variance explained", gaps=True)
    vaf: Array = _score("the same without the mean of the error: variance accounted for", gaps=True)
    r2_body: Array = _score("the same for body torque, not near a pitch of +-90 deg", gaps=True, frame=BODY)

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
        """Models that were judged together with the model itself."""
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
