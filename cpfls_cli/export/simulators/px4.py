"""A vehicle for PX4 in Gazebo: its model with the sensors that PX4 needs, and the file of its airframe."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from cpfls_cli.export.holding import Held
from cpfls_cli.export.numbers import places, spins
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.simulators.sdf import sdf_root, written
from cpfls_cli.export.text import comment_lines, number

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

_HOVER = (0.1, 0.8)
"""Documented range of MPC_THR_HOVER."""


def px4_text(sheet: Sheet, held: Held, remarks: Sequence[str], file: str) -> str:
    """Write a vehicle for PX4, the model or by its ending the airframe, with what it does not hold."""
    if Path(file).suffix == AIRFRAME:
        return _airframe(sheet, held, remarks)
    use = (
        f"For PX4: put this file as Tools/simulation/gz/models/{sheet.name}/model.sdf beside a model.config, and the "
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


def _airframe(sheet: Sheet, held: Held, remarks: Sequence[str]) -> str:
    """Write the parameters by which PX4 flies the model: places and torques of rotors, speeds, thrust in hover."""
    vehicle, hubs, turns = sheet.model.vehicle, places(sheet.model, alike=False), spins(sheet.model.vehicle)
    most = vehicle.rotor_speed_max_rad_s
    thrust = np.array([held.numbers[f"thrust_{rotor + 1}"] for rotor in range(len(hubs))])
    hovers = float(held.body.mass * held.body.gravity / (thrust.sum() * most**2))
    hover = float(np.clip(hovers, *_HOVER))
    cut = f"MPC_THR_HOVER: the vehicle hovers at {hovers:.3g}, outside PX4's range of {_HOVER[0]} to {_HOVER[1]}."
    parameters: dict[str, str] = {"SIM_GZ_EN": "1", "CA_AIRFRAME": "0", "CA_ROTOR_COUNT": str(len(hubs))}
    for rotor, (x, y, z) in enumerate(hubs.tolist()):
        lever = held.numbers[f"yaw_{rotor + 1}"] / thrust[rotor]
        # PX4's body frame is x forward, y right, z down; a rotor that turns counter-clockwise counts positive.
        values = {"PX": x, "PY": -y, "PZ": -z, "KM": -float(turns[rotor]) * lever}
        parameters |= {f"CA_ROTOR{rotor}_{name}": number(value) for name, value in values.items()}
        parameters |= {f"SIM_GZ_EC_FUNC{rotor + 1}": str(101 + rotor), f"SIM_GZ_EC_MIN{rotor + 1}": "0"}
        parameters[f"SIM_GZ_EC_MAX{rotor + 1}"] = str(round(most))
    parameters |= {"THR_MDL_FAC": "1.0", "MPC_THR_HOVER": number(hover)}
    kind = _TYPES.get(len(hubs), "Multirotor")
    head = ["#!/bin/sh", "#", f"# @name {sheet.name}", "#", f"# @type {kind}", "#"]
    said = [
        *sheet.facts,
        "",
        *remarks,
        "",
        *((cut, "") if hover != hovers else ()),
        "Commands of 0 to 1 are rotor speeds of 0 to the largest, so thrust goes with their square: THR_MDL_FAC 1. No "
        "gain is set here: those of rc.mc_defaults were not made for this vehicle.",
    ]
    lines = [f"#{line}".rstrip() for line in comment_lines(said)]
    begin = ["", ". ${R}etc/init.d/rc.mc_defaults", ""]
    begin += ["PX4_SIMULATOR=${PX4_SIMULATOR:=gz}", f"PX4_SIM_MODEL=${{PX4_SIM_MODEL:={sheet.name}}}", ""]
    return "\n".join([*head, *lines, *begin, *(f"param set-default {k} {v}" for k, v in parameters.items()), ""])
