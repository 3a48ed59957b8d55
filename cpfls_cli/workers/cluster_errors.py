"""What goes wrong with a cluster, in words."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager

from distributed import Client, KilledWorker

from cpfls_cli.errors import ComputationError
from cpfls_cli.workers.worker_error import WorkerError


def require_workers(client: Client, patience_s: float) -> None:
    """Require that a scheduler has a worker.

    Parameters
    ----------
    client : Client
        Connection to the scheduler.
    patience_s : float
        How long to wait for one.

    Raises
    ------
    WorkerError
        If there is none, or none is left.
    """
    try:
        client.wait_for_workers(1, timeout=patience_s)
    except TimeoutError as error:
        address = client.scheduler.address
        raise WorkerError(
            f"the Dask scheduler at {address} has no workers: start some with `dask worker {address} --nthreads 1`; "
            "where they vanished because their machines ran out of memory, start fewer on each"
        ) from error


@contextmanager
def explained(client: Client) -> Iterator[None]:
    """Say in words what Dask raises, which is of many types.

    Parameters
    ----------
    client : Client
        Connection to the scheduler.

    Raises
    ------
    WorkerError
        In place of whatever Dask raises.
    """
    try:
        yield
    except ComputationError:
        raise
    except Exception as error:
        raise WorkerError(_words(error, client)) from error


def _words(error: Exception, client: Client) -> str:
    if client.status != "running":
        return "the Dask scheduler vanished: start it and its workers again"
    if isinstance(error, (KilledWorker, CancelledError)):
        return (
            "one Dask worker after the other vanished while it evaluated the same chromosomes; where their machines "
            "ran out of memory, start fewer workers on each, or add memory"
        )
    return f"the Dask cluster failed with {type(error).__name__}: {error}"
