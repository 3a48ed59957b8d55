"""The reference that the fast evaluator is tested against: dense Q, singular value decomposition, 2-point Jacobian."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.evaluator import LARGEST_GENE, NOT_DEFINED, OBJECTIVES, decode, encode
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.identification.solver import LARGEST_SQUARE, NO_RIGID_BODY, Fit
from cpfls_cli.regressor.regressor import Breakpoints, Regressor, data_ranges
from cpfls_cli.regressor.structure import ModelStructure, model_structure


@dataclass(frozen=True)
class ReferenceEvaluator:
    """Evaluate chromosomes step by step as the paper writes it; for tests and benchmarks."""

    training: TorqueData
    learned: TorqueData
    settings: IdentificationSettings

    @cached_property
    def structure(self) -> ModelStructure:
        """Structure of the models."""
        return model_structure(self.settings)

    def __call__(self, genes: IntArray) -> Evaluation:
        """Evaluate chromosomes, refining each by local search if enabled."""
        results = [self._evaluate(chromosome) for chromosome in genes]
        refined = np.array([chromosome for chromosome, _ in results]).reshape(genes.shape)
        return Evaluation(refined, np.array([objectives for _, objectives in results]).reshape(-1, OBJECTIVES))

    def fit(self, chromosome: IntArray) -> Fit | None:
        """Solve for the coefficients of one chromosome, ``c = V S^-1 U^T tau``. None where it is not finite."""
        partitions = self._decode(chromosome)
        if not all(np.isfinite(part).all() for part in partitions):
            return None
        Q = _matrix(self._learned, partitions)
        if not np.max(np.abs(Q)) <= np.sqrt(LARGEST_SQUARE):
            return None
        coefficients, conditioning = _solve(Q, self.learned.torque.reshape(-1), self.settings.rank_tolerance)
        if not np.isfinite(conditioning):
            return None
        mean_squared = float(np.mean((self.learned.torque.reshape(-1) - Q @ coefficients) ** 2))
        return Fit(coefficients, NO_RIGID_BODY, 0.0, mean_squared, conditioning, np.ones(3), np.ones(Q.shape[1]))

    def objectives(self, chromosome: IntArray, fit: Fit) -> Array:
        """Judge a fit by all objectives."""
        error = self.training.torque.reshape(-1) - _matrix(self._whole, self._decode(chromosome)) @ fit.coefficients
        objectives = np.array([np.mean(error**2), np.max(np.abs(error)), fit.conditioning])
        return objectives if np.isfinite(objectives).all() else NOT_DEFINED

    def refine(self, weights: Array) -> Array:
        """Refine partition weights by nonlinear least squares, differentiated through the whole solve."""
        torque, evaluations = self.learned.torque.reshape(-1), self.settings.local_search.evaluations

        def residual(weights: Array) -> Array:
            Q = _matrix(self._learned, decode(self.structure, weights))
            return np.asarray(torque - Q @ _solve(Q, torque, self.settings.rank_tolerance)[0])

        optimum = least_squares(
            residual, weights, jac="2-point", bounds=(0.0, 1.0), x_scale="jac", max_nfev=evaluations
        )
        return np.asarray(optimum.x, dtype=float)

    @cached_property
    def _whole(self) -> Regressor:
        motion = self.training.motion
        return Regressor(self.structure, motion, data_ranges(self.structure, motion.attitude))

    @cached_property
    def _learned(self) -> Regressor:
        return Regressor(self.structure, self.learned.motion, self._whole.ranges)

    def _evaluate(self, chromosome: IntArray) -> tuple[IntArray, Array]:
        fit = self.fit(chromosome)
        if fit is None:
            return chromosome, NOT_DEFINED
        objectives = self.objectives(chromosome, fit)
        if not self.settings.local_search.enabled:
            return chromosome, objectives
        refined = encode(self.refine(np.asarray(chromosome / LARGEST_GENE, dtype=float)))
        better = self.fit(refined)
        after = NOT_DEFINED if better is None else self.objectives(refined, better)
        return (refined, after) if after[0] < objectives[0] else (chromosome, objectives)

    def _decode(self, chromosome: IntArray) -> tuple[Array, ...]:
        return decode(self.structure, chromosome.astype(float))


def _matrix(regressor: Regressor, partitions: Breakpoints) -> Array:
    return regressor.matrix(partitions).reshape(3 * len(regressor.motion), -1)


def _solve(Q: Array, torque: Array, rank_tolerance: float) -> tuple[Array, float]:
    """Coefficients of smallest norm, and the condition number; one of smaller rank is always worse."""
    U, singular_values, Vt = np.linalg.svd(Q, full_matrices=False)
    rank = int(np.count_nonzero(singular_values > rank_tolerance * singular_values[0]))
    if rank == 0:
        return np.zeros(Q.shape[1]), np.inf
    coefficients = Vt[:rank].T @ ((U[:, :rank].T @ torque) / singular_values[:rank])
    missing = Q.shape[1] - rank
    condition = singular_values[0] / singular_values[rank - 1] if missing == 0 else (1.0 + missing) / rank_tolerance
    return coefficients, float(condition)
