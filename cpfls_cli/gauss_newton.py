"""The method of Gauss, Newton, Levenberg and Marquardt within bounds, for fits whose squares are summed elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np

from cpfls_cli.arrays import Array, BoolArray

_DAMPING_UP, _DAMPING_DOWN, _LEAST_DAMPING = 6.0, 5.0, 1e-9
"""Share of the diagonal: raised by more than it is lowered, so that it settles."""

_TRIES = 8
"""Of one step: the damping is a million times larger then, and a step that still fails is rounding."""


class Point(Protocol):
    """An objective at values of numbers, with its gradient and Gauss-Newton Hessian in scales of the numbers."""

    @property
    def values(self) -> Array:
        """Numbers."""
        ...

    @property
    def objective(self) -> float:
        """What is minimised."""
        ...

    @property
    def gradient(self) -> Array:
        """By number."""
        ...

    @property
    def hessian(self) -> Array:
        """By two numbers."""
        ...


AnyPoint = TypeVar("AnyPoint", bound=Point)


def minimised(
    evaluate: Callable[[Array], AnyPoint],
    point: AnyPoint,
    scales: Array,
    bounds: tuple[Array, Array],
    steps: int,
    tolerance: float,
    damping: float = 1e-3,
) -> AnyPoint:
    """Minimise by damped steps within bounds.

    Parameters
    ----------
    evaluate : callable
        Gives the point at values.
    point : Point
        To start from.
    scales : array, shape (number,)
        Natural sizes of changes.
    bounds : tuple of array, shape (number,)
    steps : int
        At most.
    tolerance : float
        Relative decrease of the objective, by a step or expected of an undamped one, below which it has come to its
        end.
    damping : float
        Share of the diagonal at first: as it is, nearly a Gauss-Newton step.
    """
    for _ in range(steps):
        if tolerance and _expected_decrease(point, scales, bounds) < tolerance * point.objective:
            break
        following, damping = _better(evaluate, point, damping, scales, bounds)
        if following is None:
            break
        decrease, point = point.objective - following.objective, following
        if decrease < tolerance * point.objective:
            break
    return point


def _expected_decrease(point: Point, scales: Array, bounds: tuple[Array, Array]) -> float:
    """Compute by how much the quadratic model falls with a step that is hardly damped."""
    hessian, gradient = point.hessian, point.gradient
    step = damped_step(hessian, gradient, _LEAST_DAMPING, *((bound - point.values) / scales for bound in bounds))
    return float(-step @ (gradient + 0.5 * hessian @ step))


def _better(
    evaluate: Callable[[Array], AnyPoint], point: AnyPoint, damping: float, scales: Array, bounds: tuple[Array, Array]
) -> tuple[AnyPoint | None, float]:
    """Find a point with a smaller objective, with more damping where a step fails; None where none is found."""
    for _ in range(_TRIES):
        room = [(bound - point.values) / scales for bound in bounds]
        step = scales * damped_step(point.hessian, point.gradient, damping, *room)
        following = evaluate(np.clip(point.values + step, *bounds))
        if following.objective < point.objective:
            return following, max(damping / _DAMPING_DOWN, _LEAST_DAMPING)
        damping *= _DAMPING_UP
    return None, damping


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
