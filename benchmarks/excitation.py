"""Conditioning of the regressor along paths of full rotations: random and optimised, over duration and search method.

python benchmarks/excitation.py

Rates of the Euler angles and of the body stay below 6 rad/s, accelerations below 12 rad/s^2. Condition numbers are
those of the whole regressor, sampled every 0.01 s, for uniform partitions. The search methods get the same number of
regressors; gradient descent spends six in each iteration, as many as it builds.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.evolution.engine import evolve
from cpfls_cli.evolution.settings import EvolutionSettings
from cpfls_cli.excitation.objective import condition_number, path_of, variables_of
from cpfls_cli.excitation.optimise import optimised_rotation
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.trajectory.rotation import RotationLimits, RotationMotion, RotationPath, full_rotation
from cpfls_cli.trajectory.settings import RotationSettings
from cpfls_cli.vehicle.settings import VehicleSettings

STRUCTURES = {
    "seesaw, 5 functions": StructureSettings(consequents="seesaw", products="additive", membership_functions=5),
    "harmonic, order 2, tensor, 1 rule": StructureSettings(),
}
DURATIONS_S, PAPER_S, SAMPLE_TIME_S = (10.0, 20.0, 54.86, 120.0), 54.86, 0.01
SEEDS, RANDOM_PATHS = 3, 20
SETTINGS, VEHICLE = RotationSettings(), VehicleSettings()
LIMITS = RotationLimits(SETTINGS)
PER_ITERATION, SEARCH_SAMPLES = 6, 500
BUDGET = SETTINGS.starts + PER_ITERATION * SETTINGS.iterations
# Genes of a rate amplitude span this, rad/s; those of the turns span whole numbers up to 8 either way.
SPAN, MOST_TURNS = 2.0, 8
POPULATION = 100
BY_DURATION = (
    "structure",
    "parameters",
    "duration, s",
    "random paths, median",
    f"best of {RANDOM_PATHS}",
    "optimised, median",
    "lowest",
    "highest",
    "seconds",
)
BY_METHOD = ("method", "regressors", "condition number, median", "lowest", "highest", "seconds")

Search = Callable[[StructureSettings, np.random.Generator], RotationPath]


def judged(structure: StructureSettings, path: RotationPath) -> float:
    return condition_number(path, model_structure(structure), round(path.duration / SAMPLE_TIME_S))


def searched(structure: StructureSettings, path: RotationPath) -> float:
    return condition_number(path, model_structure(structure), SEARCH_SAMPLES)


def random_path(duration: float, rng: np.random.Generator) -> RotationPath:
    return full_rotation(SETTINGS, duration, rng)


def by_gradient(structure: StructureSettings, rng: np.random.Generator, duration: float = PAPER_S) -> RotationPath:
    return optimised_rotation(SETTINGS, duration, structure, VEHICLE, rng).path


def at_random(structure: StructureSettings, rng: np.random.Generator) -> RotationPath:
    return min((random_path(PAPER_S, rng) for _ in range(BUDGET)), key=partial(searched, structure))


def within_limits(path: RotationPath) -> RotationPath:
    """Scale the harmonics down by what the samples of the search show, which is cheap; the result is enforced later."""
    times = path.times(SEARCH_SAMPLES)
    turning, full = (np.stack([*vars(path.scaled(factor).sample(times)).values()]) for factor in (0.0, 1.0))
    low, high = 0.0, 2.0
    for _ in range(12):
        middle = 0.5 * (low + high)
        # Motion is linear in the amplitudes.
        loads = LIMITS.loads(RotationMotion(*(turning + middle * (full - turning))))
        low, high = (middle, high) if np.abs(loads).max() <= 0.98 else (low, middle)
    return path.scaled(min(low, 1.0))


def by_cma(structure: StructureSettings, rng: np.random.Generator) -> RotationPath:
    import cma

    starts = [random_path(PAPER_S, rng) for _ in range(SETTINGS.starts)]
    like = min(starts, key=partial(searched, structure))

    def path(flat: Array) -> RotationPath:
        return within_limits(path_of(np.reshape(flat, (3, -1)), like))

    options = {"seed": int(rng.integers(1, 2**31)), "maxfevals": BUDGET - len(starts), "verbose": -9}
    strategy = cma.CMAEvolutionStrategy(variables_of(like).ravel(), 0.1, options)
    strategy.optimize(lambda flat: math.log(searched(structure, path(flat))))
    return LIMITS.enforced(path(strategy.result.xbest))


def path_of_genes(genes: IntArray, like: RotationPath) -> RotationPath:
    shares = genes / 2**15 - 1.0
    turns = np.sign(shares[:3]) * np.ceil(np.abs(shares[:3]) * MOST_TURNS)
    variables = shares[3:].reshape(3, -1) * np.append(math.pi, np.full(2 * like.harmonics, SPAN))
    return within_limits(path_of(variables, replace(like, turns=turns.astype(np.int64))))


def genes_of_path(path: RotationPath) -> IntArray:
    variables = variables_of(path)
    start = (variables[:, :1] + math.pi) % (2 * math.pi) - math.pi
    shares = np.hstack([start / math.pi, variables[:, 1:] / SPAN]).ravel()
    turns = np.sign(path.turns) * (np.abs(path.turns) - 0.5) / MOST_TURNS
    return np.clip((np.append(turns, shares) + 1.0) * 2**15, 0, 2**16 - 1).astype(np.int64)


def by_genetic_algorithm(structure: StructureSettings, rng: np.random.Generator) -> RotationPath:
    starts = [random_path(PAPER_S, rng) for _ in range(POPULATION)]
    initial, like = np.array([genes_of_path(path) for path in starts]), starts[0]
    settings = EvolutionSettings(population=POPULATION)
    bred = round(settings.generation_gap * POPULATION)
    settings = replace(settings, generations=(BUDGET - POPULATION) // bred)

    def evaluate(genes: IntArray) -> Evaluation:
        worth = [math.log(searched(structure, path_of_genes(row, like))) for row in genes]
        return Evaluation(genes, np.array(worth)[:, None])

    *_, last = evolve(evaluate, initial.shape[1], settings, rng, initial)
    return LIMITS.enforced(path_of_genes(last.front_genes[0], like))


METHODS: dict[str, Search] = {
    "random paths": at_random,
    "genetic algorithm": by_genetic_algorithm,
    "CMA-ES (cma)": by_cma,
    "gradient descent (ours)": by_gradient,
}


def repeated(structure: StructureSettings, search: Search) -> tuple[float, float, float, float]:
    """Median, lowest and highest condition number over seeds, and processor seconds of one search."""
    began = process_time()
    found = [judged(structure, search(structure, np.random.default_rng(seed))) for seed in range(SEEDS)]
    return float(np.median(found)), min(found), max(found), (process_time() - began) / SEEDS


def duration_rows() -> Iterator[tuple[object, ...]]:
    for name, structure in STRUCTURES.items():
        for duration in DURATIONS_S:
            rng = np.random.default_rng(100)
            random = [judged(structure, random_path(duration, rng)) for _ in range(RANDOM_PATHS)]
            optimised = repeated(structure, partial(by_gradient, duration=duration))
            parameters = model_structure(structure).parameters
            yield name, parameters, duration, float(np.median(random)), min(random), *optimised


def method_rows() -> Iterator[tuple[object, ...]]:
    for name, search in METHODS.items():
        yield name, BUDGET, *repeated(STRUCTURES["seesaw, 5 functions"], search)


def main() -> None:
    table("excitation", BY_DURATION, list(duration_rows()))
    print()
    table("excitation_methods", BY_METHOD, list(method_rows()))


if __name__ == "__main__":
    main()
