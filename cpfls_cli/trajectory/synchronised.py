"""Moves of several axes that begin and end together."""

from __future__ import annotations

from dataclasses import fields
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.trajectory.limits import Limits
from cpfls_cli.trajectory.moves import Move, Moves, Outcome, moves_of
from cpfls_cli.trajectory.time_optimal import plan_moves

Synchronisation = Literal["straight-line", "each-axis"]


def synchronised(
    displacements: Array, limits: Limits, period: float | None = None, method: Synchronisation = "straight-line"
) -> tuple[Move, ...]:
    """Plan one move for each axis, all of the same duration.

    Parameters
    ----------
    displacements : array, shape (axes,), m
        Of any sign; an axis may stay where it is.
    limits : Limits
        One of each for all axes, or one for each axis.
    period : float, s, optional
        P, of the straight line, or of the slowest axis.
    method : {"straight-line", "each-axis"}
        One profile for all axes, which is the shortest that keeps the limits of each; or the shortest of every axis,
        stretched in time to the slowest. Both take as long as the slowest axis alone, or longer; on a straight line
        the slowest derivative of any axis may set the pace.

    Raises
    ------
    SettingError
        If a displacement is not finite, or a limit or the period is not greater than zero; it names the key.
    """
    covered = np.asarray(displacements, dtype=np.float64)
    together = _straight_line if method == "straight-line" else _each_axis
    moves = together(covered, limits, period)
    return tuple(moves[axis] for axis in range(len(covered)))


def _straight_line(displacements: Array, limits: Limits, period: float | None) -> Moves:
    """Plan the fraction of the way, under the strictest limit of all axes."""
    bounds = limits.broadcast(len(displacements))
    largest = max(np.abs(displacements).max(initial=0.0), np.finfo(float).tiny)
    shares = np.abs(displacements) / largest
    with np.errstate(divide="ignore", over="ignore"):
        strictest = (bounds / shares).min(axis=1, initial=np.inf)
    names = (field.name for field in fields(Limits))
    line = plan_moves(np.array([largest]), Limits(**dict(zip(names, strictest.tolist(), strict=True))), period)
    outcome = np.where(displacements == 0, Outcome.ZERO_DISPLACEMENT, line.outcome)
    return moves_of(displacements, line.spans, bounds, outcome)


def _each_axis(displacements: Array, limits: Limits, period: float | None) -> Moves:
    moves = plan_moves(displacements, limits, period)
    taken = np.where(moves.outcome == Outcome.SOLVED, moves.duration, 0.0)
    stretched = moves.spans * np.divide(taken.max(initial=0.0), taken, out=np.ones_like(taken), where=taken > 0)
    return moves_of(displacements, stretched, limits.broadcast(len(displacements)), moves.outcome)
