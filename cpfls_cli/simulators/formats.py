"""Formats of vehicle models: what tells one from another, its reader, its units and frames with their source."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from cpfls_cli.errors import InputError
from cpfls_cli.simulators.document import read_xml
from cpfls_cli.simulators.mjcf import read_mjcf
from cpfls_cli.simulators.model import SimulatorModel, checked
from cpfls_cli.simulators.sdf import read_sdf
from cpfls_cli.simulators.urdf import read_urdf


@dataclass(frozen=True)
class Format:
    """A format of vehicle models.

    Attributes
    ----------
    root : str
        Name of the first element of its files.
    units, frames, source : str
        Of its numbers, of its axes, and where that is documented.
    """

    name: str
    program: str
    root: str
    read: Callable[[Path], SimulatorModel]
    units: str
    frames: str
    source: str


FORMATS = (
    Format(
        "sdf",
        "Gazebo",
        "sdf",
        read_sdf,
        "SI; speeds in rad/s, motorConstant N s^2, momentConstant m, rotorDragCoefficient N s^2/(m rad)",
        "x forward, y left, z up; poses in m and rad, roll pitch yaw about fixed axes",
        "sdformat.org/spec; gz-sim MulticopterMotorModel.cc; PX4-SITL_gazebo-classic gazebo_motor_model.cpp",
    ),
    Format(
        "urdf",
        "gym-pybullet-drones",
        "robot",
        read_urdf,
        "SI; kf N/rpm^2, km N m/rpm^2, thrust2weight of 9.8 m/s^2, drag_coeff N s^2/(m rad)",
        "x forward, y left, z up; origins in m and rad, roll pitch yaw about fixed axes",
        "wiki.ros.org/urdf/XML; gym-pybullet-drones BaseAviary.py",
    ),
    Format(
        "mjcf",
        "MuJoCo",
        "mujoco",
        read_mjcf,
        "SI; a control times gear is N and N m; angles in degrees unless compiler angle says radian",
        "x forward, y left, z up; an actuator pushes in the axes of its site",
        "mujoco.readthedocs.io, XML reference",
    ),
)
"""In the order in which messages name them."""

ENDINGS = (".sdf", ".urdf", ".xml", ".mjcf", ".xacro", ".jinja", ".world")


def is_simulator_file(path: Path) -> bool:
    """Tell whether a file is for a simulator, by its ending."""
    return path.suffix.lower() in ENDINGS


def read_model(path: Path) -> SimulatorModel:
    """Read the vehicle in a simulator's file, checked: it has mass, no body's inertia is impossible, and it can hover.

    Raises
    ------
    InputError
        If the file is of no known format, or states no such vehicle.
    """
    return checked(format_of(path).read(path))


def format_of(path: Path) -> Format:
    """Tell the format of a simulator's file by its first element; raises InputError where it is none of those."""
    if path.suffix.lower() in (".xacro", ".jinja"):
        raise InputError(f"{path}: is a template; render it first (xacro {path.name} > {path.stem}), and give that")
    root = read_xml(path)
    found = next((each for each in FORMATS if each.root == root.tag), None)
    if found is None:
        known = ", ".join(f"<{each.root}> of {each.program}" for each in FORMATS)
        raise InputError(f"{path}: begins with <{root.tag}>, which is no model known here; known are {known}")
    return found
