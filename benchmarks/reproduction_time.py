"""Time of an evaluation and of the singular value decomposition in it, by the size of the training set.

With --out the rows go to a file too, as JSON for `benchmarks.paper.report --times`: no artifact holds a time, so that
equal content stays an equal file. Seconds of processor time, medians.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks.shared.measure import program, seconds, table
from benchmarks.shared.studies import paper_flight, paper_study, regressor_matrix
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.identify import model_evaluator
from tests.builders.reference_evaluator import ReferenceEvaluator

SIZES = (343, 485, 685, 970, 1170, 1940, 2743, 3880, 5487)
COLUMNS = ("samples", "svd_s", "evaluation_s", "compiled_s")


def main(out: Path | None = None, repeats: int = 7) -> None:
    rows = measured(repeats)
    table("reproduction_time", COLUMNS, rows)
    if out:
        records = [dict(zip(COLUMNS, row, strict=True)) for row in rows]
        out.write_text(json.dumps(records) + "\n", encoding="utf-8")


def measured(repeats: int) -> list[tuple[int, float, float, float]]:
    """Time all sizes in turn, so that a slow moment of the machine meets all of them."""
    works = {size: works_of(size) for size in SIZES}
    for work in (work for several in works.values() for work in several):
        work()
    rounds = [{size: [seconds(work) for work in works[size]] for size in SIZES} for _ in range(repeats)]
    return [(size, *(median(one[size][place] for one in rounds) for place in range(3))) for size in SIZES]


def works_of(size: int) -> tuple[Callable[[], object], ...]:
    """Prepare the decomposition, the plain evaluation and the compiled one of so many samples."""
    learned = spread_samples(size)
    matrix = regressor_matrix(learned.motion).reshape(3 * size, -1)
    search = paper_study().identification
    plain = replace(search, local_search=replace(search.local_search, enabled=False))
    reference, fast = ReferenceEvaluator(learned, learned, plain), model_evaluator(learned, learned, plain)
    genes = np.random.default_rng(5).integers(1, 2**16, (1, reference.structure.genes))
    return (lambda: np.linalg.svd(matrix, full_matrices=False), lambda: reference(genes), lambda: fast(genes))


def spread_samples(size: int) -> TorqueData:
    """Take samples spread over the whole flight."""
    flight = paper_flight()
    return flight[np.linspace(0, len(flight) - 1, size).round().astype(int)]


if __name__ == "__main__":
    program(main)
