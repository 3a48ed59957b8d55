"""Eigenvalues of ``G + R_i^T R_i`` for many samples i at once, by counting instead of computing them."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, IntArray


def eigenvalues_below(eigenvalues: Array, projections: Array, shift: float) -> IntArray:
    """Count the eigenvalues of ``diag(eigenvalues) + Z_i^T Z_i`` below a shift.

    By Sylvester's law of inertia it is the count of ``eigenvalues`` below the shift less the count of negative
    eigenvalues of the 3x3 matrix ``I + Z_i (diag(eigenvalues) - shift)^-1 Z_i^T``.

    Parameters
    ----------
    eigenvalues : array, shape (columns,)
    projections : array, shape (samples, 3, columns)
        Z_i: rows of each sample in the eigenvectors' basis.
    shift : float

    Returns
    -------
    array of int, shape (samples,)
    """
    distance = eigenvalues - shift
    # A shift on an eigenvalue moves off it by no more than that eigenvalue's own rounding, so nothing overflows.
    rounding = np.finfo(float).eps * np.maximum(np.abs(eigenvalues), abs(shift)) + np.finfo(float).tiny
    distance = np.copysign(np.maximum(np.abs(distance), rounding), distance)
    schur = np.eye(3) + (projections / distance) @ projections.swapaxes(1, 2)
    negative = np.count_nonzero(np.linalg.eigvalsh(schur) < 0.0, axis=1)
    return np.asarray(np.count_nonzero(distance < 0.0) - negative, dtype=np.int64)
