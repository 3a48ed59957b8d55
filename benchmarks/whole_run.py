"""Time whole identifications of the paper's study, and show where the time goes.

python -m benchmarks.whole_run [--full]     --full adds 500 x 200, which takes a quarter of an hour or more
"""

from __future__ import annotations

import cProfile
import pstats
import sys
from dataclasses import replace
from statistics import median
from time import process_time

import numpy as np

from benchmarks.shared.measure import table
from benchmarks.shared.studies import paper_flight, paper_selection, paper_study
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.identify import identify

# Inclusive times that do not overlap; what is left of the whole is "the rest".
PARTS = {
    "products of the regressor with itself": ("samples.py", "products"),
    "derivatives by the breakpoints": ("samples.py", "moved"),
    "errors over the training part": ("samples.py", "errors"),
    "residuals and lowest directions, once more": ("samples.py", "projected"),
    "eigendecompositions": ("_linalg.py", "eigh"),
    "Cholesky decompositions": ("least_squares.py", "quick_solution"),
    "damped steps": ("evaluator.py", "stepped"),
    "decoding": ("chromosome.py", "decode"),
    "breeding": ("engine.py", "_breed"),
}


REPEATS = 5


def main() -> None:
    # What a first run loads and compiles is none of its time.
    run(paper_selection(), 10, 1)
    cases = [
        ("685 of 5487 samples, 75 x 25", paper_selection(), 75, 25),
        ("5487 samples, 75 x 25", paper_flight(), 75, 25),
    ]
    if "--full" in sys.argv:
        cases.append(("685 of 5487 samples, 500 x 200", paper_selection(), 500, 200))
    rows, profiles = [], []
    for name, learned, population, generations in cases:
        times = []
        for _ in range(REPEATS if population == 75 else 1):
            start = process_time()
            result = run(learned, population, generations)
            times.append(process_time() - start)
        took, evaluations = median(times), int(result.history.evaluations[-1])
        spread = f"{took:.3g} ({min(times):.3g} to {max(times):.3g})"
        error = result.scores["training"]["model"].worst_relative_error
        rows.append((name, spread, evaluations, 1e3 * took / evaluations, error))
        if population == 75:
            profiles.append((name, profile(learned, population, generations)))
    print("Whole runs of `identify`, local search on, one thread:\n")
    table(
        "whole_run",
        ("run", "seconds of the processor (range)", "evaluations", "ms per evaluation", "relative error"),
        rows,
    )
    print("\nWhere the time goes, per cent:\n")
    parts = list(profiles[0][1])
    table(
        "profile",
        ("part", *(name for name, _ in profiles)),
        [(part, *(shares[part] for _, shares in profiles)) for part in parts],
    )


def run(learned: TorqueData, population: int, generations: int):
    settings = replace(paper_study().identification, population=population, generations=generations)
    return identify(paper_flight(), learned, {}, settings, np.random.default_rng(1))


def profile(learned: TorqueData, population: int, generations: int) -> dict[str, str]:
    """Shares of the time by part, of a run under a profiler."""
    profiler = cProfile.Profile()
    profiler.runcall(run, learned, population, generations)
    stats = pstats.Stats(profiler).stats  # type: ignore[attr-defined]
    whole = max(entry[3] for entry in stats.values())
    spent = {
        part: sum(v[3] for k, v in stats.items() if k[0].endswith(file) and k[2] == name)
        for part, (file, name) in PARTS.items()
    }
    spent["the rest"] = whole - sum(spent.values())
    return {part: f"{100 * value / whole:.1f}" for part, value in spent.items()}


if __name__ == "__main__":
    main()
