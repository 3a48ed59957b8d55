"""A pool drawn by leverage against one drawn uniformly, on a long noisy flight: conditioning and what predictions lose.

python benchmarks/reduction_streamed.py [--samples 500000] [--draws 3]

One flight is the paper's, tiled; in the other it is flown once, and calm samples (its first two seconds, tiled) follow.
Both have noise of 1 % of each channel's standard deviation on the motion.
Predictions: standard deviation of a torque predicted on the flight, per that of a torque measured, root mean square
over all samples and worst of 20000. Figures are medians over the draws, with the lowest and the highest.
"""

from __future__ import annotations

import argparse
import resource
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np

from benchmarks.shared.studies import paper_flight, paper_study
from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.reduction.settings import CriterionName, ReductionSettings
from cpfls_cli.reduction.survey import Survey, survey
from cpfls_cli.reduction.training_set import Pool, choose, draw_pool, pool_of
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.regressor.regressor import Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import model_structure

NOISE = 0.01
POOLS = (2000, 20000)
CALM = 200
CRITERIA: tuple[CriterionName, ...] = ("KD-exchange", "A")
SIZE = 685
REFERENCE = 20_000
COLUMNS = (
    "flight",
    "pool",
    "samples in it",
    "criterion",
    "condition number",
    "share of the full set's",
    "worst prediction",
    "rms prediction",
)


def noisy_motions(samples: int, *, tiled: bool) -> Iterator[Motion]:
    clean = paper_flight().motion
    length = len(clean.attitude)
    for tile, first in enumerate(range(0, samples, length)):
        rng, left = np.random.default_rng([7, tile]), min(length, samples - first)
        places = np.arange(left) if tiled or tile == 0 else np.arange(left) % CALM
        yield Motion(*(_noisy(channel, places, rng) for channel in vars(clean).values()))


def _noisy(channel: Array, places: IntArray, rng: np.random.Generator) -> Array:
    return channel[places] + NOISE * channel.std(axis=0) * rng.standard_normal((len(places), 3))


def chunks(samples: int, *, tiled: bool) -> Iterator[Array]:
    structure = model_structure(paper_study().identification)
    bounds = [_extremes(motion.attitude) for motion in noisy_motions(samples, tiled=tiled)]
    ranges = data_ranges(structure, np.concatenate(bounds))
    for motion in noisy_motions(samples, tiled=tiled):
        yield Regressor(structure, motion, ranges).matrix(uniform_breakpoints(structure))


def _extremes(attitude: Array) -> Array:
    return np.stack([attitude.min(axis=0), attitude.max(axis=0)])


def uniform_pool(surveyed: Survey, size: int, rng: np.random.Generator) -> Pool:
    return pool_of(surveyed, np.sort(rng.choice(surveyed.samples, size, replace=False)))


def predictions(surveyed: Survey, rows: Array, reference: Pool) -> tuple[float, float]:
    whitener = np.linalg.inv(np.linalg.qr(rows.reshape(-1, surveyed.rank), mode="r"))
    worst = np.sum((reference.space.rows @ whitener) ** 2, axis=2).max()
    total = np.sum((surveyed.singular_values[:, None] * whitener) ** 2)
    return float(np.sqrt(worst)), float(np.sqrt(total / (3 * surveyed.samples)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=500_000)
    parser.add_argument("--draws", type=int, default=3)
    asked = parser.parse_args()
    start, rows = perf_counter(), []
    for flight in ("tiled", "calm"):
        surveyed = survey(partial(chunks, asked.samples, tiled=flight == "tiled"), 1e-10)
        reference = uniform_pool(surveyed, REFERENCE, np.random.default_rng(99))
        for size in POOLS:
            for name, draw in (("leverage", draw_pool), ("uniform", uniform_pool)):
                pools = [draw(surveyed, size, np.random.default_rng(seed)) for seed in range(asked.draws)]
                rows += [(flight, *compared(surveyed, pools, reference, name, criterion)) for criterion in CRITERIA]
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    table("reduction_streamed", COLUMNS, rows, peak_memory_mb=memory)
    print(
        f"\n{asked.samples} samples, {perf_counter() - start:.0f} s, peak memory {memory:.0f} MB, "
        f"{asked.draws} pools and a reference held."
    )


def compared(
    surveyed: Survey, pools: list[Pool], reference: Pool, name: str, criterion: CriterionName
) -> tuple[object, ...]:
    settings = ReductionSettings(criterion=criterion, size=SIZE)
    results = []
    for pool in pools:
        selection = choose(pool.space, settings)
        share = selection.condition_number / surveyed.condition_number
        found = pool.space.rows[selection.indices]
        results.append((selection.condition_number, share, *predictions(surveyed, found, reference)))
    return name, len(pools[0].indices), criterion, *(_summary(values) for values in zip(*results, strict=True))


def _summary(values: tuple[float, ...]) -> str:
    return f"{np.median(values):.3g} ({min(values):.3g} to {max(values):.3g})"


if __name__ == "__main__":
    main()
