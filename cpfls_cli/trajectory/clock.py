"""The times at which a plan is sampled."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import SettingError

_LARGEST_SIZE = 10_000_000


def sample_times(duration: float, sample_time: float) -> Array:
    """Divide a duration into samples.

    Parameters
    ----------
    duration : float, s
    sample_time : float, s

    Returns
    -------
    array, shape (time,), s
        From 0; the last one is not later than the duration.
    """
    # A duration of 0.7 s holds 7 steps of 0.1 s although the quotient is below 7 by rounding.
    steps = int(duration / sample_time + 1e-6)
    time: Array = np.arange(steps + 1, dtype=np.float64) * sample_time
    return time


def check_samples(duration: float, sample_time: float) -> None:
    """Refuse a sample time that does not suit a duration.

    Parameters
    ----------
    duration : float, s
    sample_time : float, s

    Raises
    ------
    SettingError
        If there would be one sample, or more than memory holds.
    """
    if duration > _LARGEST_SIZE * sample_time:
        raise SettingError("sample_time_s", f"makes more than {_LARGEST_SIZE} samples of {duration:g} s; raise it")
    if sample_time > duration:
        raise SettingError("sample_time_s", f"is longer than the whole path, which takes {duration:g} s")


def check_duration(moves: int, needed: float, duration: float) -> None:
    """Refuse a duration that the moves do not fit into.

    Parameters
    ----------
    moves : int
    needed : float, s
        By all of them.
    duration : float, s

    Raises
    ------
    SettingError
    """
    if needed > duration * (1 + 1e-12):
        words = f"{moves} moves take" if moves > 1 else "the move takes"
        raise SettingError("duration_s", f"{words} {needed:g} s; raise it, or set it to null for as long as they take")
