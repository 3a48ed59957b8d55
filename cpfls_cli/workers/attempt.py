"""Carry a failure from a worker to whoever waits for its result.

Failures travel as plain text, because not every exception survives being pickled.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from cpfls_cli.errors import ComputationError, CpflsError
from cpfls_cli.workers.worker_error import WorkerError

_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Failure:
    """What went wrong in a worker.

    Parameters
    ----------
    message : str
        For the user.
    origin : str
        Traceback in the worker, for whoever looks for a fault of the program; empty where the message says all.
    of_data : bool
        Whether it is the data that cannot be worked on, whoever works.
    """

    message: str
    origin: str = ""
    of_data: bool = False


def attempt(work: Callable[[], _Result]) -> _Result | Failure:
    """Do some work and return its result, or else what went wrong."""
    try:
        return work()
    except CpflsError as error:
        return Failure(str(error), of_data=True)
    except MemoryError:
        return Failure("a worker ran out of memory: take fewer workers, or give the machine more memory")
    except Exception as error:
        kind = type(error).__name__
        message = f"a worker failed with {kind}: {error}; take one worker without a scheduler to see more"
        return Failure(message, traceback.format_exc())


def result_of(outcome: _Result | Failure) -> _Result:
    """Return what an attempt brought, or raise what it failed with.

    Raises
    ------
    ComputationError
        With the message of a failure that is in the data.
    WorkerError
        With the message of any other; the worker's traceback, if there is one, is a note on it.
    """
    if isinstance(outcome, Failure):
        error = ComputationError(outcome.message) if outcome.of_data else WorkerError(outcome.message)
        if outcome.origin:
            error.add_note(outcome.origin)
        raise error
    return outcome
