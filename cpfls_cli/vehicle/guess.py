"""Guesses of what nobody states of a multirotor, from its mass and where its rotors are: starts of a fit, no more."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cpfls_cli.arrays import Array

_GYRATION = (0.5, 0.5, 0.7)
"""Radii of gyration in arms: of published quadrotors from 30 g to 6 kg, those about roll are 0.45 to 1."""

_DRAG_LEVER = 0.1
"""Drag factor over thrust factor in arms; it is a tenth to a fifth of a propeller's radius."""

_HOVER = 0.55
"""Rotor speed in hover, share of the largest: a vehicle lifts about three times its weight."""


def guessed_inertia(mass: float, positions: Sequence[Sequence[float]]) -> tuple[float, float, float]:
    """Guess moments of inertia, kg m^2.

    Parameters
    ----------
    mass : float, kg
    positions : sequence of (float, float, float), m
        Of the hubs.
    """
    x, y, z = (mass * (share * _arm(positions)) ** 2 for share in _GYRATION)
    return x, y, z


def guessed_thrust_factor(mass: float, gravity: float, rotors: int, speed_max: float) -> float:
    """Guess the thrust factor of each rotor, N s^2, from the speed at which such vehicles hover.

    Parameters
    ----------
    mass : float, kg
    gravity : float, m/s^2
    rotors : int
    speed_max : float, rad/s
    """
    return mass * gravity / (rotors * (_HOVER * speed_max) ** 2)


def guessed_drag_factor(thrust_factor: float, positions: Sequence[Sequence[float]]) -> float:
    """Guess the drag factor, N m s^2.

    Parameters
    ----------
    thrust_factor : float, N s^2
    positions : sequence of (float, float, float), m
        Of the hubs.
    """
    return _DRAG_LEVER * _arm(positions) * thrust_factor


def _arm(positions: Sequence[Sequence[float]]) -> float:
    hubs: Array = np.array(positions, dtype=float)
    return float(np.hypot(hubs[:, 0], hubs[:, 1]).max())
