"""Motion of the attitude, how each inertia function enters the torque along it, and the columns of a rigid body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, IntArray, require_columns
from cpfls_cli.regressor.structure import InertiaFunction

RIGID = 6
"""Inertia parameters of a rigid body."""


@dataclass(frozen=True)
class Motion:
    """Attitude motion at samples.

    Attributes
    ----------
    attitude : array, shape (samples, 3), rad
        Roll, pitch, yaw.
    rate : array, shape (samples, 3), rad/s
        Euler rates.
    acceleration : array, shape (samples, 3), rad/s^2
        Euler accelerations.
    """

    attitude: Array
    rate: Array
    acceleration: Array

    def __post_init__(self) -> None:
        """Check the shapes."""
        for name in ("attitude", "rate", "acceleration"):
            require_columns(name, getattr(self, name), 3)

    def __len__(self) -> int:
        """Count the samples."""
        return len(self.attitude)

    def __getitem__(self, samples: slice | IntArray) -> Motion:
        """Take some of the samples."""
        return Motion(self.attitude[samples], self.rate[samples], self.acceleration[samples])


@dataclass(frozen=True)
class Carrier:
    """Factors with which one inertia function enters the torque.

    With E the symmetric matrix that has ones in the function's places, a function f(q) there gives the torque ``E qdd f
    + E qd (df/dt) - 1/2 (qd^T E qd) grad f``: the Christoffel form of equations (3) and (4). `acceleration` is E qdd,
    `rate` E qd, `energy` qd^T E qd / 2.
    """

    acceleration: Array
    rate: Array
    energy: Array


def carrier(function: InertiaFunction, motion: Motion) -> Carrier:
    """Evaluate the factors of an inertia function along a motion.

    method.md section 2: ``tau = J qdd + (dJ/dt) qd - 1/2 grad_q (qd^T J qd)``.
    """
    places = np.zeros((3, 3))
    places[function.row, function.column] = places[function.column, function.row] = 1.0
    rate = motion.rate @ places
    return Carrier(motion.acceleration @ places, rate, 0.5 * np.sum(motion.rate * rate, axis=1))
