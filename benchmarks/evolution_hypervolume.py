"""Compare the genetic algorithm with NSGA-II and random search at equal numbers of evaluations.

Run as ``python benchmarks/evolution_hypervolume.py``; it needs the ``bench`` extra (pymoo). Each row is the
median and the range, over the seeds, of the hypervolume of all non-dominated vectors ever evaluated, in per
cent of the hypervolume of the true front.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.problem import Problem
from pymoo.indicators.hv import HV
from pymoo.optimize import minimize

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.evolution.engine import start, step
from cpfls_cli.evolution.ranking import pareto_front
from cpfls_cli.evolution.settings import EvolutionSettings
from cpfls_cli.identification.settings import PRESETS

EVALUATIONS = 5000
SEEDS = range(5)
# The small mutation rates breed many known chromosomes, which cost no evaluation; this ends a stalled run.
MOST_GENERATIONS = 5000
LARGEST_GENE = 2**16 - 1


@dataclass(frozen=True)
class TestProblem:
    """A published problem on the unit cube, with the hypervolume of its true front below the reference."""

    name: str
    evaluate: Callable[[Array], Array]
    variables: int
    reference: tuple[float, ...]
    best_hypervolume: float


def zdt1(x: Array) -> Array:
    g = 1 + 9 * x[:, 1:].mean(axis=1)
    return np.column_stack([x[:, 0], g * (1 - np.sqrt(x[:, 0] / g))])


def dtlz2(x: Array) -> Array:
    g = 1 + np.sum((x[:, 2:] - 0.5) ** 2, axis=1)
    (c1, s1), (c2, s2) = ((np.cos(a), np.sin(a)) for a in x[:, :2].T * np.pi / 2)
    return np.column_stack([g * c1 * c2, g * c1 * s2, g * s1])


PROBLEMS = (
    TestProblem("ZDT1", zdt1, 30, (1.1, 6.0), 1.1 * 6.0 - 1 / 3),
    TestProblem("DTLZ2", dtlz2, 12, (2.0, 2.0, 2.0), 8.0 - np.pi / 6),
)


def evolution(problem: TestProblem, seed: int, settings: EvolutionSettings) -> Array:
    def evaluate(genes: IntArray) -> Evaluation:
        return Evaluation(genes, problem.evaluate(genes / LARGEST_GENE))

    state = start(evaluate, problem.variables, settings, np.random.default_rng(seed))
    while len(state.archive) < EVALUATIONS and state.index < MOST_GENERATIONS:
        state = step(state, evaluate, settings)
    if len(state.archive) < EVALUATIONS:
        raise RuntimeError(f"only {len(state.archive)} chromosomes in {state.index} generations")
    return state.archive.results.objectives[:EVALUATIONS]


def nsga2(problem: TestProblem, seed: int) -> Array:
    evaluated: list[Array] = []

    class Recorded(Problem):
        def __init__(self) -> None:
            super().__init__(n_var=problem.variables, n_obj=len(problem.reference), xl=0.0, xu=1.0)

        def _evaluate(self, x: Array, out: dict[str, Array], *_args: object, **_options: object) -> None:
            out["F"] = problem.evaluate(x)
            evaluated.append(out["F"])

    minimize(Recorded(), NSGA2(pop_size=100), ("n_eval", EVALUATIONS), seed=seed)
    return np.concatenate(evaluated)[:EVALUATIONS]


def random_search(problem: TestProblem, seed: int) -> Array:
    return problem.evaluate(np.random.default_rng(seed).random((EVALUATIONS, problem.variables)))


def hypervolume_share(problem: TestProblem, objectives: Array) -> float:
    front = objectives[pareto_front(objectives)]
    return 100 * float(HV(ref_point=np.array(problem.reference))(front)) / problem.best_hypervolume


def algorithms() -> dict[str, Callable[[TestProblem, int], Array]]:
    keys = {field.name for field in fields(EvolutionSettings)}
    paper = EvolutionSettings(**{key: value for key, value in PRESETS["paper"].items() if key in keys})
    rankings = ("quantity-dominance", "pareto-count", "pareto-fronts")
    variants = {
        f"paper, {ranking}, {reinsertion}, population {population}": partial(
            evolution,
            settings=replace(paper, population=population, ranking=ranking, reinsertion=reinsertion),
        )
        for population, ranking, reinsertion in itertools.product((75, 200), rankings, ("uniform", "fitness"))
    }
    defaults = {
        f"default, {ranking}, population {population}": partial(
            evolution, settings=EvolutionSettings(population=population, ranking=ranking)
        )
        for population, ranking in itertools.product((30, 75), rankings)
    }
    return variants | defaults | {"NSGA-II (pymoo), population 100": nsga2, "random search": random_search}


def main() -> None:
    rows = []
    for name, run in algorithms().items():
        cells = [name]
        for problem in PROBLEMS:
            shares = [hypervolume_share(problem, run(problem, seed)) for seed in SEEDS]
            cells.append(f"{np.median(shares):.1f} ({min(shares):.1f} to {max(shares):.1f})")
        rows.append(cells)
    table("evolution_hypervolume", ("algorithm", *(problem.name for problem in PROBLEMS)), rows)


if __name__ == "__main__":
    main()
