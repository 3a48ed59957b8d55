"""A vehicle for crazyflow and drone-models: a section of parameters of their first-principles dynamics, in TOML.

With rotor speeds n in rpm, the velocity v in the world and R from body to world, these are

    force = R (0, 0, sum f) + R drag_matrix R^T v,   f = rpm2thrust[1] n + rpm2thrust[2] n^2,
    torque = (L, L, 0) (mixing_matrix f) + (0, 0, 1) (mixing_matrix t),   t = rpm2torque[1] n + rpm2torque[2] n^2,

one curve for all rotors, and speeds follow commands by rotor_dyn_coef.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.scales import arm, hover_speed
from cpfls_cli.export.holding import Held, Holds, constant_body, held_by, require_four
from cpfls_cli.export.numbers import Numbers, numbers_of, places, spins
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.text import commented, in_json
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.units import RPM
from cpfls_cli.vehicle.motion import Instant, Wrench
from cpfls_cli.vehicle.settings import VehicleSettings

_FORCE_OF_VELOCITY = slice(3, 6), slice(1, 4)
DRAG = (*_FORCE_OF_VELOCITY, 0)
"""Places in a table of weights."""

_USE = (
    "For crazyflow put the section into crazyflow/dynamics/first_principles/params.toml under the name of one of its "
    "drones, for drone-models into drone_models/data/params.toml; or give it to the function itself, with "
    "J_inv=inv(J). Commands are rotor speeds in rpm, in the order of the config. Gusts are dist_f and dist_t, both in "
    "the world frame."
)


def crazyflow_held(model: VehicleModel) -> tuple[Held, Holds]:
    """Take what these dynamics fly of a vehicle."""
    require_four(model, "crazyflow and drone-models mix")
    numbers = numbers_of(model, _wrenches, alike=True, lines=True)
    holds = with_drag(numbers, model.vehicle)
    return held_by(model, holds, constant_body(model), numbers, lags=True), holds


def with_drag(numbers: Numbers, vehicle: VehicleSettings, taken: Callable[[Array], Array] = np.asarray) -> Holds:
    """Hold a simulator's numbers, and what is taken of the drag that hovering rotors are to the body, shape (3, 3)."""
    hover, rotors = hover_speed(vehicle), len(vehicle.rotors)
    turning = np.concatenate([[1.0], np.full(rotors, hover), np.full(rotors, hover**2), np.zeros(2 * rotors)])

    def holds(weights: Array) -> Array:
        held = numbers.holds(weights)
        held[DRAG] = taken(weights[_FORCE_OF_VELOCITY] @ turning)
        return held

    return holds


def _wrenches(see: Instant) -> Mapping[str, Wrench]:
    """Give the part of the curves that is linear in the speed, for a unit of each number."""
    yaw = -see.functions.total(see.spins * see.rotor_speed)
    return {"thrust_linear": Wrench(at_hubs=(0, 0, see.rotor_speed)), "yaw_linear": Wrench((0, 0, yaw))}


def crazyflow_text(sheet: Sheet, held: Held, remarks: Sequence[str], _file: str) -> str:
    """Write a vehicle as a section of TOML, with what it does not hold."""
    found, vehicle = held.numbers, sheet.model.vehicle
    hubs, length = places(sheet.model, alike=True, lines=True), arm(vehicle)
    most = vehicle.rotor_speed_max_rad_s
    rate = 1.0 / held.response.lag_s if held.response.lag_s else 0.0
    given: dict[str, Any] = {
        "gravity_vec": [0.0, 0.0, -held.body.gravity],
        "mass": held.body.mass,
        "J": held.body.inertia.tolist(),
        "L": length,
        "rpm2thrust": [0.0, found["thrust_linear"] / RPM, found["thrust"] / RPM**2],
        "rpm2torque": [0.0, found["yaw_linear"] / RPM, found["yaw"] / RPM**2],
        "rotor_dyn_coef": [rate, 0.0, rate, 0.0],
        "mixing_matrix": [(hubs[:, 1] / length).tolist(), (-hubs[:, 0] / length).tolist(), spins(vehicle).tolist()],
        "drag_matrix": held.weights[DRAG].tolist(),
        "prop_inertia": 0.0,
        "thrust_min": 0.0,
        "thrust_max": found["thrust_linear"] * most + found["thrust"] * most**2,
    }
    lag = () if rate else ("The rotors have no lag: give no rotor_vel, or commands and rotor_vel alike.",)
    lines = commented("#", sheet.said(remarks, [_USE, *lag]))
    return "\n".join(
        [*lines, "", f"[{sheet.name}]", *(f"{name} = {in_json(each)}" for name, each in given.items()), ""]
    )
