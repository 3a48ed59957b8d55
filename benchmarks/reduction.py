"""Condition numbers and cost of the reduction criteria on the training path, as a Markdown table.

The cost is a ratio of two things measured in one run: the selection, and the same greedy rule done with one
eigensolve per candidate and step, extrapolated from a few hundred eigensolves.

Run with ``python -m benchmarks.reduction`` or ``python benchmarks/reduction.py``.
"""

from __future__ import annotations

import time

import numpy as np
import scipy.linalg

from cpfls_cli.arrays import Array
from cpfls_cli.reduction import ReductionSettings, Selection, random_selections, reduce
from cpfls_cli.regressor import Motion, Regressor, StructureSettings, data_ranges, model_structure, uniform_breakpoints
from cpfls_cli.trajectory import TrajectorySettings, plan

SIZES = (80, 300, 685, 1170, 2743)
CRITERIA = ("sigma_min", "A", "D", "paper-literal")
RANDOM_DRAWS = 20


def training_regressor() -> Array:
    flight = plan(TrajectorySettings(), gravity=9.81)
    motion = Motion(flight.attitude, flight.attitude_rate, flight.attitude_acceleration)
    structure = model_structure(
        StructureSettings(input_map="data-range", consequents="seesaw", products="additive", membership_functions=5)
    )
    matrix = Regressor(structure, motion, data_ranges(structure, motion.attitude))
    return matrix.matrix(uniform_breakpoints(structure))


def eigensolve_seconds(Q: Array, repeats: int = 300) -> float:
    gram = np.einsum("nij,nik->jk", Q, Q)
    start = time.perf_counter()
    for rows in Q[:repeats]:
        scipy.linalg.eigh(gram + rows.T @ rows, eigvals_only=True, subset_by_index=[0, 0])
    return (time.perf_counter() - start) / repeats


def timed(Q: Array, criterion: str, size: int) -> tuple[Selection, float]:
    start = time.perf_counter()
    selection = reduce(Q, ReductionSettings(criterion=criterion, size=size))
    return selection, time.perf_counter() - start


def random_range(Q: Array, size: int, rng: np.random.Generator) -> tuple[float, float]:
    draws = [draw.condition_number for draw in random_selections(Q, size, RANDOM_DRAWS, rng)]
    return min(draws), float(np.median(draws))


def brute_force_solves(samples: int, size: int) -> int:
    return sum(samples - step for step in range(size))


def main() -> None:
    Q = training_regressor()
    solve, rng = eigensolve_seconds(Q), np.random.default_rng(0)
    print("| criterion | samples | rank | condition number | of full set | time / brute force |")
    print("|---|---|---|---|---|---|")
    for criterion in CRITERIA:
        for size in SIZES:
            selection, seconds = timed(Q, criterion, size)
            relative = seconds / (solve * brute_force_solves(len(Q), size))
            ratio = selection.condition_number / selection.condition_number_full
            rank = f"{selection.rank} of {selection.rank_full}"
            print(
                f"| {criterion} | {size} | {rank} | {selection.condition_number:.0f} | {ratio:.2f} | {relative:.1e} |"
            )
    for size in SIZES:
        best, median = random_range(Q, size, rng)
        ratio = best / selection.condition_number_full
        print(f"| random, best of {RANDOM_DRAWS} (median {median:.0f}) | {size} | | {best:.0f} | {ratio:.2f} | |")
    print(f"\nFull set: {len(Q)} samples, condition number {selection.condition_number_full:.0f}.")


if __name__ == "__main__":
    main()
