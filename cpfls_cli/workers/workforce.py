"""The interface of all kinds of workers, the shares of rows that they get, and the failures that they report."""

from __future__ import annotations

import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.errors import ComputationError, CpflsError
from cpfls_cli.evolution.archive import Evaluation

_CHUNKS_PER_WORKER = 4
_Result = TypeVar("_Result")


class Workforce(ABC):
    """Evaluate chromosomes, and yield each part as soon as it is finished.

    The evaluator must treat each chromosome by itself, whatever others it is given with. Then the result does not
    depend on the number or the kind of workers.
    """

    @abstractmethod
    def stream(self, genes: IntArray) -> Iterator[tuple[IntArray, Evaluation]]:
        """Evaluate chromosomes and hand out each part as soon as it is finished, in any order.

        Whoever stops iterating and closes the iterator gives up the rest: what has not begun is never begun, and
        what is under way is thrown away.

        Parameters
        ----------
        genes : array of int, shape (individuals, genes)

        Yields
        ------
        rows : array of int, shape (part,)
            Rows of `genes`; each appears once over all parts.
        evaluation : Evaluation
            Of these rows, in their order.

        Raises
        ------
        WorkerError
            If a worker vanishes or fails.
        ComputationError
            If the evaluator refuses its data.
        """

    def __call__(self, genes: IntArray) -> Evaluation:
        """Evaluate chromosomes and wait for all of them; the interface of an evaluator."""
        return gathered(list(self.stream(genes)))[1]


def gathered(parts: Sequence[tuple[IntArray, Evaluation]]) -> tuple[IntArray, Evaluation]:
    """Put evaluations in the order of their rows, whatever the order they came in.

    Parameters
    ----------
    parts : sequence of (array of int, Evaluation)
        Rows and their evaluation, at least one part; no row twice.

    Returns
    -------
    rows : array of int, shape (evaluations,)
        Ascending.
    evaluation : Evaluation
        In their order.
    """
    rows = np.concatenate([rows for rows, _ in parts])
    order = np.argsort(rows)
    genes = np.concatenate([evaluation.genes for _, evaluation in parts])
    objectives = np.concatenate([evaluation.objectives for _, evaluation in parts])
    return rows[order], Evaluation(genes[order], objectives[order])


def chunks(rows: int, workers: int) -> list[IntArray]:
    """Cut rows into chunks that shrink towards the end, down to a single row; one empty chunk where there are none.

    Each chunk takes a fixed share of what is left, so there are few of them, and yet nobody waits long for the last
    one, however uneven the rows are. Polychronopoulos and Kuck, Guided self-scheduling, IEEE Transactions on Computers
    C-36(12), 1987.
    """
    bounds = [0]
    while bounds[-1] < rows:
        remaining = rows - bounds[-1]
        bounds.append(bounds[-1] - (-remaining // (_CHUNKS_PER_WORKER * workers)))
    return np.split(np.arange(rows), bounds[1:-1])


class WorkerError(ComputationError):
    """Workers cannot be had, vanished, or failed for a reason that is not in the data."""


@dataclass(frozen=True)
class Failure:
    """Failure of a worker, as plain text for the user.

    `origin`: traceback in the worker, for whoever looks for a fault of the program, empty where the message says all;
    `of_data`: whether it is the data that cannot be worked on, whoever works.
    """

    message: str
    origin: str = ""
    of_data: bool = False


def attempt(work: Callable[[], _Result]) -> _Result | Failure:
    """Do some work and return its result, or else its failure.

    Failures travel as plain text, because not every exception survives being pickled.
    """
    try:
        return work()
    except CpflsError as error:
        return Failure(str(error), of_data=True)
    except MemoryError:
        return Failure("a worker ran out of memory: use fewer workers, or add memory")
    except Exception as error:
        kind = type(error).__name__
        message = f"a worker failed with {kind}: {error}; use one worker without a scheduler to see more"
        return Failure(message, traceback.format_exc())


def result_of(outcome: _Result | Failure) -> _Result:
    """Return the result of an attempt, or raise its failure: one in the data as `ComputationError`.

    Any other is a `WorkerError`, with the worker's traceback as a note.
    """
    if isinstance(outcome, Failure):
        error = ComputationError(outcome.message) if outcome.of_data else WorkerError(outcome.message)
        if outcome.origin:
            error.add_note(outcome.origin)
        raise error
    return outcome
