"""Attitude paths of full rotations: harmonics superposed on complete turns, their limits, and random ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import SettingError
from cpfls_cli.inertia import body_torque_columns, six_parameters
from cpfls_cli.trajectory.settings import RotationSettings

# Share of the rate limit that the turns of one angle may take; the harmonics have the rest.
_TURNING = 0.15
# More would need more memory than a flight is worth.
_MOST_HARMONICS, _MOST_TURNS = 300, 10_000
# Samples in one period of the fastest part of the motion.
_PER_PERIOD = 48
# Of the factor that uses up a limit.
_PRECISION = 1e-5
_LIMITS = ("rate_max_rad_s", "acceleration_max_rad_s2", "torque_max_n_m")


@dataclass(frozen=True)
class RotationMotion:
    """Attitude along a path, with its derivatives.

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

    @property
    def frequency(self) -> Array:
        """Angular frequencies of the harmonics, shape (harmonics,), rad/s."""
        return np.asarray(2 * np.pi / self.duration * np.arange(1, self.harmonics + 1))

    def sample(self, time: Array) -> RotationMotion:
        """Evaluate the path and its derivatives in closed form.

        Parameters
        ----------
        time : array, shape (time,), s
            Any order and any value; the path goes on for ever.
        """
        frequency = self.frequency
        sine, cosine = np.sin(time[:, None] * frequency), np.cos(time[:, None] * frequency)
        turning = 2 * np.pi / self.duration * self.turns
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
        """Multiply the amplitudes of the harmonics; the turns stay."""
        return replace(self, sine=factor * self.sine, cosine=factor * self.cosine)


def full_rotation(
    settings: RotationSettings, duration: float, rng: np.random.Generator, inertia: Sequence[float] | None = None
) -> RotationPath:
    """Draw a random path that uses up one of its limits.

    Parameters
    ----------
    duration : float, s
        Of the whole path, which is closed on the circle.
    inertia : sequence of float, length 3 or 6, kg m^2, optional
        Ixx, Iyy, Izz (, Ixy, Ixz, Iyz); only needed where the settings limit the torque.

    Returns
    -------
    RotationPath
        Harmonics of normally distributed amplitudes, inversely proportional to the frequency.

    Raises
    ------
    SettingError
        If the limits do not leave room for the turns, or no harmonic fits into the duration.
    """
    limits = RotationLimits(settings, inertia)
    harmonic = np.arange(1, _harmonics(settings, duration) + 1)
    turns = _turns(settings, duration, rng)
    start, sine, cosine = rng.uniform(0, 2 * np.pi, 3), *rng.standard_normal((2, 3, len(harmonic)))
    path = RotationPath(start, turns, sine / harmonic, cosine / harmonic, duration)
    return limits.fitted(path if settings.turns is not None else _with_room(path, limits))


def _harmonics(settings: RotationSettings, duration: float) -> int:
    # A product of 3 by rounding below 3 is 3.
    count = int(settings.frequency_max_hz * duration + 1e-9)
    if count < 1:
        message = f"no harmonic fits into {duration:g} s; raise it to {1 / duration:.3g} or more, or the duration"
        raise SettingError("frequency_max_hz", message)
    if count > _MOST_HARMONICS:
        message = f"gives {count} harmonics in {duration:g} s, more than {_MOST_HARMONICS}; lower it"
        raise SettingError("frequency_max_hz", message)
    return count


def _turns(settings: RotationSettings, duration: float, rng: np.random.Generator) -> IntArray:
    possible = settings.rate_max_rad_s * duration / (2 * np.pi)
    if possible > _MOST_TURNS:
        message = f"allows {possible:.3g} turns in {duration:g} s, more than {_MOST_TURNS}; lower it or the duration"
        raise SettingError("rate_max_rad_s", message)
    if settings.turns is not None:
        return np.array(settings.turns, dtype=np.int64)
    most = max(int(_TURNING * possible), 1)
    turns: IntArray = rng.integers(1, most, size=3, endpoint=True) * rng.choice(np.array([-1, 1]), size=3)
    return turns


def _with_room(path: RotationPath, limits: RotationLimits) -> RotationPath:
    """Halve the turns until they leave half of every limit to the harmonics, or no angle turns more than once."""
    while np.abs(path.turns).max() > 1 and limits.peaks(path.scaled(0.0)).max() > 0.5:
        halved = np.maximum(np.abs(path.turns) // 2, 1)
        path = replace(path, turns=np.sign(path.turns) * halved)
    return path


class RotationLimits:
    """Limits on rates, accelerations and torques of a path.

    Parameters
    ----------
    inertia : sequence of float, length 3 or 6, kg m^2, optional
        Ixx, Iyy, Izz (, Ixy, Ixz, Iyz); only needed where the torque is limited.

    Raises
    ------
    SettingError
        If the torque is limited and the inertia not known.
    """

    def __init__(self, settings: RotationSettings, inertia: Sequence[float] | None = None) -> None:
        if settings.torque_max_n_m is not None and inertia is None:
            raise SettingError("torque_max_n_m", "a torque limit needs the inertia of the vehicle; use null")
        self._rate, self._acceleration = settings.rate_max_rad_s, settings.acceleration_max_rad_s2
        self._torque = settings.torque_max_n_m
        self._inertia = six_parameters(inertia or ())

    def loads(self, motion: RotationMotion) -> Array:
        """Compute rates, accelerations and torques of a motion as shares of their limits.

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
        rate = path.sample(path.times(8 * path.harmonics)).attitude_rate
        turns_at_the_fastest = int(np.ceil(np.abs(rate).max() * path.duration / (2 * np.pi)))
        count = _PER_PERIOD * (path.harmonics + turns_at_the_fastest)
        loads = self.loads(path.sample(path.times(count)))
        ahead, behind = np.roll(loads, -1, axis=0), np.roll(loads, 1, axis=0)
        bounds = (np.abs(loads) + 0.25 * np.abs(ahead - 2 * loads + behind)).max(axis=0)
        return np.array([bounds[:6].max(), bounds[6:12].max(), bounds[12:].max(initial=0.0)])

    def fitted(self, path: RotationPath) -> RotationPath:
        """Scale the harmonics of a path to the largest amplitudes that the limits allow, which uses up one of them.

        SettingError if the turns alone exceed a limit.
        """
        from scipy.optimize import brentq

        peaks = self.peaks(path.scaled(0.0))
        worst = int(peaks.argmax())
        if peaks[worst] > 1:
            turns = ", ".join(str(count) for count in path.turns)
            raise SettingError(
                _LIMITS[worst],
                f"{turns} complete turns of roll, pitch and yaw in {path.duration:g} s need {peaks[worst]:.3g} times "
                "this limit; raise it or the duration, or lower turns",
            )

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
        """Scale the harmonics of a path down where it exceeds a limit; raises what `fitted` raises."""
        return path if self.peaks(path).max() <= 1 else self.fitted(path)
