"""Paths of superposed harmonics in space and yaw, at rest at both ends."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import null_space

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.trajectory.attitude import along
from cpfls_cli.trajectory.planning import Trajectory, sample_times

_DERIVATIVES = 7
_AT_REST = 4
"""Derivatives that vanish at both ends: with the snap the angular acceleration does."""

_SLOPES = (0.5, 3.5)
"""Powers of the frequency by which amplitudes fall: from shaking to drifting."""

_NAMES = ("displacement", "velocity", "acceleration", "jerk", "snap", "crackle", "pop")


@dataclass(frozen=True)
class HarmonicPath:
    """Position and yaw over a duration, ``centre + sum_k cosine_k cos(w_k t) + sine_k sin(w_k t)``.

    Attributes
    ----------
    centre : array, shape (4,), m and rad
    order : array of int, shape (4, harmonic)
        Periods in the duration.
    cosine, sine : array, shape (4, harmonic), m and rad
    duration : float, s
    """

    centre: Array
    order: IntArray
    cosine: Array
    sine: Array
    duration: float

    def sample(self, time: Array) -> Array:
        """Evaluate position and yaw with six derivatives.

        Parameters
        ----------
        time : array, shape (time,), s

        Returns
        -------
        array, shape (7, time, 4), m, rad and s
        """
        frequency = 2 * np.pi / self.duration * self.order
        phase = np.multiply.outer(time, frequency)
        cosine, sine = np.cos(phase), np.sin(phase)
        # Each derivative turns by a quarter of a period: cos -> -sin -> -cos -> sin.
        turns = ((cosine, sine), (-sine, cosine), (-cosine, -sine), (sine, -cosine))
        values = []
        for derivative in range(_DERIVATIVES):
            of_cosine, of_sine = turns[derivative % len(turns)]
            scale = frequency**derivative
            values.append((of_cosine * (self.cosine * scale) + of_sine * (self.sine * scale)).sum(axis=2))
        values[0] = values[0] + self.centre
        return np.stack(values)

    def scaled(self, factor: float | Array) -> HarmonicPath:
        """Scale the path about the origin.

        Parameters
        ----------
        factor : float or array, shape (4,)
        """
        by_axis = np.broadcast_to(factor, (4,))[:, None]
        return replace(self, centre=self.centre * factor, cosine=self.cosine * by_axis, sine=self.sine * by_axis)

    def moved(self, cosine: Array, sine: Array) -> HarmonicPath:
        """Change the amplitudes, less what would leave the ends not at rest.

        Parameters
        ----------
        cosine, sine : array, shape (4, harmonic), m and rad
        """
        return replace(self, cosine=self.cosine + cosine, sine=self.sine + sine).resting()

    def resting(self) -> HarmonicPath:
        """Take off what would leave velocity, acceleration, jerk, snap and the turning of yaw at the ends."""
        cosine, sine = np.empty_like(self.cosine), np.empty_like(self.sine)
        for axis, order in enumerate(self.order):
            scaled = order / order.max()
            for values, kept, first in ((self.cosine, cosine, 2), (self.sine, sine, 1)):
                space = null_space(np.stack([scaled**power for power in range(first, _AT_REST + 1, 2)]))
                kept[axis] = space @ (space.T @ values[axis])
        return replace(self, cosine=cosine, sine=sine)


def random_path(duration: float, frequency_max: float, harmonics: int, rng: np.random.Generator) -> HarmonicPath:
    """Draw a path of about unit size on each axis, about the origin.

    Parameters
    ----------
    duration : float, s
    frequency_max : float, Hz
    harmonics : int
        Of each axis, fewer where the duration has no room for them.
    """
    highest = max(int(frequency_max * duration + 1e-9), 1)
    count = min(harmonics, highest)
    chances = 1.0 / np.arange(1, highest + 1)
    chances /= chances.sum()
    order = np.array([np.sort(rng.choice(highest, count, replace=False, p=chances)) + 1 for _ in range(4)])
    weight = order ** -rng.uniform(*_SLOPES, 4)[:, None]
    cosine, sine = weight * rng.standard_normal((2, 4, count))
    return HarmonicPath(np.zeros(4), order, cosine, sine, duration).resting()


def harmonic_trajectory(path: HarmonicPath, sample_time: float, gravity: float) -> Trajectory:
    """Sample a path with the attitude that flies it.

    Parameters
    ----------
    sample_time : float, s
    gravity : float, m/s^2

    Raises
    ------
    ComputationError
        If the path asks for free fall, where the attitude is not defined.
    """
    time = sample_times(path.duration, sample_time)
    motion = path.sample(time)
    position, heading = motion[..., :3], motion[:3, :, 3]
    lengths = np.linalg.norm(np.concatenate([(position[0] - position[0, 0])[None], position[1:]]), axis=2).max(axis=1)
    maxima = dict(zip(_NAMES, lengths.tolist(), strict=True))
    return Trajectory(
        duration=path.duration, legs=(), maxima=maxima, runs=(), **along(time, position, heading, gravity)
    )
