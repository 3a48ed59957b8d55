"""Identify a model: search partitions, solve coefficients, judge on data not used for either."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import ComputationError
from cpfls_cli.identification.baselines import fit_baselines
from cpfls_cli.identification.chromosome import decode, uniform_chromosome
from cpfls_cli.identification.cross_validation import RidgeCurve
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.evaluator import Evaluator, Judge
from cpfls_cli.identification.excitation import RuleExcitation, rule_excitation, visited_cells
from cpfls_cli.identification.findings import findings
from cpfls_cli.identification.fit import CoefficientSolver, Fit, PlainSolver
from cpfls_cli.identification.judge import Score, score
from cpfls_cli.identification.least_squares import solve
from cpfls_cli.identification.model import Model
from cpfls_cli.identification.results import Identification
from cpfls_cli.identification.rigid_base import RigidBaseSolver
from cpfls_cli.identification.search import Progress, search
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.regressor.regressor import Regressor, data_ranges
from cpfls_cli.regressor.structure import model_structure

UNIFORM = "uniform-partitions"


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
        Called after each evaluated chromosome.

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
    evaluator = model_evaluator(training, learned, settings)
    front, history = search(evaluator, settings, rng, progress)
    solved = _solve(evaluator, front.chromosomes[front.chosen], training)
    if solved is None:
        raise ComputationError("no chromosome gave a finite model; the data may not move at all")
    model, fit = solved
    baselines = fit_baselines(learned, fit.row_scale, settings.rank_tolerance)
    predictors = {"model": model.torque} | {baseline.name: baseline.torque for baseline in baselines}
    uniform = _solve(evaluator, uniform_chromosome(model.structure), training)
    if uniform is not None and model.structure.genes > 0:
        predictors[UNIFORM] = uniform[0].torque
    parts = {"training": training, **held_out}
    scores = {part: _scores(predictors, data) for part, data in parts.items()}
    excitation = _excitation(evaluator, model, settings)
    return Identification(
        model=model,
        fit=fit,
        front=front,
        history=history,
        excitation=excitation,
        ridge=_ridge(evaluator, model),
        baselines=baselines,
        scores=scores,
        samples={name: len(data) for name, data in parts.items()},
        findings=tuple(findings(fit, excitation, scores)),
    )


def model_evaluator(training: TorqueData, learned: TorqueData, settings: IdentificationSettings) -> Evaluator:
    """Prepare the evaluator of chromosomes.

    Parameters
    ----------
    training : TorqueData
        Judges, and gives the input ranges.
    learned : TorqueData
        Solves.
    settings : IdentificationSettings

    Returns
    -------
    Evaluator
    """
    structure = model_structure(settings)
    ranges = data_ranges(structure, training.motion.attitude)
    regressor = Regressor(structure, learned.motion, ranges)
    judge = Judge.of(training, Regressor(structure, training.motion, ranges))
    solver = coefficient_solver(learned, settings)
    return Evaluator(regressor, solver, judge, settings.local_search, settings.base == "rigid-body")


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


def _solve(evaluator: Evaluator, chromosome: IntArray, training: TorqueData) -> tuple[Model, Fit] | None:
    """Solve one chromosome in full precision; None where it has no finite model."""
    fit = evaluator.fit(chromosome)
    if fit is None:
        return None
    regressor = evaluator.regressor
    partitions = decode(regressor.structure, chromosome.astype(float))
    visited = visited_cells(training.motion.attitude)
    model = Model(regressor.structure, regressor.ranges, partitions, fit.coefficients, fit.rigid_body, visited)
    return model, fit


def _scores(predictors: Mapping[str, Callable[[Motion], Array]], data: TorqueData) -> dict[str, Score]:
    return {name: score(data, torque(data.motion)) for name, torque in predictors.items()}


def _excitation(evaluator: Evaluator, model: Model, settings: IdentificationSettings) -> RuleExcitation:
    """Decompose the fuzzy part alone: what of it the samples determine, whatever lies underneath."""
    Q = evaluator.regressor.matrix(model.partitions)
    system = solve(Q.reshape(-1, Q.shape[2]), np.zeros(Q.shape[0] * 3), settings.rank_tolerance)
    return rule_excitation(evaluator.regressor, model.partitions, system)


def _ridge(evaluator: Evaluator, model: Model) -> RidgeCurve | None:
    if not isinstance(evaluator.solver, RigidBaseSolver):
        return None
    return evaluator.solver.curve(evaluator.regressor.matrix(model.partitions))
