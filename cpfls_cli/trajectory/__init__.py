"""Training paths of smooth high derivatives, and the attitude they ask of a multirotor."""

from cpfls_cli.trajectory.path import Trajectory, plan
from cpfls_cli.trajectory.profile import BaseProfile, Holds, Peaks, covering
from cpfls_cli.trajectory.settings import TrajectorySettings

__all__ = ["BaseProfile", "Holds", "Peaks", "Trajectory", "TrajectorySettings", "covering", "plan"]
