"""Whether a model could be a body: positive definite inertia, principal moments that fit together."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.inertia import symmetric

# Rounding of eigenvalues where a pitch of +-90 degrees makes the inertia matrix singular.
_ROUNDING = 1e-9


def not_positive_definite(matrices: Array) -> BoolArray:
    """Flag inertia matrices that no body has.

    Parameters
    ----------
    matrices : array, shape (samples, 3, 3), kg m^2

    Returns
    -------
    array of bool, shape (samples,)
    """
    eigenvalues = np.linalg.eigvalsh(matrices)
    return np.asarray(eigenvalues[:, 0] < -_ROUNDING * np.abs(eigenvalues).max(axis=1, initial=0.0))


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
