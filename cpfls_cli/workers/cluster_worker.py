"""The worker's side of a cluster: an evaluator that each thread loads once, and the work on a chunk."""

from __future__ import annotations

import pickle
import threading
from functools import partial

from distributed import WorkerPlugin, get_worker
from threadpoolctl import threadpool_limits

from cpfls_cli.arrays import IntArray
from cpfls_cli.evolution.archive import Evaluate, Evaluation
from cpfls_cli.workers.attempt import Failure, attempt


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
    """Evaluate chromosomes on a worker of a cluster.

    Parameters
    ----------
    genes : array of int, shape (individuals, genes)
    name : str
        By which the evaluator was shipped.
    """
    shipped: Shipped = get_worker().plugins[name]
    return attempt(partial(shipped.evaluate, genes))
