"""Smooth paths in space, the attitude that they require of a multirotor, and attitude paths of full rotations."""

from cpfls_cli.trajectory.limits import Limits
from cpfls_cli.trajectory.moves import Move, Moves
from cpfls_cli.trajectory.planning import PlannedRotation, Trajectory, held_rotation, plan
from cpfls_cli.trajectory.profile import BaseProfile, Holds, Peaks, covering
from cpfls_cli.trajectory.rotation import RotationPath, full_rotation
from cpfls_cli.trajectory.settings import RotationSettings, TrajectorySettings
from cpfls_cli.trajectory.time_optimal import plan_move, plan_moves

__all__ = [
    "BaseProfile",
    "Holds",
    "Limits",
    "Move",
    "Moves",
    "Peaks",
    "PlannedRotation",
    "RotationPath",
    "RotationSettings",
    "Trajectory",
    "TrajectorySettings",
    "covering",
    "full_rotation",
    "held_rotation",
    "plan",
    "plan_move",
    "plan_moves",
]
