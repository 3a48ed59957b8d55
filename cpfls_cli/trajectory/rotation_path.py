"""Attitude paths of full rotations: turns through complete circles with harmonics superposed, closed on the circle."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array, IntArray


@dataclass(frozen=True)
class RotationMotion:
    """Attitude along a path of rotations, with its derivatives.

    Attributes
    ----------
    attitude : array, shape (time, 3), rad
        Roll, pitch, yaw; not wrapped.
    attitude_rate : array, shape (time, 3), rad/s
    attitude_acceleration : array, shape (time, 3), rad/s^2
    """

    attitude: Array
    attitude_rate: Array
    attitude_acceleration: Array


@dataclass(frozen=True)
class RotationPath:
    """Attitude that turns by whole circles over its duration while harmonics of that duration are superposed.

    ``q_i(t) = start_i + turns_i w t + sum_k sine_ik sin(k w t) + cosine_ik cos(k w t)`` with ``w = 2 pi / T``.

    Attributes
    ----------
    start : array, shape (3,), rad
        Roll, pitch, yaw about which the harmonics swing.
    turns : array of int, shape (3,)
        Complete turns over the duration; they and the whole frequencies close the path on the circle.
    sine, cosine : array, shape (3, harmonics), rad
        Amplitudes of the harmonics k = 1, 2, ...
    duration : float, s
        T.

    References
    ----------
    Swevers et al. (1997), Optimal robot excitation and identification, IEEE Transactions on Robotics and
    Automation 13(5), for paths of harmonics; the turns are added here.
    """

    start: Array
    turns: IntArray
    sine: Array
    cosine: Array
    duration: float

    @property
    def harmonics(self) -> int:
        """Number of harmonics of each angle."""
        return len(self.sine.T)

    def sample(self, time: Array) -> RotationMotion:
        """Evaluate the path and its derivatives in closed form.

        Parameters
        ----------
        time : array, shape (time,), s
            Any order and any value; the path goes on for ever.
        """
        base = 2 * np.pi / self.duration
        frequency = base * np.arange(1, self.harmonics + 1)
        sine, cosine = np.sin(time[:, None] * frequency), np.cos(time[:, None] * frequency)
        turning = base * self.turns
        rate = cosine @ (frequency * self.sine).T - sine @ (frequency * self.cosine).T
        acceleration = -sine @ (frequency**2 * self.sine).T - cosine @ (frequency**2 * self.cosine).T
        return RotationMotion(
            attitude=self.start + time[:, None] * turning + sine @ self.sine.T + cosine @ self.cosine.T,
            attitude_rate=turning + rate,
            attitude_acceleration=acceleration,
        )

    def times(self, count: int) -> Array:
        """Divide the duration into equal steps.

        Returns
        -------
        array, shape (count,), s
            From 0; the end, where the path begins again, is left out.
        """
        times: Array = np.arange(count, dtype=np.float64) * (self.duration / count)
        return times

    def scaled(self, factor: float) -> RotationPath:
        """Multiply the amplitudes of the harmonics.

        Returns
        -------
        RotationPath
            With the same turns.
        """
        return replace(self, sine=factor * self.sine, cosine=factor * self.cosine)
