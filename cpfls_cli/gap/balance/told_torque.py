"""How much torque the rotors give under a hypothesis, so that an effect gains nothing by making all torque small."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array


def compensation(before: Array, after: Array) -> Array:
    """Weigh the channels against what an effect on the actuation takes off their torque.

    Inertia is free in every fit. Where motion follows the torque only in part, a torque half as large with half the
    inertia leaves half of the residual and explains nothing: a lag would look better the longer it is. With residuals
    times this factor, what counts is the share of the torque that the motion does not follow.

    Parameters
    ----------
    before, after : array, shape (window, 6), N m and N
        Wrench of the rotors without and with the effect.

    Returns
    -------
    array, shape (6,)
        Ratio of the standard deviations; 1 for the forces, where weight and mass hold the scale.
    """
    factor = np.ones(before.shape[1])
    spread, shrunk = before[:, :3].std(axis=0), after[:, :3].std(axis=0)
    moving = (spread > 0) & (shrunk > 0)
    factor[:3][moving] = spread[moving] / shrunk[moving]
    return factor
