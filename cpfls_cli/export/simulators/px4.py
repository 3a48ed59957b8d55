"""A vehicle for PX4: its model for Gazebo with the sensors that PX4 needs, the airframe, parameters of the geometry.

By ``src/modules/control_allocator`` of PX4-Autopilot (``module.yaml``, ``ActuatorEffectivenessRotors.cpp``), rotor i at
(PX, PY, PZ) m pushes along (AX, AY, AZ) by CT u^2 N at the command u of 0 to 1, and turns the body by KM m times that
about the same axis, against its own turn: KM is positive for counter-clockwise. Axes are x forward, y right, z down.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from cpfls_cli.errors import InputError
from cpfls_cli.export.holding import Held, Holds, held_by
from cpfls_cli.export.numbers import numbers_of, places, spins
from cpfls_cli.export.parameter_files import QGROUNDCONTROL_HEAD, qgroundcontrol_line
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.simulators.sdf import sdf_root, written
from cpfls_cli.export.text import commented, number
from cpfls_cli.playback.model import VehicleModel

AIRFRAME = ".airframe"
_SENSORS = (
    ("imu_sensor", "imu", "250"),
    ("air_pressure_sensor", "air_pressure", "50"),
    ("magnetometer_sensor", "magnetometer", "100"),
    ("navsat_sensor", "navsat", "30"),
)
"""Names by which PX4 finds them, kinds and rates in Hz; without noise."""

_TYPES = {4: "Quadrotor x", 6: "Hexarotor x", 8: "Octorotor x"}
"""Names of PX4's own groups of airframes, by the number of rotors; any other is one of its own."""

LACKS = "Parameters of the geometry state thrust, place and yaw torque of rotors: no mass, inertia, lag or drag."
_MOST_ROTORS = 8
_OF_GROUND = (
    "QGroundControl: Vehicle Configuration, Parameters, Tools, Load from file. Rotor N of the config is motor N, whose "
    "command of 0 to 1 is a share of the largest speed; set THR_MDL_FAC 1 with it. No gain is set here: cpfls tune "
    "--autopilot px4 finds them.",
)
_OF_AIRFRAME = (
    "Commands of 0 to 1 are rotor speeds of 0 to the largest, so thrust goes with their square: THR_MDL_FAC 1. No gain "
    "is set here: those of rc.mc_defaults were not made for this vehicle."
)
_HOVER = (0.1, 0.8)
"""Documented range of MPC_THR_HOVER."""


def px4_text(sheet: Sheet, held: Held, remarks: Sequence[str], file: str) -> str:
    """Write a vehicle for PX4, the model or by its ending the airframe, with what it does not hold."""
    if Path(file).suffix == AIRFRAME:
        return _airframe(sheet, held, remarks)
    use = (
        f"For PX4: put this file as Tools/simulation/gz/models/{sheet.name}/model.sdf next to a model.config, and the "
        f"airframe file into ROMFS/px4fmu_common/init.d-posix/airframes as a number that is free and _gz_{sheet.name}; "
        "name it in CMakeLists.txt there. Motors are in the order of the config. The world has to have the systems of "
        "PX4's own worlds, and a wind, which may be zero.",
    )
    root = sdf_root(sheet, held, remarks, use, None)
    link = next(each for each in root.iter("link") if each.get("name") == "base_link")
    for name, kind, rate in _SENSORS:
        sensor = ElementTree.SubElement(link, "sensor", name=name, type=kind)
        ElementTree.SubElement(sensor, "always_on").text = "1"
        ElementTree.SubElement(sensor, "update_rate").text = rate
    return written(root)


def px4_parameters(sheet: Sheet, held: Held, remarks: Sequence[str], _file: str) -> str:
    """Write the geometry of a vehicle as parameters that QGroundControl loads, with what they do not hold."""
    lines = commented("#", sheet.said(remarks, _OF_GROUND))
    rows = [qgroundcontrol_line(name, value) for name, value in _geometry(sheet, held).items()]
    return "\n".join([*lines, QGROUNDCONTROL_HEAD, *rows, ""])


def px4_held(model: VehicleModel) -> tuple[Held, Holds]:
    """Take what PX4's allocation knows of a vehicle: thrust, place and yaw torque of each rotor."""
    if model.rotors > _MOST_ROTORS:
        raise InputError(f"PX4 allocates to at most {_MOST_ROTORS} rotors, and this vehicle has {model.rotors}")
    numbers = numbers_of(model, lambda _see: {}, alike=False)
    return held_by(model, numbers.holds, None, numbers), numbers.holds


def _geometry(sheet: Sheet, held: Held) -> dict[str, int | float]:
    """Give the parameters of the rotors, in the axes of PX4."""
    hubs, turns = places(sheet.model, alike=False), spins(sheet.model.vehicle)
    given: dict[str, int | float] = {"CA_AIRFRAME": 0, "CA_ROTOR_COUNT": len(hubs)}
    for rotor, ((x, y, z), turn) in enumerate(zip(hubs.tolist(), turns.tolist(), strict=True)):
        thrust, yaw = (held.numbers[f"{name}_{rotor + 1}"] for name in ("thrust", "yaw"))
        values = {"PX": x, "PY": -y, "PZ": -z, "AX": 0.0, "AY": 0.0, "AZ": -1.0}
        values |= {"CT": thrust * sheet.model.vehicle.rotor_speed_max_rad_s**2, "KM": -turn * yaw / thrust}
        given |= {f"CA_ROTOR{rotor}_{name}": value for name, value in values.items()}
    return given


def _airframe(sheet: Sheet, held: Held, remarks: Sequence[str]) -> str:
    """Write the parameters by which PX4 flies the model: places and torques of rotors, speeds, thrust in hover."""
    geometry, most = _geometry(sheet, held), sheet.model.vehicle.rotor_speed_max_rad_s
    thrust = np.array([held.numbers[f"thrust_{rotor}"] for rotor in range(1, sheet.model.rotors + 1)])
    hovers = float(held.body.mass * held.body.gravity / (thrust.sum() * most**2))
    hover = float(np.clip(hovers, *_HOVER))
    cut = f"MPC_THR_HOVER: the vehicle hovers at {hovers:.3g}, outside PX4's range of {_HOVER[0]} to {_HOVER[1]}."
    parameters = {"SIM_GZ_EN": "1"}
    parameters |= {name: str(value) if isinstance(value, int) else number(value) for name, value in geometry.items()}
    for rotor in range(len(thrust)):
        parameters |= {f"SIM_GZ_EC_FUNC{rotor + 1}": str(101 + rotor), f"SIM_GZ_EC_MIN{rotor + 1}": "0"}
        parameters[f"SIM_GZ_EC_MAX{rotor + 1}"] = str(round(most))
    parameters |= {"THR_MDL_FAC": "1.0", "MPC_THR_HOVER": number(hover)}
    kind = _TYPES.get(len(thrust), "Multirotor")
    head = ["#!/bin/sh", "#", f"# @name {sheet.name}", "#", f"# @type {kind}", "#"]
    lines = commented("#", sheet.said(remarks, [*((cut, "") if hover != hovers else ()), _OF_AIRFRAME]))
    begin = ["", ". ${R}etc/init.d/rc.mc_defaults", ""]
    begin += ["PX4_SIMULATOR=${PX4_SIMULATOR:=gz}", f"PX4_SIM_MODEL=${{PX4_SIM_MODEL:={sheet.name}}}", ""]
    return "\n".join([*head, *lines, *begin, *(f"param set-default {k} {v}" for k, v in parameters.items()), ""])
