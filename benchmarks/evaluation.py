"""One evaluation and one local search against the plain reference, and what starting the compiled code costs.

python benchmarks/evaluation.py
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import in_turn, pin_threads, ratio_of, seconds, table

pin_threads()

import numpy as np

from benchmarks.shared.studies import paper_flight, paper_selection, paper_study
from cpfls_cli.identification.chromosome import LARGEST_GENE, decode, encode
from cpfls_cli.identification.evaluator import Evaluator, Problem, refine
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.reference import ReferenceEvaluator
from cpfls_cli.identification.settings import IdentificationSettings, LocalSearchSettings

CHROMOSOMES = 80
LARGEST_CONDITION = 1e6
TIMED = 5


def main() -> None:
    settings = paper_study().identification
    flight, selection = paper_flight(), paper_selection()
    cases = (
        ("685, judged on these", selection, selection),
        ("685, judged on all 5487", flight, selection),
        ("5487", flight, flight),
    )
    evaluations, searches = [], []
    for name, training, learned in cases:
        evaluations.append((name, *evaluation(training, learned, settings)))
        searches.append((name, *local_search(training, learned, settings)))
    print("One evaluation, no local search:\n")
    table(
        "evaluation",
        ("samples", "reference, ms", "compiled, ms", "times faster (range)", "compared", "largest relative difference"),
        evaluations,
    )
    print("\nOne local search:\n")
    table(
        "local_search",
        ("samples", "2-point, ms", "variable projection, ms", "times faster (range)", "MSE, ours over theirs"),
        searches,
    )
    print("\nStarting:\n")
    table("start", ("what", "seconds"), starting())


def evaluation(training, learned, settings: IdentificationSettings) -> tuple[float, float, str, int, float]:
    """Time evaluations in turn, and compare the objectives of well-conditioned chromosomes."""
    plain = replace(settings, local_search=LocalSearchSettings(enabled=False))
    fast, reference = model_evaluator(training, learned, plain), ReferenceEvaluator(training, learned, plain)
    rng = np.random.default_rng(4)
    genes = rng.integers(1, 2**16, (CHROMOSOMES, fast.structure.genes))
    ours, theirs = fast(genes).objectives, reference(genes).objectives
    comparable = theirs[:, 2] < LARGEST_CONDITION
    difference = np.max(np.abs(ours[comparable] / theirs[comparable] - 1.0))
    some = genes[:TIMED]
    timed = in_turn(lambda: reference(some), lambda: fast(some))
    milliseconds = (1e3 * timed.slow_s / TIMED, 1e3 * timed.fast_s / TIMED)
    return (*milliseconds, timed.range, int(comparable.sum()), float(difference))


def local_search(training, learned, settings: IdentificationSettings) -> tuple[float, float, str, str]:
    """Time local searches in turn from the same starts with the same budget, and compare where they end."""
    fast, reference = model_evaluator(training, learned, settings), ReferenceEvaluator(training, learned, settings)
    plain = replace(fast, local_search=LocalSearchSettings(enabled=False))
    starts = well_conditioned(plain)
    budget, times, ends = settings.local_search.evaluations, [], []
    for start in starts:
        weights, fit = start / LARGEST_GENE, fast.fit(start)
        assert fit is not None
        problem = Problem(fast.solver, fit)
        products = fast.solver.products(decode(fast.structure, start.astype(float)))
        found: list[np.ndarray] = []
        slow = seconds(lambda: found.append(encode(reference.refine(weights))))  # noqa: B023
        quick = seconds(lambda: found.append(refine(problem, start, products, budget).genes))  # noqa: B023
        times.append((slow, quick))
        theirs, ours = plain(np.array(found)).objectives[:, 0]
        ends.append(ours / theirs)
    timed = ratio_of(times)
    quality = f"{np.median(ends):.3g} ({min(ends):.3g} to {max(ends):.3g})"
    return 1e3 * timed.slow_s, 1e3 * timed.fast_s, timed.range, quality


def well_conditioned(plain: Evaluator) -> np.ndarray:
    """Random chromosomes from which a local search makes sense."""
    genes = np.random.default_rng(5).integers(1, 2**16, (CHROMOSOMES, plain.structure.genes))
    return genes[plain(genes).objectives[:, 2] < LARGEST_CONDITION][:TIMED]


def starting() -> list[tuple[str, float]]:
    """Time starting the program, and compiling once against loading what was compiled."""
    version = [sys.executable, "-m", "cpfls_cli", "--version"]
    one = "from benchmarks.evaluation import evaluate_one; evaluate_one()"
    with tempfile.TemporaryDirectory() as cache:
        environment = dict(os.environ, NUMBA_CACHE_DIR=cache, PYTHONPATH=str(Path(__file__).resolve().parents[1]))

        def run(command: list[str]) -> float:
            return seconds(partial(subprocess.run, command, env=environment, check=True, stdout=subprocess.DEVNULL))

        nothing = [sys.executable, "-c", "pass"]
        return [
            ("Python alone", min(run(nothing) for _ in range(5))),
            ("`cpfls --version`", min(run(version) for _ in range(5))),
            ("one evaluation in a new process, compiling", run([sys.executable, "-c", one])),
            ("the same, compiled before", min(run([sys.executable, "-c", one]) for _ in range(3))),
        ]


def evaluate_one() -> None:
    """Evaluate one chromosome with local search."""
    data = paper_flight()[:200]
    evaluator = model_evaluator(data, data, paper_study().identification)
    evaluator(np.full((1, evaluator.structure.genes), 30000))


if __name__ == "__main__":
    main()
