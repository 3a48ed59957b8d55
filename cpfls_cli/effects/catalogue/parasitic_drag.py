"""Parasitic drag of the fuselage, which acts at a centre of pressure."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Effect, of_axes
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.values import cross, dot, scaled

_FORCE, _TORQUE = scales.drag_at_ten_metres_per_second, scales.arm_drag_at_ten_metres_per_second
_FORCES = of_axes("c_{}", "N s^2/m^2", 0.0, 0.6, "half of air density times drag area along {}", _FORCE)
_TORQUES = of_axes("cr_{}", "N s^2/m", -0.2, 0.2, "drag times the {} of the centre of pressure", _TORQUE)


def _lever(linear: Array, error: Array, vehicle: VehicleSettings) -> BoolArray:
    """Find which torques a drag can have: its centre of pressure lies within a body length of the centre of mass."""
    length, largest = 2 * scales.arm(vehicle), float((linear + 2 * error)[:3].max())
    possible = np.ones(6, dtype=bool)
    possible[3:] = np.abs(linear[3:]) - 2 * error[3:] <= length * max(largest, 0.0)
    return possible


def _acts(see: Instant, p: Numbers) -> Wrench:
    drag = scaled(-see.functions.sqrt(dot(see.air_velocity, see.air_velocity)), see.air_velocity)
    lever = tuple(p[f"cr_{axis}"] for axis in "xyz")
    return Wrench(cross(lever, drag), tuple(p[f"c_{axis}"] * each for axis, each in zip("xyz", drag, strict=True)))


EFFECT = Effect(
    name="parasitic_drag",
    order=90,
    title="parasitic drag of the fuselage",
    rotorpy={f"c_{axis}": f"c_D{axis}" for axis in "xyz"},
    kind="wrench",
    formula="F = -|v| (c_x v_x, c_y v_y, c_z v_z),  M = cr x (-|v| v)",
    sentence="The drag of the fuselage grows with the square of the air speed, and turns the vehicle if it acts off "
    "the centre of mass.",
    coefficients=(*_FORCES, *_TORQUES),
    needs=frozenset({"velocity"}),
    excitation="legs at two or more speeds, in both directions",
    rivals={
        "rotor_drag": "fly legs at two speeds, one twice the other; change the thrust at constant speed",
        "flapping_moment": "fly legs at two speeds, one twice the other",
        "wind": "fly legs in opposite directions, and at two speeds",
    },
    source="RotorPy multirotor.py (c_Dx, c_Dy, c_Dz); AirSim (drag of each face)",
    lever=_lever,
    acts=_acts,
)
