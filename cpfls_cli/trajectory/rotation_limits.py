"""Limits on an attitude path: how much of each it uses, at all times and not only at samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.errors import SettingError
from cpfls_cli.inertia import body_torque_columns, six_parameters
from cpfls_cli.trajectory.rotation_path import RotationMotion, RotationPath
from cpfls_cli.trajectory.rotation_settings import RotationSettings

# Samples in one period of the fastest part of the motion.
_PER_PERIOD = 48
# Of the factor that uses up a limit.
_PRECISION = 1e-5
_LIMITS = ("rate_max_rad_s", "acceleration_max_rad_s2", "torque_max_n_m")


class RotationLimits:
    """Limits on rates, accelerations and torques of a path.

    Parameters
    ----------
    settings : RotationSettings
    inertia : sequence of float, length 3 or 6, kg m^2, optional
        Ixx, Iyy, Izz (, Ixy, Ixz, Iyz); only needed where the torque is limited.

    Raises
    ------
    SettingError
        If the torque is limited and the inertia not known.
    """

    def __init__(self, settings: RotationSettings, inertia: Sequence[float] | None = None) -> None:
        if settings.torque_max_n_m is not None and inertia is None:
            raise SettingError("torque_max_n_m", "a limit on the torque needs the inertia of the vehicle; use null")
        self._rate, self._acceleration = settings.rate_max_rad_s, settings.acceleration_max_rad_s2
        self._torque = settings.torque_max_n_m
        self._inertia = six_parameters(inertia or ())

    def loads(self, motion: RotationMotion) -> Array:
        """Divide what a motion asks for by the limits.

        Returns
        -------
        array, shape (time, 12 or 15)
            Signed shares of the limits: Euler rates, body rates, Euler accelerations, body accelerations, and body
            torques where they are limited.
        """
        motions = motion.attitude, motion.attitude_rate, motion.attitude_acceleration
        rate, acceleration = rotations.body_rate(*motions[:2]), rotations.body_acceleration(*motions)
        shares = [
            motions[1] / self._rate,
            rate / self._rate,
            motions[2] / self._acceleration,
            acceleration / self._acceleration,
        ]
        if self._torque is not None:
            shares.append(body_torque_columns(rate, acceleration) @ self._inertia / np.array(self._torque))
        return np.hstack(shares)

    def peaks(self, path: RotationPath) -> Array:
        """Bound the largest share of each limit over all times.

        Between two samples a curve exceeds both by at most an eighth of its second difference, as long as that
        hardly changes from one sample to the next; a quarter is added.

        Returns
        -------
        array, shape (3,)
            Share of the limit on rates, accelerations and torques; the last is zero where there is no limit.
        """
        count = _PER_PERIOD * (path.harmonics + _turns_at_the_fastest(path))
        loads = self.loads(path.sample(path.times(count)))
        ahead, behind = np.roll(loads, -1, axis=0), np.roll(loads, 1, axis=0)
        bounds = (np.abs(loads) + 0.25 * np.abs(ahead - 2 * loads + behind)).max(axis=0)
        return np.array([bounds[:6].max(), bounds[6:12].max(), bounds[12:].max(initial=0.0)])

    def fitted(self, path: RotationPath) -> RotationPath:
        """Scale the harmonics of a path to the largest amplitudes that the limits allow.

        Returns
        -------
        RotationPath
            Uses up one of the limits.

        Raises
        ------
        SettingError
            If the turns alone exceed a limit.
        """
        self._require_turns(path)

        def excess(factor: float) -> float:
            return float(self.peaks(path.scaled(factor)).max()) - 1.0

        high = 1.0
        while excess(high) < 0:
            high *= 2
        factor, back = brentq(excess, 0.0, high, rtol=_PRECISION), _PRECISION
        while excess(factor) > 0:
            factor, back = factor * (1 - min(back, 1.0)), 2 * back
        return path.scaled(factor)

    def enforced(self, path: RotationPath) -> RotationPath:
        """Scale the harmonics of a path down where it exceeds a limit.

        Returns
        -------
        RotationPath
            The same path where it exceeds none.

        Raises
        ------
        SettingError
            If the turns alone exceed a limit.
        """
        return path if self.peaks(path).max() <= 1 else self.fitted(path)

    def _require_turns(self, path: RotationPath) -> None:
        peaks = self.peaks(path.scaled(0.0))
        worst = int(peaks.argmax())
        if peaks[worst] > 1:
            turns = ", ".join(str(count) for count in path.turns)
            raise SettingError(
                _LIMITS[worst],
                f"{turns} complete turns of roll, pitch and yaw in {path.duration:g} s need {peaks[worst]:.3g} times "
                "as much; raise it or the duration, or lower turns",
            )


def _turns_at_the_fastest(path: RotationPath) -> int:
    """Complete turns that the fastest rate of any angle would make over the duration."""
    rate = path.sample(path.times(8 * path.harmonics)).attitude_rate
    return int(np.ceil(np.abs(rate).max() * path.duration / (2 * np.pi)))
