"""Where vehicles are and how they move."""

from __future__ import annotations

from typing import NamedTuple

from cpfls_cli.arrays import Array


class State(NamedTuple):
    """Where vehicles are and how they move.

    Attributes
    ----------
    position, velocity : array, shape (samples, 3), m and m/s, world frame
    rotation : array, shape (samples, 3, 3)
        Body to world.
    rate : array, shape (samples, 3), rad/s, body frame
    """

    position: Array
    velocity: Array
    rotation: Array
    rate: Array
