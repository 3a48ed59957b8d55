"""Angles that no attitude in radians reaches: most likely degrees."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError

# What noise and filters add to a nose that points straight up.
_LARGEST_PITCH = pi / 2 + 0.05
_FULL_TURN = 7.0
_USUAL_SHARE = 0.99


def refuse_steep_pitch(signals: Mapping[str, Array]) -> None:
    """Refuse an attitude whose pitch exceeds a quarter turn, which roll, pitch, yaw never do.

    Parameters
    ----------
    signals : mapping from signal name to array, shape (time, column), SI
        Repaired, in the frames of the log.

    Raises
    ------
    InputError
    """
    if "attitude" not in signals:
        return
    largest = float(np.abs(signals["attitude"][:, 1]).max())
    if largest > _LARGEST_PITCH:
        raise InputError(
            f"attitude reaches {largest:.3g} rad of pitch, and a quarter turn of 1.57 is the most there is: is"
            " import.signals.attitude.unit deg? Otherwise check the order of its columns, and spikes"
            " (import.spike_deviations)"
        )


def warn_of_angles(signals: Mapping[str, Array]) -> tuple[str, ...]:
    """Doubt roll and yaw beyond a full turn, where no gyroscope can tell their unit.

    Parameters
    ----------
    signals : mapping from signal name to array, shape (sample, column), SI
        As logged; absent values are NaN.
    """
    if "attitude" not in signals or {"body_rate", "attitude_rate"} & signals.keys():
        return ()
    # One spike is no unit.
    roll, _, yaw = np.nanquantile(np.abs(signals["attitude"]), _USUAL_SHARE, axis=0)
    return tuple(
        f"attitude reaches {angle:.3g} rad of {name}: is import.signals.attitude.unit deg? (good where the angle counts"
        " on over full turns)"
        for name, angle in (("roll", float(roll)), ("yaw", float(yaw)))
        if angle > _FULL_TURN
    )
