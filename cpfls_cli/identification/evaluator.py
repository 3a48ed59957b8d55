"""Evaluate chromosomes: decode, solve, refine by a projected Levenberg-Marquardt method, write back, judge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.fuzzy.basis import breakpoints
from cpfls_cli.identification.samples import Products, Samples
from cpfls_cli.identification.settings import LocalSearchSettings
from cpfls_cli.identification.solver import Fit, Ridge, Solver
from cpfls_cli.least_squares import NormalEquations, damped_step, quick_solution
from cpfls_cli.regressor.structure import ModelStructure

LARGEST_GENE = 2**16 - 1


def decode(structure: ModelStructure, weights: Array) -> tuple[Array, ...]:
    """Decode weights >= 0 into the breakpoints of every partition; only their ratios within a partition count.

    NaN in a partition whose weights are all zero. Equation (10); method.md sections 4 and 7 for the order.
    """
    decoded: list[Array] = [np.empty(0)] * len(structure.partitions)
    for partitions, genes in structure.alike:
        for index, ends in zip(partitions, breakpoints(weights[genes]), strict=True):
            decoded[index] = ends
    return tuple(decoded)


def encode(weights: Array) -> IntArray:
    """Round weights on [0, 1] to genes of at least 1: a function of zero width would make the output jump."""
    return np.clip(np.rint(weights * LARGEST_GENE), 1, LARGEST_GENE).astype(np.int64)


def weight_jacobian(structure: ModelStructure, weights: Array) -> Array:
    """Differentiate all inner breakpoints by all weights, ``d b_k / d a_j = ([j <= k] - b_k) / sum a``.

    No partition may be all zero.
    """
    inner = np.concatenate([ends[1:-1] for ends in decode(structure, weights)])
    total = np.array([np.sum(weights[part]) for part in structure.weight_slices()])
    own, counted, partition = structure.inner
    return np.where(own, (counted - inner[:, None]) / total[partition][:, None], 0.0)


def uniform_chromosome(structure: ModelStructure) -> IntArray:
    """Encode the equidistant partitions, shape (genes,)."""
    return np.full(structure.genes, LARGEST_GENE // 2, dtype=np.int64)


OBJECTIVES = 3
NOT_DEFINED = np.full(OBJECTIVES, np.inf)

# Tuned on seeds and starts that no table is made of.
_FIRST_DAMPING = 1e-3
_TRUSTED, _DISTRUSTED = 0.75, 0.25
_LOWER, _RAISE = 0.1, 1e3
# Weights keep this share in one step: a function that gets narrow at once is one that falls between samples.
_KEPT = 0.85
# Below this share of the torque the difference of two sums has lost too many digits to compare by.
_SMALL_ERROR = 1e-9


@dataclass(frozen=True)
class ChromosomePoint:
    """A chromosome with the linear parameters that its partitions need, at a given ridge.

    `factor`: Cholesky factor of the matrix whose rows and columns are multiplied by `scale`; `square`: smallest sum of
    squared residuals, penalty included.
    """

    genes: IntArray
    products: Products
    equations: NormalEquations
    solution: Array
    factor: tuple[Array, bool]
    scale: Array
    square: float


@dataclass(frozen=True)
class Problem:
    """Partition weights as nonlinear least squares with the linear parameters eliminated, from the ridge at the start.

    Its weight is finite. Ridge weight and column sizes stay those of the start: a penalty that moved with the
    columns would add a term to the gradient that variable projection leaves out.
    """

    solver: Solver
    start: Ridge | Fit

    def point(self, genes: IntArray, products: Products) -> ChromosomePoint:
        """Solve for the linear parameters of a chromosome, whose products are given."""
        total = products.sum()
        equations = self.solver.equations(total, self.start.ridge_weight, self.start.column_size)
        solution, factor, scale = quick_solution(equations)
        square = float(total.square[0] - equations.moment @ solution)
        if square < _SMALL_ERROR * total.square[0]:
            parameters = self.solver.parameters(solution, self.start.column_size)
            partitions = decode(self.solver.learned.structure, genes.astype(float))
            square = float(
                self.solver.learned.errors(partitions, *parameters)[0].sum() + equations.penalty @ solution**2
            )
        return ChromosomePoint(genes, products, equations, solution, factor, scale, square)

    def linearised(self, point: ChromosomePoint) -> tuple[Array, Array]:
        """Give ``J^T J`` and ``J^T r`` of residual r and Jacobian J by the weights, by Kaufman's approximation.

        With M the derivatives of the torque by the weights at fixed parameters and A the columns, the Jacobian is
        ``J = -(I - A A^+) M``: so ``J^T J = M^T M - (A^T M)^T (A^T A)^-1 (A^T M)``, and ``J^T r = -M^T r`` because the
        residual is orthogonal to A.
        """
        learned, size = self.solver.learned, self.start.column_size
        weights = point.genes / LARGEST_GENE
        partitions = decode(learned.structure, point.genes.astype(float))
        moved = learned.moved(partitions, *self.solver.parameters(point.solution, size))
        by_weight, scale = weight_jacobian(learned.structure, weights), point.scale
        divide = np.ones(len(point.solution))
        divide[len(divide) - len(size) :] = size
        onto = (moved.columns @ by_weight) / divide[:, None]
        spanned = onto.T @ (scale[:, None] * linalg.cho_solve(point.factor, scale[:, None] * onto, check_finite=False))
        normal = by_weight.T @ moved.moved @ by_weight - spanned
        return 0.5 * (normal + normal.T), -by_weight.T @ moved.residual


def refine(problem: Problem, genes: IntArray, products: Products, evaluations: int) -> ChromosomePoint:
    """Refine a chromosome, no partition of which is all zero, by a projected Levenberg-Marquardt method.

    Gives the best point found within so many model evaluations: the start, whose products are given, or one whose genes
    are at least 1. method.md section 7; Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973); Kaufman, BIT 15 (1975);
    Marquardt, J. SIAM 11 (1963).
    """
    structure = problem.solver.learned.structure
    best, damping = problem.point(genes, products), _FIRST_DAMPING
    linear: tuple[Array, Array] | None = None
    for _ in range(evaluations - 1):
        linear = linear or problem.linearised(best)
        weights = best.genes / LARGEST_GENE
        tried = encode(stepped(weights, *linear, damping))
        if np.array_equal(tried, best.genes):
            break
        found = problem.solver.products(decode(structure, tried.astype(float)))
        trial = None if found is None else problem.point(tried, found)
        if trial is None or not trial.square < best.square:
            damping *= _RAISE
            continue
        damping *= _changed(best, trial, *linear)
        best, linear = trial, None
    return best


def _changed(before: ChromosomePoint, after: ChromosomePoint, normal: Array, gradient: Array) -> float:
    """Factor of the damping after a good step: how much of what was promised has come."""
    step = (after.genes - before.genes) / LARGEST_GENE
    promised = -float(2.0 * gradient @ step + step @ normal @ step)
    came = before.square - after.square
    return _LOWER if came > _TRUSTED * promised else _RAISE if came < _DISTRUSTED * promised else 1.0


def stepped(weights: Array, normal: Array, gradient: Array, damping: float) -> Array:
    """Take a damped step of weights, shape (genes,), on [0, 1], as is what they become; see `damped_step`."""
    low = _KEPT * weights
    step = damped_step(normal, gradient, damping, low - weights, 1.0 - weights)
    return np.clip(weights + step, low, 1.0)


@dataclass(frozen=True)
class Evaluator:
    """Evaluate chromosomes by their objectives: mean squared error, largest error, condition number.

    Attributes
    ----------
    judge : Samples
        The whole training part where `judged_on` does not say otherwise: a membership function that falls between two
        samples learned from costs nothing there and everything elsewhere.
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
        """Evaluate chromosomes, shape (individuals, genes), refining each by local search if enabled.

        A chromosome without a finite model gets infinite objectives.
        """
        results = [self._evaluate(chromosome) for chromosome in genes]
        refined = np.array([chromosome for chromosome, _ in results]).reshape(genes.shape)
        return Evaluation(refined, np.array([objectives for _, objectives in results]).reshape(-1, OBJECTIVES))

    def fit(self, chromosome: IntArray, products: Products | None = None, ridge: Ridge | None = None) -> Fit | None:
        """Solve for the linear parameters of one chromosome, shape (genes,), given what of it is known already.

        None where a partition is not defined or the model is not finite.
        """
        fit = self.solver.fit(self._decode(chromosome), products, ridge)
        return fit if fit is not None and np.isfinite([fit.mean_squared_error, fit.conditioning]).all() else None

    def objectives(self, chromosome: IntArray, fit: Fit) -> Array:
        """Judge a fit by all objectives.

        Parameters
        ----------
        chromosome : array of int, shape (genes,)

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
        products = self.solver.products(self._decode(chromosome))
        if products is None:
            return chromosome, NOT_DEFINED
        ridge, genes, after = self.solver.ridge_of(self._decode(chromosome), products), chromosome, NOT_DEFINED
        movable = any(partition.functions > 2 for partition in self.structure.partitions)
        if self.local_search.enabled and movable and not np.isinf(ridge.ridge_weight):
            refined = refine(Problem(self.solver, ridge), chromosome, products, self.local_search.evaluations)
            if refined.products is not products:
                genes, after = refined.genes, self._judged(refined.genes, refined.products)
            # Nothing is asked of a chromosome that is replaced whatever it is worth.
            if self.local_search.reinsert == "always" and np.isfinite(after).all():
                return genes, after
        objectives = self._judged(chromosome, products, ridge)
        return (genes, after) if after[0] < objectives[0] else (chromosome, objectives)

    def _judged(self, chromosome: IntArray, products: Products, ridge: Ridge | None = None) -> Array:
        fit = self.fit(chromosome, products, ridge)
        return NOT_DEFINED if fit is None else self.objectives(chromosome, fit)

    def _decode(self, chromosome: IntArray) -> tuple[Array, ...]:
        return decode(self.structure, chromosome.astype(float))
