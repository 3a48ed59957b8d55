"""The kinematics of attitude and gyroscope in weak form, by quaternions, so that it holds at any tilt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from cpfls_cli.arrays import Array
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.windows import Windows

LONGEST_DELAY_S = 0.1
"""Longest shift between gyroscope and attitude that is looked for, s; a log beyond that is broken, not late."""


@dataclass(frozen=True)
class Kinematics:
    """Windows of one flight, ``d/dt r = 1/2 (r0 omega + r x omega)`` with r relative to the middle of the window.

    The equation keeps its form under any fixed rotation of r, so noise of the middle sample does not enter.

    Attributes
    ----------
    rate : array, shape (window, 3), rad/s
        Averages of the rate that the attitude shows, body axes at the middle of the window; nothing is differentiated.
    turning : array, shape (window, sample, 3, 3)
        ``phi dt (r0 1 + [r]x)``, which turns a rate along the window into those axes.
    time : array, shape (window, sample), s
    gyro : CubicSpline
        Body rate over time; through smooth windows its interpolation error is nothing.
    """

    rate: Array
    turning: Array
    time: Array
    gyro: CubicSpline

    @property
    def centres(self) -> Array:
        """Middle of each window, shape (window,), s."""
        return np.asarray(self.time.mean(axis=1))

    def gyro_rate(self, delay: float) -> Array:
        """Average the rate of a gyroscope that is late.

        Parameters
        ----------
        delay : float
            s.

        Returns
        -------
        array, shape (window, 3), rad/s
        """
        return np.asarray(np.einsum("wsai,wsi->wa", self.turning, self.gyro(self.time + delay)))

    def products(self, delay: float, order: int = 0) -> Array:
        """Average each reading, put on each axis; the columns of a matrix on the gyroscope.

        Parameters
        ----------
        delay : float
            s.
        order : int
            1 for the derivative of the reading.

        Returns
        -------
        array, shape (window, 3, to, from), rad/s or rad/s^2
        """
        turning = np.moveaxis(self.turning, 1, 3)
        found = turning.reshape(len(turning), 9, -1) @ self.gyro(self.time + delay, order)
        return np.asarray(found.reshape(-1, 3, 3, 3))

    def constants(self) -> Array:
        """Average a constant about each axis.

        Returns
        -------
        array, shape (window, 3, 3)
        """
        return np.asarray(self.turning.sum(axis=1))


def kinematics(signals: Signals, windows: Windows) -> Kinematics | None:
    """Cut a flight into windows, clear of its ends by the longest delay.

    Parameters
    ----------
    signals : Signals
        With attitude.
    windows : Windows

    Returns
    -------
    Kinematics or None
        None where the flight is shorter than a window.
    """
    margin = int(np.ceil(LONGEST_DELAY_S / windows.period))
    inside = slice(margin, len(signals) - margin)
    length = len(windows.weight)
    if len(signals) - 2 * margin < length or signals.attitude is None:
        return None
    # At an overlap of three quarters the windows add up to a constant, so attitude noise cancels between neighbours.
    hop = max(1, length // 4)
    turned = _continuous(Rotation.from_euler("ZYX", signals.attitude[inside, ::-1]).as_quat())
    relative = _relative(np.moveaxis(sliding_window_view(turned, length, axis=0)[::hop], 1, 2))
    time = sliding_window_view(signals.time[inside], length)[::hop]
    rate = -2 * np.einsum("wsi,s->wi", relative[..., :3], windows.slope)
    turning = _turning(relative) * windows.weight[:, None, None]
    return Kinematics(rate, turning, np.asarray(time), CubicSpline(signals.time, signals.body_rate))


def _continuous(turned: Array) -> Array:
    """Choose of each quaternion and its negative the one near the sample before."""
    flips = np.where((turned[1:] * turned[:-1]).sum(axis=1) < 0, -1.0, 1.0)
    return np.asarray(turned * np.concatenate([[1.0], np.cumprod(flips)])[:, None])


def _relative(turned: Array) -> Array:
    """Take quaternions (x, y, z, scalar) relative to the middle of their window."""
    vector, scalar = turned[..., :3], turned[..., 3:]
    middle = turned[:, [turned.shape[1] // 2]]
    own, known = -middle[..., :3], middle[..., 3:]
    product = known * vector + scalar * own + np.cross(own, vector)
    rest = known * scalar - (own * vector).sum(axis=-1, keepdims=True)
    return np.concatenate([product, rest], axis=-1)


def _turning(relative: Array) -> Array:
    x, y, z, scalar = np.moveaxis(relative, -1, 0)
    return np.stack([scalar, -z, y, z, scalar, -x, -y, x, scalar], axis=-1).reshape(*relative.shape[:-1], 3, 3)
