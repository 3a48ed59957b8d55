"""Time whole identifications of the paper's study, and show where the time goes.

With --full a search of 500 x 200 too, which takes a quarter of an hour or more.
"""

from __future__ import annotations

import cProfile
import pstats
from dataclasses import replace
from statistics import median
from time import process_time

import numpy as np

from benchmarks.shared.measure import program, table
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


def main(*, full: bool = False) -> None:
    # What a first run loads and compiles is none of its time.
    run(paper_selection(), 10, 1)
    names, flights = ("685 of 5487 samples", "5487 samples"), (paper_selection(), paper_flight())
    cases = [(name, learned, 75, 25) for name, learned in zip(names, flights, strict=True)]
    rows = []
    for name, learned, population, generations in [*cases, (names[0], flights[0], 500, 200)] if full else cases:
        times = []
        for _ in range(REPEATS if population == 75 else 1):
            start = process_time()
            result = run(learned, population, generations)
            times.append(process_time() - start)
        took, evaluations = median(times), int(result.history.evaluations[-1])
        spread = f"{took:.3g} ({min(times):.3g} to {max(times):.3g})"
        error = result.scores["training"]["model"].worst_relative_error
        size = f"{name}, {population} x {generations}"
        rows.append((size, spread, evaluations, 1e3 * took / evaluations, error))
    table(
        "whole_run", "run | seconds of the processor (range) | evaluations | ms per evaluation | relative error", rows
    )
    print("\nWhere the time goes, per cent:\n")
    shares = [profile(*case[1:]) for case in cases]
    columns = ("part", *(f"{name}, {p} x {g}" for name, _, p, g in cases))
    table("profile", columns, [(part, *(each[part] for each in shares)) for part in shares[0]])


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
    program(main)
