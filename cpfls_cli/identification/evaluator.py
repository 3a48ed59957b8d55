"""Evaluate chromosomes: decode, build Q, solve, refine, write back, judge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.identification.chromosome import LARGEST_GENE, decode, encode
from cpfls_cli.identification.fit import Fit
from cpfls_cli.identification.local_search import refine
from cpfls_cli.identification.samples import Samples
from cpfls_cli.identification.settings import LocalSearchSettings
from cpfls_cli.identification.solver import Solver
from cpfls_cli.regressor.structure import ModelStructure

OBJECTIVES = 3
NOT_DEFINED = np.full(OBJECTIVES, np.inf)


@dataclass(frozen=True)
class Evaluator:
    """Gives chromosomes their objectives: mean squared error, largest error, condition number.

    Attributes
    ----------
    solver : Solver
    judge : Samples
        The whole training part, not only the samples learned from: a membership function that falls between two of
        them costs nothing there and everything beside them.
    local_search : LocalSearchSettings
    cross_validated : bool
        Take the solver's cross-validated error for the first objective, not the training part's.
    """

    solver: Solver
    judge: Samples
    local_search: LocalSearchSettings
    cross_validated: bool

    @property
    def structure(self) -> ModelStructure:
        """Structure of the models."""
        return self.judge.structure

    def __call__(self, genes: IntArray) -> Evaluation:
        """Evaluate chromosomes, refining each by local search if enabled.

        Parameters
        ----------
        genes : array of int, shape (individuals, genes)

        Returns
        -------
        Evaluation
            Refined genes and objectives; a chromosome without a finite model gets infinite objectives.
        """
        results = [self._evaluate(chromosome) for chromosome in genes]
        refined = np.array([chromosome for chromosome, _ in results]).reshape(genes.shape)
        return Evaluation(refined, np.array([objectives for _, objectives in results]).reshape(-1, OBJECTIVES))

    def fit(self, chromosome: IntArray) -> Fit | None:
        """Solve for the linear parameters of one chromosome.

        Parameters
        ----------
        chromosome : array of int, shape (genes,)

        Returns
        -------
        Fit or None
            None where a partition is not defined or the model is not finite.
        """
        partitions = self._decode(chromosome)
        if not all(np.isfinite(part).all() for part in partitions):
            return None
        fit = self.solver.fit(partitions)
        return fit if fit is not None and np.isfinite([fit.mean_squared_error, fit.conditioning]).all() else None

    def objectives(self, chromosome: IntArray, fit: Fit) -> Array:
        """Judge a fit by all objectives.

        Parameters
        ----------
        chromosome : array of int, shape (genes,)
        fit : Fit

        Returns
        -------
        array, shape (3,)
            All infinite where one is not finite.
        """
        squares, largest = self.judge.errors(self._decode(chromosome), fit.coefficients, fit.rigid_body)
        rows = 3 * len(self.judge.ready.source)
        mean_squared = fit.mean_squared_error if self.cross_validated else squares[0] / rows
        objectives = np.array([mean_squared, largest[0], fit.conditioning])
        return objectives if np.isfinite(objectives).all() else NOT_DEFINED

    def _evaluate(self, chromosome: IntArray) -> tuple[IntArray, Array]:
        fit = self.fit(chromosome)
        if fit is None:
            return chromosome, NOT_DEFINED
        objectives = self.objectives(chromosome, fit)
        refined = self._refined(chromosome, fit)
        better = self.fit(refined) if refined is not None else None
        if refined is not None and better is not None:
            after = self.objectives(refined, better)
            if after[0] < objectives[0]:
                return refined, after
        return chromosome, objectives

    def _refined(self, chromosome: IntArray, fit: Fit) -> IntArray | None:
        movable = any(partition.functions > 2 for partition in self.structure.partitions)
        if not self.local_search.enabled or not movable or np.isinf(fit.ridge_weight):
            return None
        weights = np.asarray(chromosome / LARGEST_GENE, dtype=float)
        return encode(refine(self.solver, weights, fit, self.local_search.evaluations))

    def _decode(self, chromosome: IntArray) -> tuple[Array, ...]:
        return decode(self.structure, chromosome.astype(float))
