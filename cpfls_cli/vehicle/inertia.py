"""The inertia tensor and its six numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cpfls_cli.arrays import Array


def tensor(elements: Sequence[float]) -> Array:
    """Arrange the elements of the inertia tensor.

    Parameters
    ----------
    elements : sequence of 3 or 6 floats, kg m^2
        Ixx, Iyy, Izz and, where given, the tensor's own off-diagonal entries Ixy, Ixz, Iyz (not the products of
        inertia, which have the opposite sign).

    Returns
    -------
    array, shape (3, 3), kg m^2, body frame
    """
    inertia = np.diag(np.array(elements[:3], dtype=float))
    if len(elements) > 3:
        inertia[[0, 0, 1], [1, 2, 2]] = elements[3:]
        inertia[[1, 2, 2], [0, 0, 1]] = elements[3:]
    return inertia


def columns(vectors: Array) -> Array:
    """Write ``I v`` as a matrix times the elements of the tensor.

    Parameters
    ----------
    vectors : array, shape (time, 3)
        v.

    Returns
    -------
    array, shape (time, 3, 6)
        Multiplies (Ixx, Iyy, Izz, Ixy, Ixz, Iyz).
    """
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    rows = [[x, zero, zero, y, z, zero], [zero, y, zero, x, zero, z], [zero, zero, z, zero, x, y]]
    return np.moveaxis(np.array(rows), 2, 0)
