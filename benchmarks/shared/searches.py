"""Searches for good partitions that spend their evaluations on the same evaluator, each with its own operators.

Weights lie on [0, 1]; where an algorithm can take it, the weights that a local search found replace those that it
was given (Lamarckian), as in our genetic algorithm.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import cma
import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.problem import Problem
from scipy.optimize import differential_evolution

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution import Evaluation, EvolutionSettings, start, step
from cpfls_cli.identification.chromosome import LARGEST_GENE, encode, uniform_chromosome
from cpfls_cli.identification.evaluator import Evaluator

# In place of an objective that has no value.
WORST = 1e30


class BudgetSpentError(Exception):
    """End a search, whatever it is doing."""


@dataclass
class Course:
    """Evaluates for a search until its budget is spent, and notes what came when.

    Parameters
    ----------
    evaluator : Evaluator
    budget : int
        Evaluations, a local search inside counted with the one that it belongs to.
    """

    evaluator: Evaluator
    budget: int
    seconds: list[float] = field(default_factory=list)
    inside: float = 0.0
    objectives: list[Array] = field(default_factory=list)
    _begin: float = field(default_factory=time.process_time)

    def __call__(self, genes: IntArray) -> Evaluation:
        """Evaluate chromosomes one after the other."""
        parts = [self._one(chromosome) for chromosome in genes]
        return Evaluation(*(np.concatenate(arrays) for arrays in zip(*((p.genes, p.objectives) for p in parts))))

    def refined(self, weights: Array) -> tuple[Array, Array]:
        """Evaluate weights, shape (n, genes); also give what they were refined to."""
        evaluation = self(encode(weights))
        objectives = np.where(np.isfinite(evaluation.objectives), evaluation.objectives, WORST)
        return evaluation.genes / LARGEST_GENE, objectives

    @property
    def genes(self) -> int:
        return self.evaluator.structure.genes

    def _one(self, chromosome: IntArray) -> Evaluation:
        if len(self.seconds) >= self.budget:
            raise BudgetSpentError
        before = time.process_time()
        evaluation = self.evaluator(chromosome[np.newaxis])
        now = time.process_time()
        self.inside += now - before
        self.seconds.append(now - self._begin)
        self.objectives.append(evaluation.objectives[0])
        return evaluation


Search = Callable[[Course, int], None]


def genetic(settings: EvolutionSettings, with_uniform: bool) -> Search:
    """Search by our genetic algorithm."""

    def search(course: Course, seed: int) -> None:
        initial = uniform_chromosome(course.evaluator.structure)[np.newaxis] if with_uniform else None
        state = start(course, course.genes, settings, np.random.default_rng(seed), initial)
        while True:
            state = step(state, course, settings)

    return search


def nsga2(course: Course, seed: int) -> None:
    algorithm = NSGA2(pop_size=75)
    problem = Problem(n_var=course.genes, n_obj=3, xl=0.0, xu=1.0)
    algorithm.setup(problem, termination=("n_gen", 10**6), seed=seed, verbose=False)
    while True:
        offspring = algorithm.ask()
        weights, objectives = course.refined(offspring.get("X"))
        offspring.set("X", weights)
        for individual, values in zip(offspring, objectives, strict=True):
            individual.F = values
            individual.evaluated.update(["F"])
        algorithm.tell(infills=offspring)


def evolution_strategy(written_back: bool) -> Search:
    """Search by CMA-ES on the logarithm of the mean squared error, started anew where it has converged."""

    def search(course: Course, seed: int) -> None:
        rng, space = np.random.default_rng(seed), {"bounds": [0, 1], "verbose": -9}
        while True:
            options = space | {"seed": int(rng.integers(1, 2**31))}
            strategy = cma.CMAEvolutionStrategy(rng.random(course.genes), 0.3, options)
            while not strategy.stop():
                asked = np.array(strategy.ask())
                weights, objectives = course.refined(asked)
                strategy.tell(list(weights if written_back else asked), np.log(objectives[:, 0]).tolist())

    return search


def differential(course: Course, seed: int) -> None:
    def mean_squared_error(weights: Array) -> float:
        return float(course.refined(weights[np.newaxis])[1][0, 0])

    bounds = [(0.0, 1.0)] * course.genes
    # Three times as many individuals as weights: 72, near the others' 75; the default of 15 times breeds but once.
    differential_evolution(mean_squared_error, bounds, rng=seed, popsize=3, maxiter=10**6, tol=0, polish=False)


def multi_start(course: Course, seed: int) -> None:
    rng = np.random.default_rng(seed)
    while True:
        course(rng.integers(0, LARGEST_GENE + 1, (1, course.genes)))


def searches(paper: EvolutionSettings, default: EvolutionSettings) -> dict[str, Search]:
    """List the searches by the names that tables and plots give them."""
    return {
        "ours, default": genetic(default, with_uniform=True),
        "ours, preset paper": genetic(replace(paper), with_uniform=False),
        "NSGA-II (pymoo)": nsga2,
        "CMA-ES (cma), written back": evolution_strategy(written_back=True),
        "CMA-ES (cma)": evolution_strategy(written_back=False),
        "differential evolution (scipy)": differential,
        "random multi-start": multi_start,
    }
