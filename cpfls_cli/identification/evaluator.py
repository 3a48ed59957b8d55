"""Evaluate chromosomes: decode, build Q, solve, refine by a local search, write back, judge."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import linalg
from scipy.optimize import least_squares

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.fuzzy.membership import breakpoint_jacobian, breakpoints
from cpfls_cli.identification.least_squares import quick_solution
from cpfls_cli.identification.samples import Samples
from cpfls_cli.identification.settings import LocalSearchSettings
from cpfls_cli.identification.solver import Fit, Solver
from cpfls_cli.regressor.structure import ModelStructure

LARGEST_GENE = 2**16 - 1

OBJECTIVES = 3
NOT_DEFINED = np.full(OBJECTIVES, np.inf)


def decode(structure: ModelStructure, weights: Array) -> tuple[Array, ...]:
    """Decode weights into the breakpoints of every partition.

    Parameters
    ----------
    structure : ModelStructure
    weights : array, shape (genes,), >= 0
        Genes, or weights on any scale: only their ratios within a partition count.

    Returns
    -------
    tuple of array, shape (functions,)
        NaN in a partition whose weights are all zero.

    References
    ----------
    Equation (10); method.md sections 4 and 7 for the order.
    """
    return tuple(breakpoints(np.asarray(weights[part], dtype=float)) for part in structure.weight_slices())


def encode(weights: Array) -> IntArray:
    """Round weights on [0, 1] to genes.

    Parameters
    ----------
    weights : array, shape (genes,)

    Returns
    -------
    array of int, shape (genes,)
        At least 1: a function of zero width would make the output jump.
    """
    return np.clip(np.rint(weights * LARGEST_GENE), 1, LARGEST_GENE).astype(np.int64)


def weight_jacobian(structure: ModelStructure, weights: Array) -> Array:
    """Differentiate all inner breakpoints by all weights.

    Parameters
    ----------
    structure : ModelStructure
    weights : array, shape (genes,)
        No partition all zero.

    Returns
    -------
    array, shape (inner breakpoints of all partitions, genes)
    """
    parts = (weights[part] for part in structure.weight_slices())
    blocks = (breakpoint_jacobian(part) if len(part) > 1 else np.zeros((0, len(part))) for part in parts)
    return np.asarray(linalg.block_diag(*blocks), dtype=float)


def uniform_chromosome(structure: ModelStructure) -> IntArray:
    """Encode the equidistant partitions.

    Returns
    -------
    array of int, shape (genes,)
    """
    return np.full(structure.genes, LARGEST_GENE // 2, dtype=np.int64)


@dataclass(frozen=True)
class _Linearised:
    """The residual of all samples and its Jacobian, rotated so that all but the first few rows are zero.

    A turn changes neither the sum of squares nor its derivatives, and a trust-region method sees nothing else.
    """

    residual: Array
    jacobian: Array


@dataclass
class _ReducedProblem:
    """Residual and Jacobian of the weights with the linear parameters solved for, each point computed once."""

    solver: Solver
    start: Fit
    _point: Array = field(default_factory=lambda: np.empty(0))
    _linearised: _Linearised | None = None

    def residual(self, weights: Array) -> Array:
        return self._at(weights).residual

    def jacobian(self, weights: Array) -> Array:
        return self._at(weights).jacobian

    def _at(self, weights: Array) -> _Linearised:
        if self._linearised is None or not np.array_equal(weights, self._point):
            self._linearised, self._point = _linearise(self.solver, weights, self.start), weights.copy()
        return self._linearised


def refine(solver: Solver, weights: Array, start: Fit, evaluations: int) -> Array:
    """Refine partition weights by nonlinear least squares with the linear parameters eliminated.

    Ridge weight and column sizes stay those of the start: a penalty that moved with the columns would add a term to
    the gradient that variable projection leaves out.

    Parameters
    ----------
    solver : Solver
    weights : array, shape (genes,)
        On [0, 1], no partition all zero.
    start : Fit
        The fit at these weights; its ridge weight is finite.
    evaluations : int
        Largest number of model evaluations.

    Returns
    -------
    array, shape (genes,)
        On [0, 1].

    References
    ----------
    method.md section 7; Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973); Kaufman, BIT 15 (1975).
    """
    problem = _ReducedProblem(solver, start)
    optimum = least_squares(
        problem.residual, weights, jac=problem.jacobian, bounds=(0.0, 1.0), max_nfev=evaluations, x_scale="jac"
    )
    return np.asarray(optimum.x, dtype=float)


def _linearise(solver: Solver, weights: Array, start: Fit) -> _Linearised:
    """Linearise the residual by Kaufman's approximation, from sums over samples alone.

    With M the derivatives of the torque by the weights at fixed parameters and A the columns, the Jacobian is
    ``J = -(I - A A^+) M``: so ``J^T J = M^T M - (A^T M)^T (A^T A)^-1 (A^T M)``, and ``J^T r = -M^T r`` because the
    residual is orthogonal to A.
    """
    structure = solver.learned.structure
    partitions = decode(structure, weights)
    equations = solver.equations(partitions, start.ridge_weight, start.column_size)
    solution, factor, scale = quick_solution(equations)
    coefficients, rigid_body = solver.parameters(solution, start.column_size)
    moved = solver.learned.moved(partitions, coefficients, rigid_body)
    by_weight = weight_jacobian(structure, weights)
    divide = np.ones(len(solution))
    divide[len(solution) - len(start.column_size) :] = start.column_size
    onto = (moved.columns @ by_weight) / divide[:, None]
    spanned = onto.T @ (scale[:, None] * linalg.cho_solve(factor, scale[:, None] * onto, check_finite=False))
    square = moved.square + float(equations.penalty @ solution**2)
    return _turned(by_weight.T @ moved.moved @ by_weight - spanned, -by_weight.T @ moved.residual, square)


def _turned(normal: Array, gradient: Array, square: float) -> _Linearised:
    """Find few rows with given ``J^T J``, ``J^T r`` and ``r^T r``."""
    eigenvalues, vectors = np.linalg.eigh(0.5 * (normal + normal.T))
    # Directions that leave every breakpoint where it is, up to rounding.
    roots = np.sqrt(np.where(eigenvalues > 1e-14 * max(eigenvalues[-1], 0.0), eigenvalues, 0.0))
    along = np.where(roots > 0, vectors.T @ gradient / np.where(roots > 0, roots, 1.0), 0.0)
    rest = np.sqrt(max(square - float(along @ along), 0.0))
    jacobian = np.vstack([roots[:, None] * vectors.T, np.zeros(len(roots))])
    return _Linearised(np.append(along, rest), jacobian)


@dataclass(frozen=True)
class Evaluator:
    """Evaluate chromosomes by their objectives: mean squared error, largest error, condition number.

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
