"""Random attitude paths of full rotations within limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.errors import SettingError
from cpfls_cli.trajectory.rotation_limits import RotationLimits
from cpfls_cli.trajectory.rotation_path import RotationPath
from cpfls_cli.trajectory.rotation_settings import RotationSettings

# Share of the rate limit that the turns of one angle may take; the harmonics have the rest.
_TURNING = 0.15
# More would need more memory than a flight is worth.
_MOST_HARMONICS, _MOST_TURNS = 300, 10_000


def full_rotation(
    settings: RotationSettings,
    duration: float,
    rng: np.random.Generator,
    inertia: Sequence[float] | None = None,
) -> RotationPath:
    """Draw a path at random that uses up one of its limits.

    Parameters
    ----------
    settings : RotationSettings
    duration : float, s
        Of the whole path, which is closed on the circle.
    rng : numpy.random.Generator
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
