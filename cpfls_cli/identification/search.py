"""The search for non-dominated partitions: how it is run and stopped, its result, and the choice of a member."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.evolution.archive import Archive, Evaluate, Evaluation
from cpfls_cli.evolution.engine import End, EvolutionState, History, ended, start, step
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.evaluator import OBJECTIVES, Evaluator, decode, uniform_chromosome
from cpfls_cli.identification.samples import Ready, Samples
from cpfls_cli.identification.settings import Choice, IdentificationSettings
from cpfls_cli.result import about
from cpfls_cli.rounding import at_most, levelled
from cpfls_cli.workers.workforce import Workforce, employ, gathered

Stop = Literal["time-limit", "interrupted"]
StopReason = End | Stop


def is_end(reason: StopReason) -> bool:
    """Tell a search that came to its end from one that was stopped; the parameters are those reasons."""
    return reason in get_args(End)


@dataclass(frozen=True)
class SearchStep:
    """Progress of a search.

    Attributes
    ----------
    generation : int
        The generation under evaluation; 0 is the initial population.
    generations : int
        The last one.
    share : float
        Share of its new chromosomes that are evaluated.
    best : array, shape (3,), or None
        Best of each objective up to the generation before; None during the first.
    """

    generation: int
    generations: int
    share: float
    best: Array | None


@dataclass(frozen=True)
class Unfinished:
    """Evaluated part of a generation that was not finished.

    Attributes
    ----------
    submitted : array of int, shape (evaluations, genes)
        Chromosomes as they were before the evaluation.
    """

    submitted: IntArray
    evaluation: Evaluation


def _unwatched(_: object) -> None:
    pass


@dataclass(frozen=True)
class SearchRun:
    """Conditions under which a search is run; they do not change the result of a search that comes to its end.

    `resumed`: where to go on, None starts with a new population; `unfinished`: what need not be evaluated again in the
    generation that comes first; `workers` takes the evaluator and gives the context in which workers evaluate by it,
    one chromosome after the other in this process by default; `progress` takes a `SearchStep` after each part of a
    generation; `on_generation` the state after each generation, the initial population included, which the next one
    changes; `on_stop` what is `Unfinished` where the search is stopped within one; `should_stop` says after each part
    why to stop now, or None.
    """

    resumed: EvolutionState | None = None
    unfinished: Unfinished | None = None
    workers: Callable[[Evaluate], AbstractContextManager[Workforce]] = employ
    progress: Callable[[SearchStep], None] = _unwatched
    on_generation: Callable[[EvolutionState], None] = _unwatched
    on_stop: Callable[[Unfinished], None] = _unwatched
    should_stop: Callable[[], Stop | None] = lambda: None


UNWATCHED = SearchRun()
"""From the start to the end, one chromosome after the other."""


@dataclass(frozen=True, eq=False)
class Front:
    """Non-dominated chromosomes of the whole search."""

    chromosomes: IntArray = about("16-bit weights", "member", "gene", brief=False)
    objectives: Array = about(
        "MSE (rigid-body base: cross-validated, scaled by axis), largest error, condition number",
        "member",
        "3",
        unit="SI",
        brief=False,
    )
    chosen: int = about("index of the chosen member")
    held_out: Array | None = about(
        "mean squared error on the flights kept for the choice", "member", unit="SI", gaps=True, default=None
    )


@dataclass(frozen=True)
class SearchResult:
    """Result of a search; stopped within a generation, the last row of its history is of what was evaluated of that."""

    front: Front
    history: History
    stop_reason: StopReason


class NothingFoundError(ComputationError):
    """A search ended without a finite model.

    Parameters
    ----------
    stop_reason : str
        Why it ended.
    """

    def __init__(self, stop_reason: StopReason) -> None:
        super().__init__("no chromosome gave a finite model; perhaps nothing moves in the data")
        self.stop_reason = stop_reason


class _StoppedError(Exception):
    """A stop within a generation, with the part that was evaluated."""

    def __init__(self, reason: Stop, unfinished: Unfinished) -> None:
        super().__init__(reason)
        self.reason, self.unfinished = reason, unfinished


def search(
    evaluator: Evaluator,
    settings: IdentificationSettings,
    rng: np.random.Generator,
    run: SearchRun = UNWATCHED,
    kept: TorqueSource | None = None,
) -> SearchResult:
    """Search for non-dominated partitions; one that goes on has a generator of its own.

    `kept`: flights to choose on, for the choice `held-out`, or `SettingError`; `NothingFoundError` where no chromosome
    gives a finite model.
    """
    require_flights(settings.choice, given=kept is not None)
    archive, history, reason = _searched(evaluator, settings, rng, run)
    return SearchResult(_front(archive, evaluator, kept, settings, reason), history, reason)


def _searched(
    evaluator: Evaluator, settings: IdentificationSettings, rng: np.random.Generator, run: SearchRun
) -> tuple[Archive, History, StopReason]:
    if evaluator.structure.genes == 0:
        only = evaluator(uniform_chromosome(evaluator.structure)[None])
        archive = Archive.of(only.genes, only)
        return archive, History.empty(OBJECTIVES).extended(archive), "generations"
    with run.workers(evaluator) as workers:
        return _evolved(evaluator, workers, settings, rng, run)


def _evolved(
    evaluator: Evaluator, workers: Workforce, settings: IdentificationSettings, rng: np.random.Generator, run: SearchRun
) -> tuple[Archive, History, StopReason]:
    """Breed until the end, or until asked to stop; then what of a generation is evaluated counts too."""
    state = run.resumed
    try:
        if state is None:
            structure = evaluator.structure
            initial = uniform_chromosome(structure)[None] if settings.start == "with-uniform" else None
            state = start(_watched(workers, run, settings, None), structure.genes, settings, rng, initial)
            run.on_generation(state)
        elif state.index < settings.generations:
            run.progress(SearchStep(state.index + 1, settings.generations, 0.0, state.history.best[-1]))
        while (reason := ended(state, settings) or run.should_stop()) is None:
            state = step(state, _watched(workers, run, settings, state), settings)
            run.on_generation(state)
    except _StoppedError as stopped:
        archive, history = (Archive(), History.empty(OBJECTIVES)) if state is None else (state.archive, state.history)
        run.on_stop(stopped.unfinished)
        archive.store(stopped.unfinished.submitted, stopped.unfinished.evaluation)
        return archive, history.extended(archive), stopped.reason
    return state.archive, state.history, reason


def _watched(
    workers: Workforce, run: SearchRun, settings: IdentificationSettings, before: EvolutionState | None
) -> Evaluate:
    """Gather the evaluations of a generation, show how far it has come, and stop when asked to."""
    generation, best = (0, None) if before is None else (before.index + 1, before.history.best[-1])

    def evaluate(genes: IntArray) -> Evaluation:
        ready, unknown = _recalled(genes, run.unfinished)
        done = len(genes) - len(unknown)
        for part, evaluation in workers.stream(genes[unknown]):
            ready.append((unknown[part], evaluation))
            done += len(part)
            run.progress(SearchStep(generation, settings.generations, done / len(genes), best))
            if done < len(genes) and (reason := run.should_stop()) is not None:
                rows, evaluated = gathered(ready)
                raise _StoppedError(reason, Unfinished(genes[rows], evaluated))
        return gathered(ready)[1]

    return evaluate


def _recalled(genes: IntArray, unfinished: Unfinished | None) -> tuple[list[tuple[IntArray, Evaluation]], IntArray]:
    """Return the evaluations that are known already, and the rows that are not."""
    if unfinished is None:
        return [], np.arange(len(genes))
    row_of = {chromosome.tobytes(): row for row, chromosome in enumerate(unfinished.submitted)}
    rows = np.array([row_of.get(chromosome.tobytes(), -1) for chromosome in genes])
    known, evaluation = rows[rows >= 0], unfinished.evaluation
    recalled = Evaluation(evaluation.genes[known], evaluation.objectives[known])
    return [(np.flatnonzero(rows >= 0), recalled)], np.flatnonzero(rows < 0)


def _front(
    archive: Archive,
    evaluator: Evaluator,
    kept: TorqueSource | None,
    settings: IdentificationSettings,
    reason: StopReason,
) -> Front:
    """Take the non-dominated chromosomes that have a finite model, and choose among them."""
    front = archive.front
    usable = np.isfinite(front.objectives).all(axis=1)
    if not usable.any():
        raise NothingFoundError(reason)
    genes, objectives = front.genes[usable], front.objectives[usable]
    held_out = None if kept is None else held_out_errors(evaluator, kept, genes)
    return Front(genes, objectives, choose(objectives, settings.choice, held_out), held_out)


def choose(objectives: Array, rule: Choice, held_out: Array | None = None) -> int:
    """Choose one member of a Pareto front by its mean squared error, largest error and condition number.

    `mse-below-median-condition` takes the smallest mean squared error among members whose condition number is at most
    the median of the front, `held-out` that on flights kept for the choice, or `SettingError`. method.md section 7.
    """
    require_flights(rule, given=held_out is not None)
    if held_out is not None:
        return int(np.argmin(levelled(held_out)))
    if rule == "max-error":
        return int(np.argmin(levelled(objectives[:, 1])))
    candidates = np.arange(len(objectives))
    if rule == "mse-below-median-condition":
        candidates = np.flatnonzero(at_most(objectives[:, 2], np.median(objectives[:, 2])))
    return int(candidates[np.argmin(levelled(objectives[candidates, 0]))])


def require_flights(rule: Choice, *, given: bool) -> None:
    """Require that a rule and the flights kept for the choice go together.

    Parameters
    ----------
    given : bool
        Whether there are such flights.

    Raises
    ------
    SettingError
    """
    if rule == "held-out" and not given:
        raise SettingError("choice", "needs a flight kept for the choice; add --choose-on FLIGHT")
    if rule != "held-out" and given:
        raise SettingError("choice", "does not use the flights of --choose-on; set it to held-out, or leave them out")


def held_out_errors(evaluator: Evaluator, kept: TorqueSource, chromosomes: IntArray) -> Array:
    """Compute the errors of chromosomes on data that is neither trained nor judged on in the end.

    Mean squared, of the torque in (N m)^2, or scaled by axis as the evaluator's own; infinite where a chromosome has no
    finite model.
    """
    samples = replace(
        Samples.of(Ready(kept, evaluator.judge.ready.rigid), evaluator.structure, evaluator.judge.ranges),
        scale=evaluator.solver.learned.scale,
    )
    return np.array([_error(evaluator, samples, chromosome) for chromosome in chromosomes])


def _error(evaluator: Evaluator, samples: Samples, chromosome: IntArray) -> float:
    fit = evaluator.fit(chromosome)
    if fit is None:
        return float("inf")
    partitions = decode(evaluator.structure, chromosome.astype(float))
    squares, _ = samples.errors(partitions, fit.coefficients, fit.rigid_body)
    return float(squares[0]) / (3 * len(samples.ready.source))
