"""Whether a model could be a body: positive definite inertia, principal moments that fit together."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.inertia import symmetric

VERTICAL = 0.1
"""|cos(pitch)| below which the nose points up or down, so that Euler angles tell little of the body's axes."""

# Shares of the largest eigenvalue. Near a vertical pitch a body's own smallest one is not larger than the second.
_ROUNDING, _HAIR = 1e-9, 0.01


def vertical(attitude: Array) -> BoolArray:
    """Flag attitudes near a pitch of +-90 degrees, where the inertia matrix of every body is all but singular.

    Parameters
    ----------
    attitude : array, shape (samples, 3), rad

    Returns
    -------
    array of bool, shape (samples,)
    """
    return np.asarray(np.abs(np.cos(attitude[:, 1])) < VERTICAL)


def not_positive_definite(matrices: Array, attitude: Array) -> BoolArray:
    """Flag inertia matrices that no body has; near a vertical pitch they may fall short of it by a hair.

    Parameters
    ----------
    matrices : array, shape (samples, 3, 3), kg m^2
    attitude : array, shape (samples, 3), rad

    Returns
    -------
    array of bool, shape (samples,)
    """
    eigenvalues = np.linalg.eigvalsh(matrices)
    tolerance = np.where(vertical(attitude), _HAIR, _ROUNDING)
    return np.asarray(eigenvalues[:, 0] < -tolerance * np.abs(eigenvalues).max(axis=1, initial=0.0))


def why_unphysical(inertia: Array) -> str | None:
    """Say why six inertia parameters cannot be those of a body.

    Parameters
    ----------
    inertia : array, shape (6,), kg m^2
        Ixx, Iyy, Izz, Ixy, Ixz, Iyz.

    Returns
    -------
    str or None
        None for a possible body.
    """
    smallest, middle, largest = np.linalg.eigvalsh(symmetric(inertia))
    moments = f"principal moments {smallest:.3g} {middle:.3g} {largest:.3g} kg m^2"
    if smallest < 0 or largest == 0:
        return f"is not positive definite ({moments})"
    # Measured moments of a flat body exceed the limit by noise alone.
    if largest > 1.1 * (smallest + middle):
        return f"breaks the triangle inequality ({moments})"
    return None
