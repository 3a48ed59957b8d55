"""White noise of sensors."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.simulation.settings import SimulationSettings


def noise_std(name: str, values: Array, settings: SimulationSettings) -> Array:
    """Combine the noise of each channel: absolute and relative noise are independent of each other.

    Parameters
    ----------
    name : str
        Name of the signal.
    values : array, shape (time, ...)
    settings : SimulationSettings

    Returns
    -------
    array, shape (...)
        Standard deviation of each channel.
    """
    absolute = {str(key): value for key, value in settings.noise.items()}.get(name, 0.0)
    relative = {str(key): value for key, value in settings.relative_noise.items()}.get(name, 0.0)
    if relative == 0.0:
        return np.full(values.shape[1:], absolute)
    own = [_spread(channel) for channel in values.reshape(len(values), -1).T]
    return np.hypot(absolute, relative * np.array(own).reshape(values.shape[1:]))


def noisy(
    exact: Mapping[str, Array], settings: SimulationSettings, rng: np.random.Generator
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Add white noise to signals.

    Parameters
    ----------
    exact : mapping of str to array
        By name; time is the first axis.
    settings : SimulationSettings
    rng : numpy.random.Generator

    Returns
    -------
    signals : dict of str to array
    std : dict of str to array
        Standard deviation of each channel, of the signals that have noise.
    """
    std = {name: found for name in exact if np.any(found := noise_std(name, exact[name], settings))}
    signals = {
        name: values + std[name] * rng.standard_normal(values.shape) if name in std else values
        for name, values in exact.items()
    }
    return signals, std


def _spread(channel: Array) -> float:
    known = channel[np.isfinite(channel)]
    return float(np.std(known)) if len(known) else 0.0
