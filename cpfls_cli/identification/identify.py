"""Identify a model: search partitions, solve coefficients, judge on data not used for either."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import ComputationError
from cpfls_cli.evolution.engine import evolve
from cpfls_cli.evolution.state import Generation
from cpfls_cli.fuzzy.inputs import InputRange
from cpfls_cli.identification.baselines import Baseline, fit_baselines
from cpfls_cli.identification.choice import choose
from cpfls_cli.identification.chromosome import decode, uniform_chromosome
from cpfls_cli.identification.cross_validation import RIGID, RidgeCurve
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.evaluator import Evaluator, Judge
from cpfls_cli.identification.excitation import RuleExcitation, rule_excitation, visited_cells
from cpfls_cli.identification.fit import CoefficientSolver, Fit, PlainSolver
from cpfls_cli.identification.judge import Score, score
from cpfls_cli.identification.least_squares import LeastSquares, solve
from cpfls_cli.identification.model import Model
from cpfls_cli.identification.rigid_base import RigidBaseSolver
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.regressor.regressor import Regressor, data_ranges
from cpfls_cli.regressor.structure import model_structure

Progress = Callable[[int, int, Array], None]


@dataclass(frozen=True)
class History:
    """Course of the search.

    Attributes
    ----------
    evaluations : array of int, shape (generations + 1,)
        Chromosomes evaluated so far.
    best : array, shape (generations + 1, 3)
        Best of each objective so far.
    front_size : array of int, shape (generations + 1,)
        Members of the Pareto front so far.
    """

    evaluations: IntArray
    best: Array
    front_size: IntArray


@dataclass(frozen=True)
class Front:
    """Non-dominated chromosomes of the whole search.

    Attributes
    ----------
    chromosomes : array of int, shape (members, genes)
    objectives : array, shape (members, 3)
    chosen : int
        The member that became the model.
    """

    chromosomes: IntArray
    objectives: Array
    chosen: int


@dataclass(frozen=True)
class Identification:
    """Result of an identification.

    Attributes
    ----------
    model : Model
    fit : Fit
        The final model's linear parameters, solved in full precision.
    front : Front
    history : History
    excitation : RuleExcitation
    ridge : RidgeCurve or None
        For a rigid-body base: how the ridge weight was chosen.
    baselines : tuple of Baseline
        Fitted to the same samples.
    scores : mapping of str to mapping of str to Score
        By part of the data, then by model: ``model``, the baselines' names, and ``uniform-partitions``: the same
        structure without any search.
    samples : mapping of str to int
        Samples judged by part.
    findings : tuple of str
        What failed or was not excited, in words.
    """

    model: Model
    fit: Fit
    front: Front
    history: History
    excitation: RuleExcitation
    ridge: RidgeCurve | None
    baselines: tuple[Baseline, ...]
    scores: Mapping[str, Mapping[str, Score]]
    samples: Mapping[str, int]
    findings: tuple[str, ...]


def identify(
    training: TorqueData,
    learned: TorqueData,
    held_out: Mapping[str, TorqueData],
    settings: IdentificationSettings,
    rng: np.random.Generator,
    progress: Progress | None = None,
) -> Identification:
    """Identify a model and judge it beside its baselines.

    Parameters
    ----------
    training : TorqueData
        The whole training part; input ranges and visited attitudes are taken from it, and it is judged.
    learned : TorqueData
        The samples of it that parameters are learned from: all, or a selection, in the order of time.
    held_out : mapping of str to TorqueData
        Data that nothing is learned from, by name; judged once, at the end.
    settings : IdentificationSettings
    rng : numpy.random.Generator
    progress : callable, optional
        Called after each generation with its index, their number and the best objectives so far.

    Returns
    -------
    Identification

    Raises
    ------
    ComputationError
        If there are too few samples or no chromosome gives a finite model.

    References
    ----------
    Paper section 9; method.md sections 4, 5, 7 and 8.
    """
    structure = model_structure(settings)
    ranges = data_ranges(structure, training.motion.attitude)
    regressor = Regressor(structure, learned.motion, ranges)
    solver = coefficient_solver(learned, settings)
    judge = Judge.of(training, Regressor(structure, training.motion, ranges))
    evaluator = Evaluator(regressor, solver, judge, settings.local_search, settings.base == "rigid-body")
    front, history = search(evaluator, settings, rng, progress)
    model, fit = _model(evaluator, front.chromosomes[front.chosen], training, ranges)
    baselines = fit_baselines(learned, fit.row_scale, settings.rank_tolerance)
    parts = {"training": training, **held_out}
    predictors = {"model": model.torque} | {baseline.name: baseline.torque for baseline in baselines}
    if structure.genes > 0:
        predictors["uniform-partitions"] = _model(evaluator, uniform_chromosome(structure), training, ranges)[0].torque
    scores = {part: _scores(predictors, data) for part, data in parts.items()}
    excitation = rule_excitation(regressor, model.partitions, _fuzzy_system(regressor, model.partitions, settings))
    ridge = solver.curve(regressor.matrix(model.partitions)) if isinstance(solver, RigidBaseSolver) else None
    return Identification(
        model=model,
        fit=fit,
        front=front,
        history=history,
        excitation=excitation,
        ridge=ridge,
        baselines=baselines,
        scores=scores,
        samples={name: len(data) for name, data in parts.items()},
        findings=tuple(findings(fit, excitation, scores)),
    )


def coefficient_solver(learned: TorqueData, settings: IdentificationSettings) -> CoefficientSolver:
    """Prepare the solver that the base asks for.

    Parameters
    ----------
    learned : TorqueData
    settings : IdentificationSettings

    Returns
    -------
    CoefficientSolver

    Raises
    ------
    ComputationError
        If there are too few samples for the base.
    """
    if settings.base == "none":
        return PlainSolver(learned.torque, settings.rank_tolerance)
    if len(learned) < 2 * settings.ridge.folds:
        raise ComputationError(
            f"{len(learned)} samples are too few for {settings.ridge.folds} blocks of cross-validation; "
            "select more samples or lower identification.ridge.folds"
        )
    return RigidBaseSolver.of(learned, settings.ridge, settings.rank_tolerance)


def search(
    evaluator: Evaluator, settings: IdentificationSettings, rng: np.random.Generator, progress: Progress | None
) -> tuple[Front, History]:
    """Search for non-dominated partitions.

    Parameters
    ----------
    evaluator : Evaluator
    settings : IdentificationSettings
    rng : numpy.random.Generator
    progress : callable, optional

    Returns
    -------
    front : Front
    history : History

    Raises
    ------
    ComputationError
        If no chromosome gives a finite model.
    """
    structure = evaluator.regressor.structure
    if structure.genes == 0:
        only = evaluator(uniform_chromosome(structure)[None])
        objectives = only.objectives
        history = History(np.array([1]), objectives, np.array([1]))
        return Front(only.genes, objectives, 0), history
    generations: list[Generation] = []
    initial = uniform_chromosome(structure)[None] if settings.start == "with-uniform" else None
    for generation in evolve(evaluator, structure.genes, settings, rng, initial):
        generations.append(generation)
        if progress is not None:
            progress(generation.index, settings.generations, _best(generation))
    last = generations[-1]
    usable = np.isfinite(last.front_objectives).all(axis=1)
    if not usable.any():
        raise ComputationError("no chromosome gave a finite model; the data may not move at all")
    objectives = last.front_objectives[usable]
    front = Front(last.front_genes[usable], objectives, choose(objectives, settings.choice))
    history = History(
        np.array([g.evaluations for g in generations]),
        np.array([_best(g) for g in generations]),
        np.array([len(g.front_genes) for g in generations]),
    )
    return front, history


def _best(generation: Generation) -> Array:
    return np.asarray(np.min(generation.front_objectives, axis=0))


def _model(
    evaluator: Evaluator, chromosome: IntArray, training: TorqueData, ranges: tuple[InputRange, InputRange]
) -> tuple[Model, Fit]:
    """Solve one chromosome in full precision."""
    structure = evaluator.regressor.structure
    fit = evaluator.fit(chromosome)
    if fit is None:
        raise ComputationError("no chromosome gave a finite model; the data may not move at all")
    partitions = decode(structure, chromosome.astype(float))
    visited = visited_cells(training.motion.attitude)
    return Model(structure, ranges, partitions, fit.coefficients, fit.rigid_body, visited), fit


def _scores(predictors: Mapping[str, Callable[[Motion], Array]], data: TorqueData) -> dict[str, Score]:
    return {name: score(data, torque(data.motion)) for name, torque in predictors.items()}


def _fuzzy_system(
    regressor: Regressor, partitions: tuple[Array, ...], settings: IdentificationSettings
) -> LeastSquares:
    """Decompose the fuzzy part alone: what of it the samples determine, whatever lies underneath."""
    Q = regressor.matrix(partitions)
    return solve(Q.reshape(-1, Q.shape[2]), np.zeros(Q.shape[0] * 3), settings.rank_tolerance)


def findings(fit: Fit, excitation: RuleExcitation, scores: Mapping[str, Mapping[str, Score]]) -> list[str]:
    """Say in words what failed or was not excited.

    Parameters
    ----------
    fit : Fit
    excitation : RuleExcitation
    scores : mapping
        By part, then by model.

    Returns
    -------
    list of str
    """
    found = []
    parameters = len(fit.coefficients) + (RIGID if np.any(fit.rigid_body) else 0)
    if fit.system.rank < min(parameters, fit.system.row_space.shape[1]):
        found.append(f"rank {fit.system.rank} of {fit.system.row_space.shape[1]}: the minimum-norm solution was taken")
    silent = [name for name, excited in zip(excitation.name, excitation.excited, strict=True) if not excited]
    if silent:
        found.append(f"{len(silent)} of {len(excitation.name)} rules not excited: {', '.join(silent)}")
    if np.isinf(fit.ridge_weight):
        found.append("cross-validation switched the fuzzy part off: the data hold no evidence beyond the rigid body")
    rigid = scores["training"]["rigid-body"].r2_body
    for axis, explained in zip(("roll", "pitch", "yaw"), rigid, strict=True):
        if not explained > 0.5:
            found.append(
                f"{axis} is hardly excited: the motion explains less than half of its torque in training (R2 of the "
                f"rigid body {explained:.2f}); do not trust this axis"
            )
    for part, by_model in scores.items():
        worse = by_model["model"].mse.sum() > by_model["rigid-body"].mse.sum() * (1 + 1e-9)
        if part != "training" and worse:
            found.append(f"{part}: the model is worse than the rigid body with six inertia parameters")
    return found
