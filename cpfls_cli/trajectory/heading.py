"""The yaw along a path in space: one turn over all of it, or from point to point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.trajectory.legs import Leg, in_turn
from cpfls_cli.trajectory.profile import BaseProfile, covering


def uniform_heading(time: Array, turn: float, duration: float) -> Array:
    """Turn at a constant rate.

    Parameters
    ----------
    time : array, shape (time,), s
    turn : float, rad
    duration : float, s

    Returns
    -------
    array, shape (3, time), rad and s
        Yaw, its rate and its acceleration.
    """
    rate = turn / duration
    return np.stack([rate * time, np.full_like(time, rate), np.zeros_like(time)])


def stretched_heading(time: Array, turn: float, profile: BaseProfile, duration: float) -> Array:
    """Turn from rest to rest as a move does, stretched in time.

    Parameters
    ----------
    time : array, shape (time,), s
    turn : float, rad
    profile : BaseProfile
        Whose shape the turn has.
    duration : float, s

    Returns
    -------
    array, shape (3, time), rad and s
        Yaw, its rate and its acceleration.
    """
    unit = covering(1.0, profile.period, profile.holds).stretched(duration)
    return np.asarray(turn * unit.sample(time).T[:3])


def heading_of_legs(time: Array, legs: Sequence[Leg]) -> Array:
    """Turn from point to point, while the vehicle moves.

    Parameters
    ----------
    time : array, shape (time,), s
    legs : sequence of Leg
        With a yaw each.

    Returns
    -------
    array, shape (3, time), rad and s
        Yaw, its rate and its acceleration.
    """
    heading = np.zeros((3, len(time)))
    heading[0] = _yaw(legs[0])[0]
    for leg, samples in in_turn(legs, time):
        begin, end = _yaw(leg)
        turned = stretched_heading(time[samples] - leg.begin, end - begin, leg.profiles[0], leg.duration)
        heading[:, samples] = turned
        heading[0, samples] += begin
    return heading


def _yaw(leg: Leg) -> tuple[float, float]:
    assert leg.yaw is not None
    return leg.yaw
