"""Speed of two workers against one, by kind of worker, on a generation of the paper's study with all 5487 samples."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from functools import partial
from importlib.util import find_spec
from time import perf_counter

import numpy as np

from benchmarks.shared.measure import in_turn, program, table
from benchmarks.shared.studies import paper_flight, paper_selection, paper_study
from cpfls_cli.identification.evaluator import Evaluator
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.workers.employ import employ
from cpfls_cli.workers.workforce import Workforce

GENERATION = 60


def main() -> None:
    rows = []
    for name, learned in (("5487 samples", paper_flight()), ("685 of 5487 samples", paper_selection())):
        evaluator = model_evaluator(paper_flight(), learned, paper_study().identification)
        rows.append((name, "2 processes", *compare(evaluator, employ(evaluator, count=2))))
        if find_spec("distributed"):
            rows.append((name, "Dask, 2 worker processes on loopback", *compare(evaluator, cluster(evaluator))))
    table("workers", "study | workers | start, s | times faster than one (range) | same objectives", rows)


def compare(evaluator: Evaluator, workers: contextlib.AbstractContextManager[Workforce]) -> tuple[float, str, str]:
    """Time a generation here and with workers in turn; also the start of the workers."""
    genes = np.random.default_rng(7).integers(1, 2**16, (GENERATION, evaluator.structure.genes))
    start = perf_counter()
    with workers as workforce:
        workforce(np.full((2, evaluator.structure.genes), 30000))
        started = perf_counter() - start
        same = np.array_equal(evaluator(genes).objectives, workforce(genes).objectives)
        timed = in_turn(partial(evaluator, genes), partial(workforce, genes), clock=perf_counter)
    return started, timed.range, "yes" if same else "NO"


@contextlib.contextmanager
def cluster(evaluator: Evaluator) -> Iterator[Workforce]:
    """Start a scheduler with two workers on this machine."""
    from distributed import LocalCluster

    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as local,
        employ(evaluator, scheduler=local.scheduler_address) as workforce,
    ):
        yield workforce


if __name__ == "__main__":
    program(main)
