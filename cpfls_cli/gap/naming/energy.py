"""Whether a torque without a name feeds energy into the rotation or drains it."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, IntArray

_SURE = 3.0
_FEWEST_BLOCKS = 4


def energy_words(torque: Array, body_rate: Array, block: IntArray) -> list[str]:
    """Tell which way the power ``M omega`` goes about each axis, beyond the scatter over blocks.

    Parameters
    ----------
    torque : array, shape (window, 3), N m or floors
    body_rate : array, shape (window, 3), rad/s
    block : array of int, shape (window,)

    Returns
    -------
    list of str
        ``feeds``, ``drains`` or ``neither`` by axis.
    """
    numbers = np.unique(block)
    if len(numbers) < _FEWEST_BLOCKS:
        return ["neither"] * torque.shape[1]
    power = (torque - torque.mean(axis=0)) * (body_rate - body_rate.mean(axis=0))
    means = np.array([power[block == number].mean(axis=0) for number in numbers])
    mean, error = means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(len(numbers))
    sure = np.abs(mean) > _SURE * error
    return ["neither" if not s else "feeds" if m > 0 else "drains" for m, s in zip(mean, sure, strict=True)]
