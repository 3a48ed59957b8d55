"""A damped Gauss-Newton step within bounds, for fits whose squares are summed elsewhere."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray


def damped_step(hessian: Array, gradient: Array, damping: float, low: Array, high: Array) -> Array:
    """Solve for a damped step: numbers that it would take beyond a bound go there, and the others move again.

    Fits whose residuals fit into memory have `scipy.optimize.least_squares`; here sums over them are all that is known.

    Parameters
    ----------
    hessian : array, shape (number, number)
        ``J^T J`` of residuals r with Jacobian J.
    gradient : array, shape (number,)
        ``J^T r``.
    damping : float
        Share of the diagonal that is added to it.
    low, high : array, shape (number,)
        Bounds of the step, not above and not below 0.

    Returns
    -------
    array, shape (number,)

    References
    ----------
    Marquardt, J. SIAM 11 (1963).
    """
    diagonal, step = np.diag(hessian), np.zeros(len(gradient))
    # A number that moves nothing stays.
    damped = hessian + np.diag(damping * diagonal + np.where(diagonal > 0, 0.0, 1.0))
    free: BoolArray = ~(((high <= 0) & (gradient < 0)) | ((low >= 0) & (gradient > 0)))
    while free.any():
        right = gradient[free] + damped[np.ix_(free, ~free)] @ step[~free]
        step[free] = -np.linalg.solve(damped[np.ix_(free, free)], right)
        beyond = free & ((step < low) | (step > high))
        if not beyond.any():
            break
        step[beyond] = np.clip(step, low, high)[beyond]
        free &= ~beyond
    return step
