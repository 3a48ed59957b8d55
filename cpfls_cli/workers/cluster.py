"""Evaluate on a cluster of Dask workers, behind the scheduler at an address."""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from typing import TYPE_CHECKING

from cpfls_cli.arrays import IntArray
from cpfls_cli.errors import ComputationError
from cpfls_cli.evolution.archive import Evaluate, Evaluation
from cpfls_cli.workers.address import require_address
from cpfls_cli.workers.attempt import result_of
from cpfls_cli.workers.chunks import chunks
from cpfls_cli.workers.cluster_worker import Shipped, evaluate_shipped
from cpfls_cli.workers.quiet import quiet
from cpfls_cli.workers.same_versions import require_same_versions
from cpfls_cli.workers.workforce import Workforce

if TYPE_CHECKING:
    from distributed import Client, Future

_LONGEST_SILENCE_S = 2.0


class Cluster(Workforce):
    """Workers of a Dask cluster, which hold the evaluator.

    A chunk whose worker vanishes goes to another one, as long as there is one.

    Parameters
    ----------
    client : Client
        Connection to the scheduler.
    shipped : Future
        The evaluator, on all workers.
    address : str
        Of the scheduler, for messages.
    """

    def __init__(self, client: Client, shipped: Future, address: str) -> None:
        self._client = client
        self._shipped = shipped
        self._address = address

    def stream(self, genes: IntArray) -> Iterator[tuple[IntArray, Evaluation]]:
        """Evaluate chromosomes; parameters are those of `Workforce.stream`."""
        given: dict[Future, IntArray] = {}
        try:
            with _explained(self._client, self._address):
                given.update(self._hand_out(genes))
                while given:
                    for future in self._finished(list(given)):
                        evaluation: Evaluation = result_of(future.result())
                        yield given.pop(future), evaluation
        finally:
            if given and self._client.status == "running":
                self._client.cancel(list(given))

    def _hand_out(self, genes: IntArray) -> dict[Future, IntArray]:
        threads = sum(self._client.nthreads().values())
        return {
            self._client.submit(evaluate_shipped, self._shipped, genes[rows], pure=False): rows
            for rows in chunks(len(genes), max(threads, 1))
        }

    def _finished(self, futures: list[Future]) -> list[Future]:
        from distributed import wait

        while True:
            try:
                with self._client.as_current():
                    return list(wait(futures, timeout=_LONGEST_SILENCE_S, return_when="FIRST_COMPLETED").done)
            except TimeoutError:
                _require_workers(self._client, self._address)


@contextmanager
def cluster(evaluate: Evaluate, address: str, *, patience_s: float = 10.0) -> Iterator[Cluster]:
    """Connect to a cluster and send the evaluator to all of its workers, once.

    Parameters
    ----------
    evaluate : callable
        Evaluator of chromosomes that can be pickled.
    address : str
        Of the scheduler, `tcp://host:port`.
    patience_s : float
        How long to wait for the scheduler, and then for its first worker.

    Yields
    ------
    Cluster

    Raises
    ------
    InputError
        If the address is none.
    ComputationError
        If Dask is not installed, the scheduler does not answer, it has no workers, or they have other versions.
    """
    evaluator = pickle.dumps(evaluate, protocol=pickle.HIGHEST_PROTOCOL)
    with _connected(address, patience_s) as client:
        with _explained(client, address):
            _require_workers(client, address, patience_s)
            require_same_versions(client)
            shipped = client.scatter(Shipped(evaluator), broadcast=True, hash=False)
        yield Cluster(client, shipped, address)


@contextmanager
def _connected(address: str, patience_s: float) -> Iterator[Client]:
    require_address(address)
    try:
        from distributed import Client
    except ModuleNotFoundError as error:
        raise ComputationError(
            f"a scheduler needs Dask, which is not installed here ({error}): pip install 'cpfls[dask]'"
        ) from error
    with quiet():
        try:
            with warnings.catch_warnings():
                # Dask warns of versions that differ; here those that matter are an error.
                warnings.simplefilter("ignore")
                client = Client(address, timeout=patience_s, set_as_default=False)
        except (OSError, ImportError) as error:
            raise ComputationError(
                f"no Dask scheduler of a fitting version answers at {address} within {patience_s:g} s: start one with "
                "`dask scheduler`, and give the address that it prints"
            ) from error
        try:
            yield client
        finally:
            client.close()


def _require_workers(client: Client, address: str, patience_s: float = _LONGEST_SILENCE_S) -> None:
    try:
        client.wait_for_workers(1, timeout=patience_s)
    except TimeoutError as error:
        raise ComputationError(
            f"the Dask scheduler at {address} has no workers: start some with `dask worker {address} --nthreads 1`"
        ) from error


@contextmanager
def _explained(client: Client, address: str) -> Iterator[None]:
    """Say in words what Dask raises, which is of many types."""
    try:
        yield
    except ComputationError:
        raise
    except Exception as error:
        raise ComputationError(_words(error, client, address)) from error


def _words(error: Exception, client: Client, address: str) -> str:
    if client.status != "running":
        return f"the Dask scheduler at {address} vanished: start it and its workers again"
    if isinstance(error, CancelledError) or type(error).__name__ == "KilledWorker":
        return (
            f"the workers of the Dask scheduler at {address} vanished; where their machines ran out of memory, take "
            "fewer workers on each, or add memory"
        )
    return f"the Dask cluster at {address} failed with {type(error).__name__}: {error}"
