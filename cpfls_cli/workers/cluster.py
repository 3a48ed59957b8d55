"""Evaluate on a cluster of Dask workers, behind the scheduler at an address; to be imported only where Dask is."""

from __future__ import annotations

import pickle
import uuid
import warnings
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager

from distributed import Client, Future, as_completed

from cpfls_cli.arrays import IntArray
from cpfls_cli.evolution.archive import Evaluate, Evaluation
from cpfls_cli.workers.attempt import Failure, result_of
from cpfls_cli.workers.chunks import chunks
from cpfls_cli.workers.cluster_errors import explained, require_workers
from cpfls_cli.workers.cluster_worker import Shipped, evaluate_shipped
from cpfls_cli.workers.quiet import quiet
from cpfls_cli.workers.same_versions import require_same_processor, require_same_versions
from cpfls_cli.workers.worker_error import WorkerError
from cpfls_cli.workers.workforce import Workforce

_LONGEST_SILENCE_S = 1.0


class Cluster(Workforce):
    """Workers of a Dask cluster, which hold the evaluator.

    A chunk whose worker vanishes goes to another one, as long as there is one.

    Parameters
    ----------
    client : Client
        Connection to the scheduler.
    name : str
        By which the evaluator was shipped.
    patience_s : float
        How long the cluster may be without workers.
    """

    def __init__(self, client: Client, name: str, patience_s: float) -> None:
        self._client = client
        self._name = name
        self._patience_s = patience_s

    def stream(self, genes: IntArray) -> Iterator[tuple[IntArray, Evaluation]]:
        """Evaluate chromosomes; parameters are those of `Workforce.stream`."""
        given: dict[Future, IntArray] = {}
        try:
            with explained(self._client):
                given.update(self._hand_out(genes))
                while given:
                    for future, outcome in self._finished(list(given)):
                        evaluation = result_of(outcome)
                        yield given.pop(future), evaluation
        finally:
            if given and self._client.status == "running":
                self._client.cancel(list(given))

    def _hand_out(self, genes: IntArray) -> dict[Future, IntArray]:
        rows = chunks(len(genes), max(sum(self._client.nthreads().values()), 1))
        parts = [genes[part] for part in rows]
        futures = self._client.map(evaluate_shipped, parts, name=self._name, pure=False)
        return dict(zip(futures, rows, strict=True))

    def _finished(self, futures: list[Future]) -> Iterator[tuple[Future, Evaluation | Failure]]:
        """Hand out what finishes before it is time to look whether anybody is still working."""
        try:
            for future, outcome in as_completed(
                futures, self._client.loop, with_results=True, timeout=_LONGEST_SILENCE_S
            ):
                if isinstance(outcome, CancelledError):
                    raise outcome
                yield future, outcome
        except TimeoutError:
            require_workers(self._client, self._patience_s)


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
        How long to wait for the scheduler, and for a worker whenever there is none.

    Raises
    ------
    WorkerError
        If the scheduler does not answer, it has no workers, or they have other versions or processors.
    """
    evaluator = pickle.dumps(evaluate, protocol=pickle.HIGHEST_PROTOCOL)
    name = f"cpfls-{uuid.uuid4().hex}"
    with _connected(address, patience_s) as client:
        with explained(client):
            require_workers(client, patience_s)
            require_same_versions(client)
            require_same_processor(client)
            client.register_plugin(Shipped(evaluator), name=name)
        try:
            yield Cluster(client, name, patience_s)
        finally:
            if client.status == "running":
                with explained(client):
                    client.unregister_worker_plugin(name)


@contextmanager
def _connected(address: str, patience_s: float) -> Iterator[Client]:
    with quiet():
        try:
            with warnings.catch_warnings():
                # Dask warns of versions that differ; here those that matter are an error.
                warnings.simplefilter("ignore")
                client = Client(address, timeout=patience_s, set_as_default=False)
        except (OSError, ImportError) as error:
            raise WorkerError(
                f"no Dask scheduler of a fitting version answers at {address} within {patience_s:g} s: start one with "
                "`dask scheduler`, and give the address that it prints"
            ) from error
        try:
            yield client
        finally:
            client.close()
