"""Design variables of a path of rotations, and the motion that is linear in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.trajectory.rotation import RotationPath


@dataclass(frozen=True)
class Design:
    """Motion at some times as a linear function of the design variables.

    Attributes
    ----------
    matrices : array, shape (3, time, variables per angle)
        By attitude, rate and acceleration.
    turning : array, shape (3, time, 3)
        Part of the motion that the turns give.
    """

    matrices: Array
    turning: Array

    def motion(self, variables: Array) -> Array:
        """Evaluate the motion.

        Parameters
        ----------
        variables : array, shape (3, variables per angle)

        Returns
        -------
        array, shape (3, time, 3), rad and s
            Attitude, Euler rates and Euler accelerations.
        """
        motion: Array = self.matrices @ variables.T + self.turning
        return motion

    def gradient(self, by_motion: Array) -> Array:
        """Carry a gradient by the motion back to the design variables.

        Parameters
        ----------
        by_motion : array, shape (3, time, 3)

        Returns
        -------
        array, shape (3, variables per angle)
        """
        gradient: Array = np.einsum("ktv,kta->av", self.matrices, by_motion, optimize=True)
        return gradient


def variables_of(path: RotationPath) -> Array:
    """Write a path as design variables.

    Returns
    -------
    array, shape (3, 1 + 2 harmonics)
        Start in rad, then the amplitudes of the rates of sine and cosine terms in rad/s: variables of equal weight.
    """
    return np.hstack([path.start[:, None], path.sine * path.frequency, path.cosine * path.frequency])


def path_of(variables: Array, like: RotationPath) -> RotationPath:
    """Read a path from design variables.

    Parameters
    ----------
    variables : array, shape (3, 1 + 2 harmonics)
    like : RotationPath
        Gives turns and duration.
    """
    sine, cosine = np.split(variables[:, 1:], 2, axis=1)
    return RotationPath(variables[:, 0], like.turns, sine / like.frequency, cosine / like.frequency, like.duration)


def design(like: RotationPath, time: Array) -> Design:
    """Build the linear map from design variables to the motion at some times.

    Parameters
    ----------
    like : RotationPath
        Gives turns, number of harmonics and duration.
    time : array, shape (time,), s
    """
    frequency = like.frequency
    sine, cosine = np.sin(time[:, None] * frequency), np.cos(time[:, None] * frequency)
    one, zero = np.ones((len(time), 1)), np.zeros((len(time), 1))
    matrices = np.stack(
        [
            np.hstack([one, sine / frequency, cosine / frequency]),
            np.hstack([zero, cosine, -sine]),
            np.hstack([zero, -sine * frequency, -cosine * frequency]),
        ]
    )
    rate = 2 * np.pi / like.duration * like.turns
    turning = np.stack([time[:, None] * rate, np.broadcast_to(rate, (len(time), 3)), np.zeros((len(time), 3))])
    return Design(matrices, turning)
