"""Shapes between the points of their grids: the best value, all other coefficients following."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Shape
from cpfls_cli.gap.balance_system import System, system
from cpfls_cli.gap.weak_flight import Candidate, WeakFlight

_EVALUATIONS = 14


def refined(flights: Sequence[WeakFlight], chosen: Sequence[Candidate], floor: Array, rounds: int = 1) -> System:
    """Improve the shapes of the chosen effects one after another, by the error of the fit.

    Parameters
    ----------
    flights : sequence of WeakFlight
    chosen : sequence of Candidate
    floor : array, shape (6,)
    rounds : int

    Returns
    -------
    System
    """
    best = list(chosen)
    shapes = [(place, shape) for place, candidate in enumerate(best) for shape in candidate.effect.shapes]
    for _ in range(rounds if len(shapes) > 1 else min(rounds, 1)):
        for place, shape in shapes:
            best[place] = _improved(flights, best, place, shape, floor)
    return system(flights, best)


def fit(hypothesis: System, floor: Array) -> Array:
    """Fit all free columns.

    Parameters
    ----------
    hypothesis : System
    floor : array, shape (6,)

    Returns
    -------
    array, shape (column,)
    """
    matrix = (hypothesis.base / floor[:, None]).reshape(-1, hypothesis.base.shape[2])
    length = np.linalg.norm(matrix, axis=0)
    scale = 1.0 / np.where(length > 0, length, 1.0)
    right = (hypothesis.residual / floor).reshape(-1)
    return np.asarray(np.linalg.lstsq(matrix * scale, right, rcond=1e-9)[0] * scale)


def left(hypothesis: System, floor: Array) -> Array:
    """Compute what a hypothesis leaves after its fit, in floors.

    Parameters
    ----------
    hypothesis : System
    floor : array, shape (6,)

    Returns
    -------
    array, shape (window, 6)
    """
    return np.asarray((hypothesis.residual - hypothesis.base @ fit(hypothesis, floor)) / floor)


def _improved(
    flights: Sequence[WeakFlight], chosen: Sequence[Candidate], place: int, shape: Shape, floor: Array
) -> Candidate:
    candidate = chosen[place]

    def moved(value: float) -> Candidate:
        return Candidate(candidate.effect, {**candidate.shape, shape.name: float(value)})

    def error(value: float) -> float:
        hypothesis = system(flights, [*chosen[:place], moved(value), *chosen[place + 1 :]])
        return float((left(hypothesis, floor) ** 2).sum())

    bracket = _bracket(shape.grid, candidate.shape[shape.name])
    found = minimize_scalar(
        error, bounds=bracket, method="bounded", options={"maxiter": _EVALUATIONS, "xatol": 1e-3 * np.ptp(bracket)}
    )
    return moved(found.x)


def _bracket(grid: Sequence[float], value: float) -> tuple[float, float]:
    """Find the neighbours of a value on its grid."""
    place = int(np.argmin(np.abs(np.asarray(grid) - value)))
    return float(grid[max(0, place - 1)]), float(grid[min(len(grid) - 1, place + 1)])
