"""The search for non-dominated partitions: the genetic algorithm over a model's evaluator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.errors import ComputationError
from cpfls_cli.evolution.archive import Archive, Evaluate, Evaluation
from cpfls_cli.evolution.engine import start, step
from cpfls_cli.evolution.state import EvolutionState, History, ended
from cpfls_cli.identification.choice import choose, require_flights
from cpfls_cli.identification.chromosome import uniform_chromosome
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.evaluator import OBJECTIVES, Evaluator
from cpfls_cli.identification.held_out import held_out_errors
from cpfls_cli.identification.results import Front
from cpfls_cli.identification.search_run import UNWATCHED, SearchRun, SearchStep, Stop, StopReason, Unfinished
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.workers.workforce import Workforce, gathered


@dataclass(frozen=True)
class SearchResult:
    """What a search found.

    Attributes
    ----------
    front : Front
    history : History
        Where the search stopped within a generation, the last row is of what was evaluated of it.
    stop_reason : str
        ``generations`` or ``converged`` for a search that came to its end, else ``time-limit`` or ``interrupted``.
    """

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
        super().__init__("no chromosome gave a finite model; the data may not move at all")
        self.stop_reason = stop_reason


class _StoppedError(Exception):
    """Leave a generation, with what was evaluated of it."""

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
    """Search for non-dominated partitions.

    Parameters
    ----------
    evaluator : Evaluator
    settings : IdentificationSettings
    rng : numpy.random.Generator
        Not used by a search that goes on, which has its own.
    run : SearchRun
    kept : TorqueSource, optional
        Flights to choose on, for the choice `held-out`.

    Raises
    ------
    NothingFoundError
        If no chromosome gives a finite model.
    SettingError
        If the choice and the flights to choose on do not go together.
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
    evaluator: Evaluator,
    workers: Workforce,
    settings: IdentificationSettings,
    rng: np.random.Generator,
    run: SearchRun,
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
    """Take what is evaluated already; also the rows that are not."""
    if unfinished is None:
        return [], np.arange(len(genes))
    row_of = {chromosome.tobytes(): row for row, chromosome in enumerate(unfinished.submitted)}
    found = np.array([row_of.get(chromosome.tobytes(), -1) for chromosome in genes])
    known, evaluation = found[found >= 0], unfinished.evaluation
    recalled = Evaluation(evaluation.genes[known], evaluation.objectives[known])
    return [(np.flatnonzero(found >= 0), recalled)], np.flatnonzero(found < 0)


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
