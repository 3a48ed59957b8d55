"""The shape of one rest-to-rest move in space: which profiles it follows, along which directions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import SettingError
from cpfls_cli.trajectory.limit_settings import LimitSettings
from cpfls_cli.trajectory.moves import Move
from cpfls_cli.trajectory.profile import BaseProfile, Holds, covering
from cpfls_cli.trajectory.synchronised import Synchronisation, synchronised
from cpfls_cli.trajectory.time_optimal import plan_move

Measure = Literal["along-path", "per-axis"]


@dataclass(frozen=True, kw_only=True)
class Timing:
    """How long a move takes: as its period and holds say, or as short as its limits allow.

    Attributes
    ----------
    limits : LimitSettings
    coordination : {"straight-line", "each-axis"}
    period : float or None, s
        None where the limits choose it.
    holds : Holds
        Where there are no limits.
    measure : {"along-path", "per-axis"}
        How long a displacement is, and what a limit that is one number for all axes holds for.
    """

    limits: LimitSettings
    coordination: Synchronisation
    period: float | None
    holds: Holds
    measure: Measure


@dataclass(frozen=True, kw_only=True)
class Shape:
    """Profiles of one move in space.

    Attributes
    ----------
    profiles : tuple of BaseProfile
    directions : array, shape (profiles, 3)
        World vector that one metre of each profile moves along.
    limited_by : tuple of str
        Derivatives that reach their limit on any axis, or ``period`` where none does; empty where the move was not
        planned under limits.
    """

    profiles: tuple[BaseProfile, ...]
    directions: Array
    limited_by: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """Time from rest to rest, s."""
        return max(profile.duration for profile in self.profiles)


def unit_of(vector: Array, measure: Measure) -> tuple[float, Array]:
    """Split a vector into its length, in a measure, and the vector of length 1.

    Parameters
    ----------
    vector : array, shape (3,)
        Not zero.
    measure : {"along-path", "per-axis"}

    Returns
    -------
    length : float
    direction : array, shape (3,)
    """
    # Divided by the largest component first, so that no square overflows.
    largest = float(np.abs(vector).max())
    unit = vector / largest
    length = 1.0 if measure == "per-axis" else float(np.sqrt(unit @ unit))
    return largest * length, unit / length


def shape_of(vector: Array, timing: Timing) -> Shape:
    """Find the shape of the move over a displacement.

    Parameters
    ----------
    vector : array, shape (3,), m, world frame
        Not zero.
    timing : Timing

    Raises
    ------
    SettingError
        If there is no smooth move under the limits; it names the key of the section `trajectory`.
    """
    length, direction = unit_of(vector, timing.measure)
    if not timing.limits.given:
        period = 1.0 if timing.period is None else timing.period
        return Shape(profiles=(covering(length, period, timing.holds),), directions=direction[None])
    if timing.coordination == "straight-line":
        move = plan_move(length, timing.limits.along(direction), timing.period)
        return _smooth((move,), direction[None])
    axes = np.flatnonzero(vector)
    moves = synchronised(vector[axes], timing.limits.of_axes(axes), timing.period, "each-axis")
    return _smooth(moves, np.eye(3)[axes])


def _smooth(moves: tuple[Move, ...], directions: Array) -> Shape:
    """Refuse what has no attitude: its acceleration follows from the snap."""
    for move in moves:
        if not move.outcome.solved:
            raise SettingError("limits", move.outcome.words)
        if not np.isfinite(move.peaks.snap):
            message = "leave the snap without limit, and with it the acceleration of the attitude; give a limit on"
            raise SettingError("limits", f"{message} snap_m_s4, crackle_m_s5 or pop_m_s6, or a period_s")
    # Where no limit is reached, the period that was given decides.
    reached = dict.fromkeys(name for move in moves for name in move.active) or {"period": None}
    profiles = tuple(move.profile for move in moves)
    return Shape(profiles=profiles, directions=directions, limited_by=tuple(reached))
