"""Searches for good partitions that spend their evaluations on the same evaluator, each with its own operators.

All but the paper's start with the equidistant partitions among random ones. Weights lie on [0, 1]; where an algorithm
can take it, the weights that a local search found replace those that it was given (Lamarckian), as in our genetic
algorithm. That is all of them but scipy's differential evolution, which lets nobody change its individuals.
"""

from __future__ import annotations

import contextlib
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field

import cma
import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.problem import Problem
from scipy.optimize import differential_evolution

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.evolution.engine import start, step
from cpfls_cli.identification.evaluator import LARGEST_GENE, Evaluator, encode, uniform_chromosome
from cpfls_cli.identification.settings import IdentificationSettings

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
        refined, objectives = ([getattr(part, name) for part in parts] for name in ("genes", "objectives"))
        return Evaluation(np.concatenate(refined), np.concatenate(objectives))

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


def spent(search: Search, evaluator: Evaluator, seed: int, budget: int) -> Course:
    """Let a search spend its budget."""
    course = Course(evaluator, budget)
    with contextlib.suppress(BudgetSpentError), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        search(course, seed)
    return course


def with_uniform(course: Course, rng: np.random.Generator, count: int) -> Array:
    """Draw weights to start with, shape (count, genes), the first those of the equidistant partitions."""
    weights = rng.random((count, course.genes))
    weights[0] = 0.5
    return weights


def genetic(settings: IdentificationSettings) -> Search:
    """Search by our genetic algorithm."""

    def search(course: Course, seed: int) -> None:
        initial = uniform_chromosome(course.evaluator.structure)[np.newaxis]
        first = initial if settings.start == "with-uniform" else None
        state = start(course, course.genes, settings, np.random.default_rng(seed), first)
        while True:
            state = step(state, course, settings)

    return search


def nsga2(course: Course, seed: int) -> None:
    first = with_uniform(course, np.random.default_rng(seed), 75)
    algorithm = NSGA2(pop_size=75, sampling=first)
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


def evolution_strategy(course: Course, seed: int) -> None:
    """Search by CMA-ES on the logarithm of the mean squared error, started anew where it has converged."""
    rng = np.random.default_rng(seed)
    first = with_uniform(course, rng, 1)[0]
    while True:
        options = {"bounds": [0, 1], "verbose": -9, "seed": int(rng.integers(1, 2**31))}
        strategy = cma.CMAEvolutionStrategy(first, 0.3, options)
        while not strategy.stop():
            weights, objectives = course.refined(np.array(strategy.ask()))
            strategy.tell(list(weights), np.log(objectives[:, 0]).tolist())
        first = rng.random(course.genes)


def differential(course: Course, seed: int) -> None:
    def mean_squared_error(weights: Array) -> float:
        return float(course.refined(weights[np.newaxis])[1][0, 0])

    bounds = [(0.0, 1.0)] * course.genes
    # scipy's default of 15 individuals for each weight would breed but twice in the budget.
    first = with_uniform(course, np.random.default_rng(seed), 75)
    differential_evolution(mean_squared_error, bounds, rng=seed, init=first, maxiter=10**6, tol=0, polish=False)


def multi_start(course: Course, seed: int) -> None:
    rng = np.random.default_rng(seed)
    course.refined(with_uniform(course, rng, 1))
    while True:
        course.refined(rng.random((1, course.genes)))


def searches(paper: IdentificationSettings, default: IdentificationSettings) -> dict[str, Search]:
    """List the searches by the names that tables and plots give them."""
    return {
        "ours, default": genetic(default),
        "ours, preset paper": genetic(paper),
        "NSGA-II (pymoo)": nsga2,
        "CMA-ES (cma)": evolution_strategy,
        "differential evolution (scipy)": differential,
        "random multi-start": multi_start,
    }
