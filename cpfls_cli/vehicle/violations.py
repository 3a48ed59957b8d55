"""Demands that no rotor can meet: negative squared speeds, and speeds above the limit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array, BoolArray

ViolationKind = Literal["negative squared speed", "above the limit"]

# Fraction of the largest squared speed that is rounding error of the allocation.
_ROUNDING = 1e-12


@dataclass(frozen=True, kw_only=True)
class RotorViolation:
    """One rotor that is asked for what it cannot do.

    Attributes
    ----------
    rotor : int
        Index of the rotor, from 0.
    kind : str
        "negative squared speed" or "above the limit".
    first, last : int
        Indices of the first and the last sample.
    count : int
        Number of samples; those between first and last need not all be among them.
    worst : float, rad^2/s^2
        The most negative, or the largest, squared speed.
    """

    rotor: int
    kind: ViolationKind
    first: int
    last: int
    count: int
    worst: float


def feasible(squared_speed: Array, speed_max: float) -> BoolArray:
    """Tell which squared speeds a rotor can turn at.

    Parameters
    ----------
    squared_speed : array, shape (time, rotor), rad^2/s^2
    speed_max : float, rad/s

    Returns
    -------
    array of bool, shape (time, rotor)
    """
    return ~(_negative(squared_speed, speed_max) | _above(squared_speed, speed_max))


def violations(squared_speed: Array, speed_max: float) -> tuple[RotorViolation, ...]:
    """Sum up what cannot be met, by rotor and kind.

    Parameters
    ----------
    squared_speed : array, shape (time, rotor), rad^2/s^2
    speed_max : float, rad/s

    Returns
    -------
    tuple of RotorViolation
        At most two for each rotor, in the order of the rotors.
    """
    negative, above = _negative(squared_speed, speed_max), _above(squared_speed, speed_max)
    found: list[RotorViolation] = []
    for rotor, demand in enumerate(squared_speed.T):
        if negative[:, rotor].any():
            found.append(_summary(rotor, "negative squared speed", negative[:, rotor], float(demand.min())))
        if above[:, rotor].any():
            found.append(_summary(rotor, "above the limit", above[:, rotor], float(demand.max())))
    return tuple(found)


def _negative(squared_speed: Array, speed_max: float) -> BoolArray:
    return squared_speed < -_ROUNDING * speed_max**2


def _above(squared_speed: Array, speed_max: float) -> BoolArray:
    return squared_speed > (1 + _ROUNDING) * speed_max**2


def _summary(rotor: int, kind: ViolationKind, where: BoolArray, worst: float) -> RotorViolation:
    samples = np.flatnonzero(where)
    return RotorViolation(
        rotor=rotor, kind=kind, first=int(samples[0]), last=int(samples[-1]), count=len(samples), worst=worst
    )
