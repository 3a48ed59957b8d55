"""Evaluate chromosomes: decode, build Q, solve, refine, write back, judge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.identification.chromosome import LARGEST_GENE, decode, encode
from cpfls_cli.identification.fit import CoefficientSolver, Fit
from cpfls_cli.identification.local_search import refine
from cpfls_cli.identification.settings import LocalSearchSettings
from cpfls_cli.regressor.regressor import Regressor

OBJECTIVES = 3
NOT_DEFINED = np.full(OBJECTIVES, np.inf)


@dataclass(frozen=True)
class Evaluator:
    """Gives chromosomes their objectives: mean squared error, largest error, condition number.

    Attributes
    ----------
    regressor : Regressor
        Of the training samples.
    solver : CoefficientSolver
    local_search : LocalSearchSettings
    """

    regressor: Regressor
    solver: CoefficientSolver
    local_search: LocalSearchSettings

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
        """Solve for the coefficients of one chromosome.

        Parameters
        ----------
        chromosome : array of int, shape (genes,)

        Returns
        -------
        Fit or None
            None where a partition is not defined or the model is not finite.
        """
        partitions = decode(self.regressor.structure, chromosome.astype(float))
        if not all(np.isfinite(part).all() for part in partitions):
            return None
        Q = self.regressor.matrix(partitions)
        # A very narrow function has slopes beyond what the decomposition can carry.
        if not np.isfinite(Q).all() or np.max(np.abs(Q)) > 1e100:
            return None
        fit = self.solver.fit(Q)
        return fit if np.isfinite(fit.objectives).all() else None

    def _evaluate(self, chromosome: IntArray) -> tuple[IntArray, Array]:
        fit = self.fit(chromosome)
        if fit is None:
            return chromosome, NOT_DEFINED
        refined = self._refined(chromosome, fit)
        if refined is not None:
            better = self.fit(refined)
            if better is not None and better.mean_squared_error < fit.mean_squared_error:
                return refined, better.objectives
        return chromosome, fit.objectives

    def _refined(self, chromosome: IntArray, fit: Fit) -> IntArray | None:
        movable = any(partition.functions > 2 for partition in self.regressor.structure.partitions)
        if not self.local_search.enabled or not movable or np.isinf(fit.ridge_weight):
            return None
        weights = np.asarray(chromosome / LARGEST_GENE, dtype=float)
        return encode(refine(self.regressor, self.solver, weights, fit, self.local_search.evaluations))
