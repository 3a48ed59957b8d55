"""A start that gains the full rank with the fewest samples: QR with block pivoting."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.reduction.row_space import RowSpace
from cpfls_cli.reduction.survey import project
from cpfls_cli.reduction.ties import first_best

# The Gram matrix of a residual squares its singular values, so below this fraction they are rounding.
_SMALLEST_RATIO = 1e-7


def rank_growing_start(space: RowSpace) -> IntArray:
    """Choose samples by the part of their rows that the chosen ones do not span, until the full rank is spanned.

    The sample taken adds the most rank, three at best; among those, it is the one whose smallest added
    singular value ``sigma_k(R_i (I - U U^T))`` is largest, where U is a basis of the span so far.

    Parameters
    ----------
    space : RowSpace

    Returns
    -------
    array of int
        Samples in the order of selection.

    References
    ----------
    method.md, section 6.
    """
    residual, basis = space.rows.copy(), np.zeros((space.rank, 0))
    available = np.ones(space.samples, dtype=bool)
    # At least one sample has this much left in any direction that is missing.
    threshold = 0.5 * space.rank_tolerance * space.singular_values[0] / np.sqrt(space.samples)
    chosen: list[int] = []
    while basis.shape[1] < space.rank:
        remaining = space.rank - basis.shape[1]
        index = _most_independent(residual, available, min(3, remaining), threshold)
        added = _new_directions(residual[index], basis, threshold)[:, :remaining]
        residual -= project(project(residual, added), added.T)
        basis = np.hstack([basis, added])
        available[index] = False
        chosen.append(index)
    return np.array(chosen, dtype=np.int64)


def _most_independent(residual: Array, available: BoolArray, gain: int, threshold: float) -> int:
    squares = np.linalg.eigvalsh(residual @ residual.swapaxes(1, 2))[:, ::-1]
    values = np.sqrt(np.clip(squares, 0.0, None))
    floor = np.maximum(threshold, _SMALLEST_RATIO * values[:, 0])
    while gain > 1 and not np.any(available & (values[:, gain - 1] > floor)):
        gain -= 1
    return first_best(values[:, gain - 1], available)


def _new_directions(residual: Array, basis: Array, threshold: float) -> Array:
    # A second projection, because a small residual of large rows has lost its orthogonality to the basis.
    clean = residual - (residual @ basis) @ basis.T
    _, values, directions = np.linalg.svd(clean, full_matrices=False)
    kept = np.count_nonzero(values > max(threshold, _SMALLEST_RATIO * values[0]))
    return np.asarray(directions[: max(1, kept)].T)
