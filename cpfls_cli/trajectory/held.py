"""The plan of a vehicle that is held at its centre of mass and only turns."""

from __future__ import annotations

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.trajectory.clock import sample_times
from cpfls_cli.trajectory.planned import PlannedRotation
from cpfls_cli.trajectory.rotation_path import RotationPath


def held_rotation(path: RotationPath, sample_time: float) -> PlannedRotation:
    """Sample an attitude path.

    Parameters
    ----------
    path : RotationPath
    sample_time : float, s
    """
    time = sample_times(path.duration, sample_time)
    motion = path.sample(time)
    planes = (motion.attitude, motion.attitude_rate, motion.attitude_acceleration)
    yaw, yaw_rate, yaw_acceleration = (np.ascontiguousarray(values[:, 2]) for values in planes)
    return PlannedRotation(
        duration=path.duration,
        time=time,
        yaw=yaw,
        yaw_rate=yaw_rate,
        yaw_acceleration=yaw_acceleration,
        attitude=motion.attitude,
        attitude_rate=motion.attitude_rate,
        attitude_acceleration=motion.attitude_acceleration,
        body_rate=rotations.body_rate(motion.attitude, motion.attitude_rate),
    )
