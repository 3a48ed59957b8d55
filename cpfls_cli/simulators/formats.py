"""Formats of vehicle models: what tells one from another, its reader, its units and frames with their source."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from cpfls_cli.errors import InputError
from cpfls_cli.simulators.ardupilot import KEYS, read_ardupilot
from cpfls_cli.simulators.crazyflie import read_crazyflie
from cpfls_cli.simulators.crazyflow import read_crazyflow
from cpfls_cli.simulators.document import TEMPLATE, read_bytes, read_xml
from cpfls_cli.simulators.mjcf import read_mjcf
from cpfls_cli.simulators.model import SimulatorModel, checked
from cpfls_cli.simulators.rotorpy import read_rotorpy
from cpfls_cli.simulators.sdf import read_sdf
from cpfls_cli.simulators.urdf import read_urdf


@dataclass(frozen=True)
class Format:
    """A format of vehicle models.

    Attributes
    ----------
    root : str
        Name of the first element of its files; empty where they are no XML.
    units, frames, source : str
        Of its numbers, of its axes, and where that is documented.
    """

    name: str
    program: str
    root: str
    read: Callable[[Path, str], SimulatorModel]
    units: str
    frames: str
    source: str
    ending: str = ""


_OF_PLUGIN = "SI; speeds in rad/s, motorConstant N s^2, momentConstant m, rotorDragCoefficient N s^2/(m rad)"
_OF_URDF = "x forward, y left, z up; origins in m and rad, roll pitch yaw about fixed axes"
FORMATS = (
    Format(
        "sdf",
        "Gazebo",
        "sdf",
        lambda file, _: read_sdf(file),
        _OF_PLUGIN,
        "x forward, y left, z up; poses in m and rad, roll pitch yaw about fixed axes",
        "sdformat.org/spec; gz-sim MulticopterMotorModel.cc; PX4-SITL_gazebo-classic gazebo_motor_model.cpp",
    ),
    Format(
        "urdf",
        "gym-pybullet-drones",
        "robot",
        lambda file, _: read_urdf(file),
        "SI; kf N/rpm^2, km N m/rpm^2, thrust2weight of 9.8 m/s^2, drag_coeff N s^2/(m rad)",
        _OF_URDF,
        "wiki.ros.org/urdf/XML; gym-pybullet-drones BaseAviary.py",
    ),
    Format(
        "urdf-gazebo",
        "Gazebo",
        "",
        lambda file, _: read_urdf(file),
        _OF_PLUGIN,
        _OF_URDF,
        "wiki.ros.org/urdf/XML; rotors_simulator gazebo_motor_model.cpp",
    ),
    Format(
        "mjcf",
        "MuJoCo",
        "mujoco",
        lambda file, _: read_mjcf(file),
        "SI; a control times gear is N and N m; angles in degrees unless compiler angle says radian",
        "x forward, y left, z up; an actuator pushes in the axes of its site",
        "mujoco.readthedocs.io, XML reference",
    ),
    Format(
        "rotorpy",
        "RotorPy",
        "",
        lambda file, _: read_rotorpy(file),
        "SI; speeds in rad/s, k_eta N s^2, k_m N m s^2, k_d and k_z N s^2/(m rad), k_h N s^2/m^2, k_flap N s^2/rad, "
        "c_Dx to c_Dz N s^2/m^2, tau_m s",
        "x forward, y left, z up; rotor_directions 1 turns the body counter-clockwise, so the rotor clockwise",
        "rotorpy/vehicles/multirotor.py, hummingbird_params.py",
        ".py",
    ),
    Format(
        "ardupilot",
        "ArduPilot's SITL",
        "",
        lambda file, _: read_ardupilot(file),
        "SI; commands from 0 to 1, hoverThrOut the one of hover; motorN_yaw in 1/20 of diagonal_size",
        "x forward, y right, z down; motorN_yaw 1 is a rotor that turns counter-clockwise seen from above",
        "ArduPilot libraries/SITL/SIM_Frame.cpp, SIM_Frame.h, SIM_Motor.cpp",
        ".json",
    ),
    Format(
        "crazyflow",
        "crazyflow and drone-models",
        "",
        read_crazyflow,
        "SI, but speeds in rpm: rpm2thrust N, N/rpm, N/rpm^2, rpm2torque alike, rotor_dyn_coef 1/s and 1/(s rpm); "
        "drag_matrix N s/m",
        "x forward, y left, z up; the last row of mixing_matrix is the turn of the body",
        "drone-models drone_models/data/params.toml, first_principles/model.py",
        ".toml",
    ),
    Format(
        "crazyflie",
        "the Crazyflie's firmware",
        "",
        read_crazyflie,
        "SI; CF_MASS kg, ARM_LENGTH and THRUST2TORQUE m, THRUST_MAX N of a motor, VMOTOR2THRUST N by powers of volts",
        "x forward, y left, z up; motors on the diagonals, 1 in front on the right, then clockwise",
        "crazyflie-firmware src/platform/interface/platform_defaults_cf2.h, power_distribution_quadrotor.c",
        ".h",
    ),
)
"""In the order in which messages name them."""

ENDINGS = (".sdf", ".urdf", ".xml", ".mjcf", ".xacro", ".jinja", ".world", ".py", ".toml", ".h")


def file_of(path: Path) -> Path:
    """Take the name of a vehicle off a file with several, as in ``params.toml:cf2x_L250``."""
    return path.with_name(path.name.rpartition(":")[0]) if _named(path) else path


def _named(path: Path) -> str:
    file, _, name = path.name.rpartition(":")
    return name if Path(file).suffix.lower() in (".toml", ".h") else ""


def is_simulator_file(path: Path) -> bool:
    """Tell whether a file is for a simulator, by its ending; of JSON by keys that only a frame has."""
    file = file_of(path)
    if file.suffix.lower() == ".json" and file.is_file():
        return any(f'"{key}"'.encode() in read_bytes(file) for key in KEYS)
    return file.suffix.lower() in ENDINGS


def read_model(path: Path) -> SimulatorModel:
    """Read the vehicle in a simulator's file, checked: it has mass, no body's inertia is impossible, and it can hover.

    InputError if the file is of no known format, or states no such vehicle.
    """
    return checked(as_stated(path))


def as_stated(path: Path) -> SimulatorModel:
    """Read the vehicle in a simulator's file as it is; raises InputError where it is of no known format."""
    path, name = file_of(path), _named(path)
    of_text = next((each for each in FORMATS if each.ending and each.ending == path.suffix.lower()), None)
    if of_text is not None:
        return replace(of_text.read(path, name), section=name)
    if path.suffix.lower() in (".xacro", ".jinja"):
        raise InputError(f"{path}: is {TEMPLATE}")
    root = read_xml(path)
    found = next((each for each in FORMATS if each.root == root.tag), None)
    if found is None:
        known = ", ".join(f"<{each.root}> of {each.program}" for each in FORMATS if each.root)
        raise InputError(f"{path}: begins with <{root.tag}>, which is no model known here; known are {known}")
    return found.read(path, name)
