"""Linear least squares from sums of products, refined once against the samples."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array

Blocks = Callable[[], Iterator[tuple[Array, Array]]]


@dataclass(frozen=True)
class RidgeSolution:
    """Solution of ``min |A c - y|^2 + weight |c|^2``.

    Attributes
    ----------
    coefficients : array, shape (coefficients,)
        Of minimum norm where the samples do not determine all.
    rank : int
        Number of singular values of A above the tolerance.
    condition_number : float
        Largest over smallest kept singular value of A; infinite for rank zero.
    effective_coefficients : float
        Trace of the matrix that takes y to its fit: the rank without a weight, less with one.
    residual_square : float
        Sum of the squared residuals.
    """

    coefficients: Array
    rank: int
    condition_number: float
    effective_coefficients: float
    residual_square: float


def solve_ridge(blocks: Blocks, weight: float, rank_tolerance: float) -> RidgeSolution:
    """Solve a least-squares problem whose rows come in blocks.

    The eigenvalues of the sums are the squares of the singular values, which costs digits; one step of refinement
    with the residuals of the samples themselves gives them back.

    Parameters
    ----------
    blocks : callable
        Gives the rows of A and y, block after block; called twice.
    weight : float
        Weight of the squared coefficients.
    rank_tolerance : float
        Singular values below this share of the largest count as zero.

    References
    ----------
    Björck, Numerical Methods for Least Squares Problems (1996), sections 2.9 and 6.6.
    """
    gram, moment = _sums(blocks)
    squares, vectors = np.linalg.eigh(gram)
    kept = squares > rank_tolerance**2 * squares[-1]
    squares, vectors = squares[kept], vectors[:, kept]

    def solved(right_side: Array) -> Array:
        return np.asarray(vectors @ ((vectors.T @ right_side) / (squares + weight)))

    first = solved(moment)
    square, back = _residual(blocks, first)
    step = solved(back - weight * first)
    rank = len(squares)
    return RidgeSolution(
        coefficients=first + step,
        rank=rank,
        condition_number=float(np.sqrt(squares[-1] / squares[0])) if rank else float("inf"),
        effective_coefficients=float(np.sum(squares / (squares + weight))),
        residual_square=max(0.0, square - float(step @ (2.0 * back - gram @ step))),
    )


def _sums(blocks: Blocks) -> tuple[Array, Array]:
    gram, moment = None, None
    for columns, values in blocks():
        own, right = columns.T @ columns, columns.T @ values
        gram, moment = (own, right) if gram is None or moment is None else (gram + own, moment + right)
    if gram is None or moment is None:
        raise ValueError("no rows")
    return gram, moment


def _residual(blocks: Blocks, coefficients: Array) -> tuple[float, Array]:
    """Sum of the squared residuals, and the residuals times the columns."""
    square, back = 0.0, np.zeros_like(coefficients)
    for columns, values in blocks():
        residual = values - columns @ coefficients
        square += float(residual @ residual)
        back += columns.T @ residual
    return square, back
