"""A vehicle for PyFlyt's QuadX: its URDF with mass, inertia and places of motors, and its YAML with their numbers.

By ``PyFlyt/core/drones/quadx.py`` and ``core/abstractions/motors.py`` of jjshoots/PyFlyt, motor i at throttle y turns
at y max_rpm, max_rpm = sqrt(total_thrust / (4 thrust_coef)), lifts by thrust_coef rpm^2 at link i and turns the body by
torque_coef rpm^2 about z, motors 0 and 1 clockwise, for they turn counter-clockwise, 2 and 3 the other way; y follows
commands with the time constant tau, by steps of 1 / 240 s. Body rates are braked by drag_coef_pqr r^2 about each axis.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.effects.scales import arm
from cpfls_cli.export.holding import FOUR, Held, Holds, constant_body, held_by, of_a_body, require_two_each_way
from cpfls_cli.export.numbers import numbers_of, places, spins
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.simulators.sdf import written
from cpfls_cli.export.simulators.urdf import add_body, add_point
from cpfls_cli.export.text import xml_text, yaml_text
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.units import RPM
from cpfls_cli.vehicle.motion import Instant, Wrench
from cpfls_cli.vehicle.settings import VehicleSettings

NUMBERS = ".yaml"
STEP_S = 1 / 240
_X = ((1, -1), (-1, 1), (1, 1), (-1, -1))
"""Sides, forward and left, that PyFlyt's own controllers have motors 0 to 3 at."""
_SAME = ("ang_vel", "ang_pos", "lin_vel", "lin_pos", "z_pos", "z_vel")
_AXES = {"ang_vel": 3, "ang_pos": 3, "lin_vel": 2, "lin_pos": 2}


def pyflyt_held(model: VehicleModel) -> tuple[Held, Holds]:
    """Take what PyFlyt flies of a vehicle."""
    require_two_each_way(model, "PyFlyt's QuadX")
    numbers = numbers_of(model, _wrenches, alike=True)
    return held_by(model, numbers.holds, of_a_body(constant_body(model)), numbers, lags=True), numbers.holds


def _wrenches(see: Instant) -> Mapping[str, Wrench]:
    """Write the damping of the body rates for a unit of its coefficient."""
    size = see.functions.absolute
    return {"drag_pqr": Wrench(tuple(-size(rate) * rate for rate in see.body_rate))}


def _order(vehicle: VehicleSettings) -> IntArray:
    """Give the rotor of the config that is each motor: counter-clockwise ones first, of each way the one in front."""
    forward, left, _ = np.round([rotor.position_m for rotor in vehicle.rotors], 4).T
    return np.lexsort(np.array([-left, -forward, spins(vehicle)]))


def pyflyt_text(sheet: Sheet, held: Held, remarks: Sequence[str], file: str) -> str:
    """Write a vehicle for PyFlyt, the URDF or by its ending the numbers of its motors, with what it does not hold."""
    path, order, found = Path(file), _order(sheet.model.vehicle), held.numbers
    said = sheet.said(remarks, _use(path.stem, sheet.model.vehicle, order))
    if path.suffix != NUMBERS:
        root, hubs = ElementTree.Element("robot", name=path.stem), places(sheet.model, alike=True)
        root.append(ElementTree.Comment(xml_text(said)))
        add_body(root, held, arm(sheet.model.vehicle))
        for motor, rotor in enumerate(order.tolist()):
            add_point(root, f"motor{motor}", hubs[rotor])
        add_point(root, "body", np.zeros(3))
        return written(root)
    most = sheet.model.vehicle.rotor_speed_max_rad_s
    numbers: dict[str, Any] = {
        "motor_params": {
            "total_thrust": FOUR * found["thrust"] * most**2,
            "thrust_coef": found["thrust"] / RPM**2,
            "torque_coef": found["yaw"] / RPM**2,
            "noise_ratio": 0.0,
            "tau": held.response.lag_s or STEP_S,
        },
        "drag_params": {"drag_coef_xyz": 0.0, "drag_area_xyz": 0.0, "drag_coef_pqr": found["drag_pqr"]},
        "control_params": {name: {key: _none(name) for key in ("kp", "ki", "kd", "lim")} for name in _SAME},
    }
    return yaml_text(said, numbers)


def _none(loop: str) -> float | list[float]:
    return [0.0] * _AXES[loop] if loop in _AXES else 0.0


def _use(name: str, vehicle: VehicleSettings, order: IntArray) -> tuple[str, ...]:
    listed = ", ".join(f"motor {motor} is rotor {rotor + 1}" for motor, rotor in enumerate(order.tolist()))
    sides = tuple(tuple(np.sign(vehicle.rotors[rotor].position_m[:2]).astype(int).tolist()) for rotor in order)
    other = "" if sides == _X else " Its controllers mix for motors elsewhere, so they do not fit this vehicle."
    return (
        f"For PyFlyt: put {name}.urdf and {name}{NUMBERS} into a folder {name} of your own and give "
        f'Aviary(drone_type="quadx", drone_options=dict(drone_model="{name}", model_dir=...)). Of the config {listed}.'
        f"{other}",
        "Commands of 0 to 1 are shares of the largest rotor speed: set_mode(-1) takes them. Gains of PyFlyt's "
        "controllers are no numbers of a vehicle: control_params are 0, write yours there. A tau of 1 / 240 s is none.",
    )
