"""Evaluate chromosomes: decode, build Q, solve, refine, write back, judge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.identification.chromosome import LARGEST_GENE, decode, encode
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.fit import CoefficientSolver, Fit
from cpfls_cli.identification.local_search import refine
from cpfls_cli.identification.rigid_base import rigid_columns
from cpfls_cli.identification.settings import LocalSearchSettings
from cpfls_cli.regressor.regressor import Regressor
from cpfls_cli.regressor.structure import ModelStructure

OBJECTIVES = 3
NOT_DEFINED = np.full(OBJECTIVES, np.inf)


@dataclass(frozen=True)
class Judge:
    """Measures torque errors of fits over the whole training part, not only over the samples they learned from.

    A membership function that falls between two learned samples costs nothing there and everything beside them.

    Attributes
    ----------
    regressor : Regressor
        Of the training part.
    rigid : array, shape (samples, 3, 6)
    torque : array, shape (samples, 3), N m
    """

    regressor: Regressor
    rigid: Array
    torque: Array

    @classmethod
    def of(cls, training: TorqueData, regressor: Regressor) -> Judge:
        """Prepare a judge for a training part and its regressor."""
        return cls(regressor, rigid_columns(training.motion), training.torque)

    def error(self, partitions: tuple[Array, ...], fit: Fit) -> Array:
        """Compute the torque error of a fit.

        Parameters
        ----------
        partitions : tuple of array
        fit : Fit

        Returns
        -------
        array, shape (samples, 3), N m
        """
        model = self.regressor.torque(partitions, fit.coefficients) + self.rigid @ fit.rigid_body
        return np.asarray(self.torque - model)


@dataclass(frozen=True)
class Evaluator:
    """Gives chromosomes their objectives: mean squared error, largest error, condition number.

    Attributes
    ----------
    solver : CoefficientSolver
    judge : Judge
    local_search : LocalSearchSettings
    cross_validated : bool
        Take the solver's cross-validated error for the first objective, not the training part's.
    """

    solver: CoefficientSolver
    judge: Judge
    local_search: LocalSearchSettings
    cross_validated: bool

    @property
    def structure(self) -> ModelStructure:
        """Structure of the models."""
        return self.solver.regressor.structure

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
        return fit if fit is not None and np.isfinite(fit.mean_squared_error) and fit.system.rank > 0 else None

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
        error = self.judge.error(self._decode(chromosome), fit)
        mean_squared = fit.mean_squared_error if self.cross_validated else float(np.mean(error**2))
        objectives = np.array([mean_squared, np.max(np.abs(error)), fit.system.conditioning])
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
