"""Choose where chromosomes are evaluated."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext

from cpfls_cli.evolution.archive import Evaluate
from cpfls_cli.workers.address import require_address
from cpfls_cli.workers.processes import processes
from cpfls_cli.workers.serial import Serial
from cpfls_cli.workers.worker_error import WorkerError
from cpfls_cli.workers.workforce import Workforce


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
            f"a scheduler needs Dask, which is not installed here ({error}): pip install 'cpfls[dask]'"
        ) from error
    return cluster(evaluate, address)
