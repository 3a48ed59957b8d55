"""The motion of one vehicle under its controller, as signals of a flight."""

from __future__ import annotations

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.control.plan import Plan
from cpfls_cli.control.plants import Plant
from cpfls_cli.control.track import Tracked


def flown_signals(plan: Plan, tracked: Tracked, controller: int, plant: Plant) -> dict[str, Array]:
    """Take the motion of one vehicle at the samples of the plan, up to where it was lost.

    Torques are the mean of what acts before and after each command, and accelerations what they do to the vehicle: on
    straight lines between samples they push as the torques do that are held from command to command.

    Parameters
    ----------
    plan : Plan
    tracked : Tracked
    controller : int
        Index.
    plant : callable

    Returns
    -------
    dict of str to array
        `time`, `attitude`, `attitude_rate`, `attitude_acceleration`, `body_rate`, `torque`, `body_torque`.
    """
    known = np.isfinite(tracked.attitude[controller, :: plan.parts]).all(axis=1)
    kept = slice(0, int(np.sum(known)) * plan.parts, plan.parts)
    attitude, body_rate = tracked.attitude[controller, kept], tracked.body_rate[controller, kept]
    body_torque = 0.5 * (tracked.body_torque + tracked.torque_before)[controller, kept]
    # Nothing is known of what acted before the flight.
    body_torque[0] = tracked.body_torque[controller, 0]
    rate = rotations.attitude_rate(attitude, body_rate)
    turning = rotations.multiply(rotations.euler_rate_matrix_derivative(attitude, rate), rate)
    return {
        "time": plan.time[kept],
        "attitude": attitude,
        "attitude_rate": rate,
        "attitude_acceleration": rotations.attitude_rate(attitude, plant(attitude, body_rate, body_torque) - turning),
        "body_rate": body_rate,
        "torque": rotations.generalised_torque(attitude, body_torque),
        "body_torque": body_torque,
    }
