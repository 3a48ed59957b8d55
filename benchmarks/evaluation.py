"""One evaluation and one local search against plain references."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from time import process_time
from typing import Any
from unittest import mock

import numpy as np

from benchmarks.shared.measure import Ratio, in_turn, program, seconds, table
from benchmarks.shared.studies import paper_flight, paper_selection, paper_study
from cpfls_cli.identification.evaluator import LARGEST_GENE, Evaluator, Problem, decode, encode, refine
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.samples import Samples
from cpfls_cli.identification.settings import IdentificationSettings, LocalSearchSettings
from tests.builders import reference_evaluator as reference
from tests.builders.reference_evaluator import ReferenceEvaluator

CHROMOSOMES = 80
LARGEST_CONDITION = 1e6
TIMED = 5
TOLERANCE = 1e-6


def main() -> None:
    settings = paper_study().identification
    flight, selection = paper_flight(), paper_selection()
    cases = (
        ("685, judged on these", selection, selection),
        ("685, judged on all 5487", flight, selection),
        ("5487", flight, flight),
    )
    print("One evaluation, no local search:\n")
    columns = (
        "samples | by singular values, ms | by Gram matrix, ms | compiled, ms | times faster than the first (range) | "
        "than the second (range) | compared | largest relative difference"
    )
    table(
        "evaluation", columns, [(name, *evaluation(training, learned, settings)) for name, training, learned in cases]
    )
    print("\nOne local search:\n")
    columns = (
        "samples | 2-point, ms | variable projection, ms | times faster (range) | passes over the samples, theirs and "
        "ours | times fewer | times by code | MSE, ours over theirs"
    )
    table(
        "local_search",
        columns,
        [(name, *local_search(training, learned, settings)) for name, training, learned in cases],
    )


def evaluation(training, learned, settings: IdentificationSettings) -> tuple[float, float, float, str, str, int, float]:
    """Time evaluations in turn, and compare the objectives of well-conditioned chromosomes."""
    plain = replace(settings, local_search=LocalSearchSettings(enabled=False))
    fast, slow = model_evaluator(training, learned, plain), ReferenceEvaluator(training, learned, plain)
    rng = np.random.default_rng(4)
    genes = rng.integers(1, 2**16, (CHROMOSOMES, fast.structure.genes))
    ours, theirs = fast(genes).objectives, slow(genes).objectives
    comparable = theirs[:, 2] < LARGEST_CONDITION
    difference = np.max(np.abs(ours[comparable] / theirs[comparable] - 1.0))
    some = genes[:TIMED]
    by_values = in_turn(lambda: densely(slow, some, reference._solve), lambda: fast(some))
    by_gram = in_turn(lambda: densely(slow, some, by_gram_matrix), lambda: fast(some))
    milliseconds = (1e3 * spent / TIMED for spent in (by_values.slow_s, by_gram.slow_s, by_gram.fast_s))
    return (*milliseconds, by_values.range, by_gram.range, int(comparable.sum()), float(difference))


def densely(evaluator: ReferenceEvaluator, genes: np.ndarray, solve) -> list[tuple[float, float, float]]:
    """Evaluate as the reference does, with Q built once where the same samples teach and judge."""
    found = []
    for chromosome in genes:
        partitions = evaluator._decode(chromosome)
        Q = reference._matrix(evaluator._learned, partitions)
        whole = Q if evaluator.training is evaluator.learned else reference._matrix(evaluator._whole, partitions)
        coefficients, condition = solve(Q, evaluator.learned.torque.reshape(-1), TOLERANCE)
        error = evaluator.training.torque.reshape(-1) - whole @ coefficients
        found.append((float(np.mean(error**2)), float(np.max(np.abs(error))), condition))
    return found


def by_gram_matrix(Q: np.ndarray, torque: np.ndarray, rank_tolerance: float) -> tuple[np.ndarray, float]:
    """Solve by the eigenvalues of ``Q^T Q``, as fast as NumPy alone can and without a refinement."""
    eigenvalues, vectors = np.linalg.eigh(Q.T @ Q)
    kept = eigenvalues > rank_tolerance**2 * eigenvalues[-1]
    basis = vectors[:, kept]
    coefficients = basis @ ((basis.T @ (Q.T @ torque)) / eigenvalues[kept])
    return coefficients, float(np.sqrt(eigenvalues[-1] / eigenvalues[kept][0]))


def local_search(training, learned, settings: IdentificationSettings) -> tuple[float | str, ...]:
    """Time local searches in turn from the same starts with the same budget, and compare where they end."""
    fast, theirs = model_evaluator(training, learned, settings), ReferenceEvaluator(training, learned, settings)
    plain = replace(fast, local_search=LocalSearchSettings(enabled=False))
    starts = well_conditioned(plain)
    budget, times, ends, passes = settings.local_search.evaluations, [], [], []
    for start in starts:
        weights, fit = start / LARGEST_GENE, fast.fit(start)
        assert fit is not None
        problem = Problem(fast.solver, fit)
        products = fast.solver.products(decode(fast.structure, start.astype(float)))
        before, slow_s, many = counted(partial(theirs.refine, weights), reference, "_matrix")
        ours = partial(refine, problem, start, products, budget)
        after, _, few = counted(ours, Samples, "products", "moved")
        passes.append((many, few))
        times.append((slow_s, seconds(ours)))
        mse = plain(np.array([encode(before), after.genes])).objectives[:, 0]
        ends.append(mse[1] / mse[0])
    timed, (many, few) = Ratio.of(times), np.median(passes, axis=0)
    quality = f"{np.median(ends):.3g} ({min(ends):.3g} to {max(ends):.3g})"
    per_pass = f"{many:.0f} and {few:.0f}", many / few, timed.ratio * few / many
    return 1e3 * timed.slow_s, 1e3 * timed.fast_s, timed.range, *per_pass, quality


def counted(work, where, *names: str) -> tuple[Any, float, int]:
    """Give what comes of work, its seconds, and how often it calls functions that go through all samples."""
    spies = [mock.patch.object(where, name, autospec=True, side_effect=getattr(where, name)) for name in names]
    counters = [spy.start() for spy in spies]
    start = process_time()
    found = work()
    spent = process_time() - start
    mock.patch.stopall()
    return found, spent, sum(counter.call_count for counter in counters)


def well_conditioned(plain: Evaluator) -> np.ndarray:
    """Random chromosomes from which a local search makes sense."""
    genes = np.random.default_rng(5).integers(1, 2**16, (CHROMOSOMES, plain.structure.genes))
    return genes[plain(genes).objectives[:, 2] < LARGEST_CONDITION][:TIMED]


if __name__ == "__main__":
    program(main)
