"""Choose where chromosomes are evaluated: in this process, in processes beside it, or on a cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from urllib.parse import urlsplit

from cpfls_cli.arrays import IntArray
from cpfls_cli.errors import InputError, install_command
from cpfls_cli.evolution.archive import Evaluate, Evaluation
from cpfls_cli.workers.processes import processes
from cpfls_cli.workers.workforce import WorkerError, Workforce, chunks

_SCHEMES = ("tcp", "tls")


def employ(evaluate: Evaluate, *, count: int = 1, scheduler: str | None = None) -> AbstractContextManager[Workforce]:
    """Employ workers to evaluate chromosomes; the result is the same for all kinds.

    Parameters
    ----------
    evaluate : callable
        Evaluator of chromosomes that treats each by itself. Pickled, unless one worker evaluates here.
    count : int
        Processes on this machine; 1 evaluates in this one. Not used with a scheduler, which knows its own workers.
    scheduler : str, optional
        Address of a Dask scheduler, `tcp://host:port`.

    Returns
    -------
    context manager of Workforce
        Leaving it ends the processes, or the connection; not to be used again after an interrupt.

    Raises
    ------
    InputError
        If the address of the scheduler is none.
    WorkerError
        If Dask is not installed; on entry, if the workers cannot be had; in use, if one vanishes or fails.
    ComputationError
        In use, if the evaluator refuses its data.
    """
    if scheduler is not None:
        return _cluster(evaluate, scheduler)
    if count > 1:
        return processes(evaluate, count)
    return nullcontext(Serial(evaluate))


def _cluster(evaluate: Evaluate, address: str) -> AbstractContextManager[Workforce]:
    require_address(address)
    try:
        from cpfls_cli.workers.cluster import cluster
    except ModuleNotFoundError as error:
        raise WorkerError(
            f"a scheduler needs Dask, which is not installed here ({error}): {install_command('dask')}"
        ) from error
    return cluster(evaluate, address)


class Serial(Workforce):
    """The evaluator itself, row by row, so that it can be stopped between any two."""

    def __init__(self, evaluate: Evaluate) -> None:
        self._evaluate = evaluate

    def stream(self, genes: IntArray) -> Iterator[tuple[IntArray, Evaluation]]:
        """Evaluate chromosomes in order; parameters are those of `Workforce.stream`."""
        for rows in chunks(len(genes), max(len(genes), 1)):
            yield rows, self._evaluate(genes[rows])


def require_address(address: str) -> None:
    """Require that a text is an address.

    Raises
    ------
    InputError
        If it is not of the form tcp://host:port, or tls://host:port.
    """
    try:
        parts = urlsplit(address)
        complete = parts.scheme in _SCHEMES and bool(parts.hostname) and bool(parts.port)
    except ValueError:
        complete = False
    if not complete:
        raise InputError(
            f"scheduler = {address}: not an address; expected tcp://host:port, such as tcp://10.0.0.1:8786"
        )
