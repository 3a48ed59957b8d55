"""Identify a model: search partitions, solve coefficients, judge on data not used for either."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.identification.axes import axis_evidence
from cpfls_cli.identification.baselines import Baseline, fit_baselines
from cpfls_cli.identification.chromosome import decode, uniform_chromosome
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.evaluator import Evaluator, Judge
from cpfls_cli.identification.excitation import RuleExcitation, rule_excitation, visited_cells
from cpfls_cli.identification.findings import Evidence, findings
from cpfls_cli.identification.fit import CoefficientSolver, Fit, PlainSolver
from cpfls_cli.identification.judge import Score, score
from cpfls_cli.identification.model import Model
from cpfls_cli.identification.physics import not_positive_definite
from cpfls_cli.identification.results import Identification
from cpfls_cli.identification.rigid_base import RigidBaseSolver
from cpfls_cli.identification.search import search
from cpfls_cli.identification.search_run import UNWATCHED, SearchRun
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.regressor.regressor import Regressor, data_ranges
from cpfls_cli.regressor.structure import model_structure

TRAINING = "training"
UNIFORM = "uniform-partitions"


def identify(
    training: TorqueData,
    learned: TorqueData,
    held_out: Mapping[str, TorqueData],
    settings: IdentificationSettings,
    rng: np.random.Generator,
    run: SearchRun = UNWATCHED,
    stated_inertia: Array | None = None,
) -> Identification:
    """Identify a model and judge it beside its baselines.

    Parameters
    ----------
    training : TorqueData
        The whole training part; input ranges and visited attitudes are taken from it, and it is judged.
    learned : TorqueData
        The samples of it that parameters are learned from: all, or a selection, in the order of time.
    held_out : mapping of str to TorqueData
        Data that nothing is learned from, by name (not ``training``); judged once, at the end.
    settings : IdentificationSettings
    rng : numpy.random.Generator
    run : SearchRun, optional
        How the search is run; by default from the start to its end, without being watched.
    stated_inertia : array, shape (6,), kg m^2, optional
        Inertia stated for the vehicle, to compare with what the flight says.

    Returns
    -------
    Identification

    Raises
    ------
    ComputationError
        If no chromosome gives a finite model.
    SettingError
        If the settings ask for more than the samples give.

    References
    ----------
    Paper section 9; method.md sections 4, 5, 7 and 8.
    """
    evaluator = model_evaluator(training, learned, settings)
    found = search(evaluator, settings, rng, run)
    solved = _solve(evaluator, found.front.chromosomes[found.front.chosen], training)
    if solved is None:
        raise ComputationError("no chromosome gave a finite model; the data may not move at all")
    model, fit = solved
    baselines = fit_baselines(learned, fit.row_scale, settings.rank_tolerance)
    predictors = {"model": model.torque} | {baseline.name: baseline.torque for baseline in baselines}
    uniform = _solve(evaluator, uniform_chromosome(model.structure), training)
    if uniform is not None and model.structure.genes > 0:
        predictors[UNIFORM] = uniform[0].torque
    parts = {TRAINING: training, **held_out}
    scores = {part: _scores(predictors, data) for part, data in parts.items()}
    evidence = Evidence(
        fit=fit,
        system=evaluator.solver.unpenalised(model.partitions, fit),
        excitation=_excitation(evaluator, model, baselines[0], scores[TRAINING], settings),
        axes=axis_evidence(training, settings.rank_tolerance),
        rigid_body=baselines[0].parameters,
        stated=stated_inertia,
        indefinite=int(np.sum(not_positive_definite(model.inertia(training.motion.attitude).value))),
        samples={part: len(data) for part, data in parts.items()},
        outside={part: int(np.sum(model.outside(data.motion.attitude))) for part, data in parts.items()},
        scores=scores,
    )
    ridge = evaluator.solver.curve(model.partitions) if isinstance(evaluator.solver, RigidBaseSolver) else None
    told = tuple(findings(evidence))
    return Identification(**vars(evidence), **vars(found), model=model, ridge=ridge, baselines=baselines, findings=told)


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
    whole = Regressor(structure, training.motion, ranges)
    selected = whole if len(learned) == len(training) else Regressor(structure, learned.motion, ranges)
    solver = _solver((learned, selected), (training, whole), settings)
    return Evaluator(solver, Judge.of(training, whole), settings.local_search, settings.base == "rigid-body")


def _solver(
    learned: tuple[TorqueData, Regressor], training: tuple[TorqueData, Regressor], settings: IdentificationSettings
) -> CoefficientSolver:
    """Prepare the solver that the base asks for."""
    data, regressor = learned
    if settings.base == "none":
        return PlainSolver(regressor, data.torque, settings.rank_tolerance)
    if len(data) < 2 * settings.ridge.folds:
        raise SettingError("ridge.folds", f"{len(data)} samples are too few for that many blocks; use more samples")
    return RigidBaseSolver.of(learned, training, settings.ridge, settings.rank_tolerance)


def _solve(evaluator: Evaluator, chromosome: IntArray, training: TorqueData) -> tuple[Model, Fit] | None:
    """Solve one chromosome in full precision; None where it has no finite model."""
    fit = evaluator.fit(chromosome)
    if fit is None:
        return None
    regressor = evaluator.solver.regressor
    partitions = decode(regressor.structure, chromosome.astype(float))
    visited = visited_cells(training.motion.attitude)
    model = Model(regressor.structure, regressor.ranges, partitions, fit.coefficients, fit.rigid_body, visited)
    return model, fit


def _scores(predictors: Mapping[str, Callable[[Motion], Array]], data: TorqueData) -> dict[str, Score]:
    return {name: score(data, torque(data.motion)) for name, torque in predictors.items()}


def _excitation(
    evaluator: Evaluator,
    model: Model,
    rigid_body: Baseline,
    scores: Mapping[str, Score],
    settings: IdentificationSettings,
) -> RuleExcitation:
    """Measure what of the fuzzy part alone the samples determine beyond their noise, whatever lies underneath."""
    regressor = evaluator.solver.regressor
    Q = regressor.matrix(model.partitions)
    noise = float(np.sqrt(min(np.mean(scores[name].mse) for name in ("model", rigid_body.name))))
    inertia = float(np.mean(np.abs(rigid_body.parameters[:3])))
    return rule_excitation(regressor, model.partitions, Q, noise, inertia, settings.rank_tolerance)
