"""How one search is run: where it starts, where it evaluates, who watches it and when it stops."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Literal, get_args

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.archive import Evaluate, Evaluation
from cpfls_cli.evolution.state import End, EvolutionState
from cpfls_cli.workers.employ import employ
from cpfls_cli.workers.workforce import Workforce

Stop = Literal["time-limit", "interrupted"]
StopReason = End | Stop


def is_end(reason: StopReason) -> bool:
    """Tell a search that came to its end from one that was stopped; the parameters are those reasons."""
    return reason in get_args(End)


@dataclass(frozen=True)
class SearchStep:
    """How far a search has come.

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
    """What was evaluated of a generation that was not finished.

    Attributes
    ----------
    submitted : array of int, shape (evaluations, genes)
        Chromosomes as they were before the evaluation.
    evaluation : Evaluation
    """

    submitted: IntArray
    evaluation: Evaluation


def _unwatched(_: object) -> None:
    pass


def _unstopped() -> None:
    return None


@dataclass(frozen=True)
class SearchRun:
    """How one search is run; nothing of it changes what a search that comes to its end finds.

    Attributes
    ----------
    resumed : EvolutionState or None
        Where to go on; None starts with a new population.
    unfinished : Unfinished or None
        What need not be evaluated again in the generation that comes first.
    workers : callable
        Takes the evaluator; gives the context in which workers evaluate by it, one chromosome after the other in
        this process by default.
    progress : callable
        Takes a `SearchStep`, after each part of a generation that was evaluated.
    on_generation : callable
        Takes the state after each generation, the initial population included. The next generation changes it.
    on_stop : callable
        Takes what is `Unfinished` where the search is stopped within a generation.
    should_stop : callable
        Asked after each part of a generation: why to stop now, or None.
    """

    resumed: EvolutionState | None = None
    unfinished: Unfinished | None = None
    workers: Callable[[Evaluate], AbstractContextManager[Workforce]] = employ
    progress: Callable[[SearchStep], None] = _unwatched
    on_generation: Callable[[EvolutionState], None] = _unwatched
    on_stop: Callable[[Unfinished], None] = _unwatched
    should_stop: Callable[[], Stop | None] = _unstopped


UNWATCHED = SearchRun()
"""From the start to the end, one chromosome after the other."""
