"""Evaluate on a cluster of Dask workers, behind the scheduler at an address, that compute alike.

To be imported only where Dask is.
"""

from __future__ import annotations

import logging
import pickle
import platform
import threading
import uuid
import warnings
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

from distributed import Client, Future, KilledWorker, WorkerPlugin, as_completed, get_worker
from threadpoolctl import threadpool_limits

from cpfls_cli.arrays import IntArray
from cpfls_cli.errors import ComputationError
from cpfls_cli.evolution.archive import Evaluate, Evaluation
from cpfls_cli.workers.workforce import Failure, WorkerError, Workforce, attempt, chunks, result_of

if TYPE_CHECKING:
    from distributed import Client

# llvmlite holds the compiler behind numba.
_PACKAGES = ("cpfls", "numpy", "scipy", "numba", "llvmlite")


def require_same_versions(client: Client) -> None:
    """Require that all workers have the packages that make the result, in the versions of this process."""
    for package in _PACKAGES:
        here = version(package)
        for worker, answer in client.run(version, package, on_error="return").items():
            if answer != here:
                raise WorkerError(
                    f"the Dask worker {worker} has {_side_by_side(package, answer)}, and here is {package} {here}: "
                    "install the same versions everywhere"
                )


def require_same_processor(client: Client) -> None:
    """Require that the compiler makes the same code for all workers as for this process."""
    here = processor()
    for worker, answer in client.run(processor, on_error="return").items():
        if answer != here:
            raise WorkerError(
                f"the Dask worker {worker} runs on {_described(answer, here)}, and here is {here.name}: other "
                "processors add numbers in another order, which gives other digits; start workers on machines with "
                "this processor only, or start `cpfls` on one like theirs"
            )


def _side_by_side(package: str, answer: object) -> str:
    if isinstance(answer, PackageNotFoundError):
        return f"no {package}"
    return f"{package} {answer}"


def _described(answer: object, here: Processor) -> str:
    if not isinstance(answer, Processor):
        return f"an unknown processor ({answer})"
    if answer.name != here.name:
        return answer.name
    return f"{answer.name} with other instructions ({', '.join(sorted(answer.instructions ^ here.instructions))})"


@dataclass(frozen=True)
class Processor:
    """Processor that a compiler makes code for: architecture and model, and extensions that may be used."""

    name: str
    instructions: frozenset[str]


def processor() -> Processor:
    """Describe the processor of this machine."""
    # The compiler behind numba; slow to load, and needed only where workers are elsewhere.
    compiler = import_module("llvmlite.binding")
    usable = (name for name, there in compiler.get_host_cpu_features().items() if there)
    return Processor(f"{platform.machine()} {compiler.get_host_cpu_name()}", frozenset(usable))


_LONGEST_SILENCE_S = 1.0


# Those that Dask gives a level or a handler of their own; all others take theirs from these.
_NOISY = ("distributed", "distributed.client", "tornado", "tornado.application", "asyncio")


class Cluster(Workforce):
    """Workers of a Dask cluster, which hold the evaluator that was shipped by a name.

    A chunk whose worker vanishes goes to another one, as long as there is one, for so long that the cluster may be
    without.
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
    """Connect to a cluster at ``tcp://host:port`` and send the evaluator, which can be pickled, to all workers, once.

    `patience_s`: how long to wait for the scheduler, and for a worker whenever there is none. `WorkerError` where the
    scheduler does not answer, has no workers, or they have other versions or processors.
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
        except TypeError as error:
            # What Dask makes of an address with TLS where its settings name no certificates, or wrong ones.
            raise WorkerError(f"{address}: no connection with TLS: {str(error).splitlines()[0]}") from error
        # On a busy machine Dask's own thread may not start within the ten seconds that it asserts.
        except (OSError, ImportError, AssertionError) as error:
            raise WorkerError(
                f"no Dask scheduler of a fitting version answers at {address} within {patience_s:g} s: start one with "
                "`dask scheduler`, and give the address that it prints"
            ) from error
        try:
            yield client
        finally:
            client.close()


def require_workers(client: Client, patience_s: float) -> None:
    """Require that a scheduler has a worker after some patience, s."""
    try:
        client.wait_for_workers(1, timeout=patience_s)
    except TimeoutError as error:
        address = client.scheduler.address
        raise WorkerError(
            f"the Dask scheduler at {address} has no workers: start some with `dask worker {address} --nthreads 1`; "
            "if they ended because their machines ran out of memory, start fewer on each"
        ) from error


@contextmanager
def explained(client: Client) -> Iterator[None]:
    """Turn whatever Dask raises into a `WorkerError` with a remedy."""
    try:
        yield
    except ComputationError:
        raise
    except Exception as error:
        raise WorkerError(_words(error, client)) from error


def _words(error: Exception, client: Client) -> str:
    if client.status != "running":
        return "the Dask scheduler is gone: start it and its workers again"
    if isinstance(error, (KilledWorker, CancelledError)):
        return (
            "one Dask worker after another ended while it evaluated the same chromosomes; if their machines "
            "ran out of memory, start fewer workers on each, or add memory"
        )
    return f"the Dask cluster failed with {type(error).__name__}: {error}"


class Shipped(WorkerPlugin):  # type: ignore[misc]
    """A pickled evaluator that the scheduler gives to each worker, also to one that joins or comes back later.

    Scattered data would not stay: Dask drops copies while they are idle, and then the only one with its worker.
    Threads of one worker do not share an evaluator, because nothing says that it may be used by two at once.
    """

    def __init__(self, evaluator: bytes) -> None:
        self._evaluator = evaluator
        self._loaded = threading.local()

    def __reduce__(self) -> tuple[type[Shipped], tuple[bytes]]:
        return Shipped, (self._evaluator,)

    def evaluate(self, genes: IntArray) -> Evaluation:
        """Evaluate chromosomes by this thread's own evaluator."""
        if not hasattr(self._loaded, "evaluate"):
            self._loaded.evaluate = self._load()
        evaluation: Evaluation = self._loaded.evaluate(genes)
        return evaluation

    def _load(self) -> Evaluate:
        evaluate: Evaluate = pickle.loads(self._evaluator)
        # Loading has loaded the libraries of linear algebra too. Sums in one order give the same bytes everywhere.
        threadpool_limits(limits=1)
        return evaluate


def evaluate_shipped(genes: IntArray, name: str) -> Evaluation | Failure:
    """Evaluate chromosomes, shape (individuals, genes), on a worker of a cluster by what was shipped."""
    shipped: Shipped = get_worker().plugins[name]
    return attempt(partial(shipped.evaluate, genes))


@contextmanager
def quiet() -> Iterator[None]:
    """Silence Dask's log, whose failures are raised as errors anyway."""
    loggers = [logging.getLogger(name) for name in _NOISY]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
