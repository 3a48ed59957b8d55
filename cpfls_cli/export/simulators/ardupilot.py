"""A vehicle for ArduPilot's SITL: the JSON of a frame, and the equations of its multicopter model.

With the command u of a motor from 0 to 1 and the weight W, n motors give by the keys of the file (in its own order)

    thrust = W / n ((1 - propExpo) u + propExpo u^2) / hoverThrOut - W / n (climb / slipstream)^2,
    yaw torque = 0.05 diagonal_size motorN_yaw u thrust,
    drag = -mdrag_coef sqrt(density disc_area / n thrust) v,   v the velocity of the motor through the air,

at motorN_position; the angular acceleration is torque by moment_inertia, axis by axis, less 400 / refRotRate degrees a
second for each rad/s. Speeds follow commands at once. The slipstream of hover is 2 refVoltage refCurrent / W, and what
drag at refSpd and refAngle is not the motors' is the body's. `fly_ardupilot` is these equations, not ArduPilot.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.scales import arm, hover_speed
from cpfls_cli.export.holding import Held, Holds, constant_body, held_by
from cpfls_cli.export.numbers import Numbers, cross_order, numbers_of, places, spins, weights_of_model
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.text import commented, in_json
from cpfls_cli.playback.flight import State
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import Course, fly_body
from cpfls_cli.vehicle.motion import Instant, Wrench
from cpfls_cli.vehicle.values import scaled, times

STEP_S = 1 / 1200
OTHERWISE = (
    "what ArduPilot's model does otherwise: yaw torque by the cube of the speed, drag by the root of the thrust, less "
    "thrust in a climb, no gyroscopic torque of the body"
)
_GRAVITY, _HOME_M = 9.80665, 584.0
"""Of ArduPilot; and the altitude of the place where its simulator begins, if it is given no other."""
_SEA_LEVEL, _LAPSE, _POWER = 1.225, 0.0065 / 288.15, 4.2559
"""The standard atmosphere: density in kg/m^3 falls with the altitude."""
_YAW_SHARE, _DAMPING = 0.05, np.radians(400.0)
_REFERENCE_M_S, _STEEPEST = 10.0, np.radians(80.0)
_VOLTS = 12.6
_RADIUS_SHARE, _LEAST = 0.5, 1e-6
"""Radius of rotors that nobody knows, in arms."""
_ONE_SIGN = ("thrust_linear", "drag", "damping")
"""Numbers that ArduPilot takes from 0 up."""
_USE = (
    "For ArduPilot's SITL: sim_vehicle.py -v ArduCopter --model x:{file}, or another frame of so many motors. Commands "
    "of 0 to 1 are rotor speeds of 0 to the largest, without lag; set MOT_SPIN_MIN 0, MOT_SPIN_MAX 1, MOT_THST_EXPO to "
    "propExpo, MOT_PWM_MIN 1000, MOT_PWM_MAX 2000. Motors are in the order of {order}.",
    "Not known, and so left at what changes nothing: the battery (no resistance, no end) and its volts; refCurrent is "
    "that of ideal rotors of disc_area{radius}. refAlt is where thrust is as it was found, that of SITL's own home; "
    "write the altitude of yours. No gain is set here: cpfls tune --autopilot ardupilot finds them.",
)


def ardupilot_held(model: VehicleModel) -> tuple[Held, Holds]:
    """Take what ArduPilot's multicopter model flies of a vehicle."""
    body = constant_body(model)
    inertia = np.diag(np.diag(body.inertia))
    body = body._replace(inertia=inertia, inverse=np.asarray(np.linalg.inv(inertia), dtype=float), gravity=_GRAVITY)
    numbers = numbers_of(model, _wrenches, alike=True, lines=True)
    squares = slice(1 + model.rotors, 1 + 2 * model.rotors)
    own = weights_of_model(model)
    hover = hover_speed(model.vehicle)

    def turned(weights: Array) -> Array:
        """Give yaw torque that is linear in the speed to the square that grows as fast in hover."""
        given = weights.copy()
        given[2, 0, squares] += given[2, 0, 1 : 1 + model.rotors] / (2 * hover)
        given[2, 0, 1 : 1 + model.rotors] = 0.0
        return given

    first = numbers.of(turned(own))
    gone = {name for name in _ONE_SIGN if first[name] < 0}
    # propExpo has a part that is square; where there is none, squares carry the weight.
    gone |= {"thrust_linear"} if first["thrust"] <= _LEAST * first["thrust_linear"] / hover else set()
    numbers = _without(numbers, gone)
    found = dict.fromkeys(_ONE_SIGN, 0.0) | numbers.of(turned(own))

    def holds(weights: Array) -> Array:
        return numbers.holds(turned(weights))

    return replace(held_by(model, holds, body), numbers=found), holds


def _without(numbers: Numbers, names: Collection[str]) -> Numbers:
    kept = [place for place, name in enumerate(numbers.names) if name not in names]
    return Numbers(tuple(numbers.names[place] for place in kept), numbers.tables[kept], numbers.size)


def _wrenches(see: Instant) -> Mapping[str, Wrench]:
    """Write what is linear in the speeds, the drag of the motors and the damping, for a unit of each number."""
    moments = see.vehicle.inertia_kg_m2[:3]
    return {
        "thrust_linear": Wrench(at_hubs=(0, 0, see.rotor_speed)),
        "drag": Wrench(at_hubs=scaled(-see.rotor_speed, see.hub_velocity)),
        "damping": Wrench(tuple(times(-moment, rate) for moment, rate in zip(moments, see.body_rate, strict=True))),
    }


def _hover_speed(numbers: Mapping[str, float], mass: float, rotors: int) -> float:
    """Give the speed at which all rotors carry the weight, rad/s."""
    linear = max(numbers["thrust_linear"], 0.0)
    lift = mass * _GRAVITY / rotors
    return float((np.sqrt(linear**2 + 4 * numbers["thrust"] * lift) - linear) / (2 * numbers["thrust"]))


def _density(altitude: float) -> float:
    return float(_SEA_LEVEL * (1 - _LAPSE * altitude) ** _POWER)


def ardupilot_text(sheet: Sheet, held: Held, remarks: Sequence[str], file: str) -> str:
    """Write a vehicle as JSON of a frame, in comments what it does not hold; ArduPilot takes comments out."""
    vehicle, crossed = sheet.model.vehicle, cross_order(sheet.model.vehicle, "ardupilot")
    order = np.arange(len(vehicle.rotors)) if crossed is None else crossed
    known = all(rotor.radius_m for rotor in vehicle.rotors)
    words = {
        "file": file,
        "order": "ArduPilot's X" if crossed is not None else "the config, which the frame has to have too",
        "radius": "" if known else ", whose rotors are taken for half as long as the arm, for no config says",
    }
    lines = commented("# ", sheet.said(remarks, [each.format(**words) for each in _USE]))
    given = [f'  "{name}": {in_json(value)}' for name, value in _keys(sheet.model, held, order).items()]
    return "\n".join([*lines, "{", ",\n".join(given), "}", ""])


def _keys(model: VehicleModel, held: Held, order: IntArray) -> dict[str, Any]:
    found, vehicle, rotors = held.numbers, model.vehicle, model.rotors
    most, weight = vehicle.rotor_speed_max_rad_s, held.body.mass * _GRAVITY
    linear, hover = found["thrust_linear"] / found["thrust"], _hover_speed(found, held.body.mass, rotors)
    full, size, density = rotors * found["thrust"] * (most**2 + linear * most), 2 * arm(vehicle), _density(_HOME_M)
    radii = [rotor.radius_m or _RADIUS_SHARE * arm(vehicle) for rotor in vehicle.rotors]
    area = np.pi * float(np.sum(np.square(radii)))
    momentum = found["drag"] / np.sqrt(density * area / rotors * found["thrust"])
    # As fast as the vehicle's in hover, where the other grows with the square.
    cube = found["thrust"] * (3 * hover**2 + 2 * linear * hover) / most
    yaw = 2 * found["yaw"] * hover / (_YAW_SHARE * size * cube)
    hubs, turns = places(model, alike=True, lines=True), spins(vehicle)
    keys = {
        "mass": held.body.mass,
        "diagonal_size": size,
        "num_motors": rotors,
        "moment_inertia": np.diag(held.body.inertia).tolist(),
        "hoverThrOut": weight / full,
        "propExpo": most / (most + linear),
        "spin_min": 0.0,
        "spin_max": 1.0,
        "pwmMin": 1000,
        "pwmMax": 2000,
        "slew_max": 0.0,
        "refAlt": _HOME_M,
        "refRotRate": _DAMPING / found["damping"] if found["damping"] > 0 else 0.0,
        "disc_area": area,
        "mdrag_coef": momentum,
        "refSpd": _REFERENCE_M_S,
        "refAngle": _reference_angle(momentum, weight, density * area),
        "refVoltage": _VOLTS,
        "maxVoltage": _VOLTS,
        "refCurrent": 0.5 * weight * np.sqrt(2 * weight / (density * area)) / _VOLTS,
        "refBatRes": 0.0,
        "battCapacityAh": 0.0,
    }
    for motor, rotor in enumerate(order.tolist(), 1):
        # ArduPilot's body frame is x forward, y right, z down; a rotor that turns counter-clockwise counts positive.
        keys[f"motor{motor}_position"] = (hubs[rotor] * [1.0, -1.0, -1.0]).tolist()
        keys[f"motor{motor}_yaw"] = -float(turns[rotor]) * yaw
    return keys | {"rotors": [rotor + 1 for rotor in order.tolist()], "rotor_speed_max_rad_s": most}


def _reference_angle(momentum: float, weight: float, column: float) -> float:
    """Find the tilt, degrees, at which the drag of the motors alone holds the vehicle at `refSpd`: none is the body's.

    `column`: density times area of the discs, kg/m.
    """
    low, high = 0.0, _STEEPEST
    for _ in range(60):
        middle = 0.5 * (low + high)
        needed, given = weight * np.tan(middle), _momentum_drag(momentum, weight, column, _REFERENCE_M_S, middle)
        low, high = (middle, high) if given > needed else (low, middle)
    return float(np.degrees(0.5 * (low + high)))


def _momentum_drag(momentum: float, weight: float, column: float, speed: float, tilt: float) -> float:
    lift = weight / np.cos(tilt)
    return float(np.cos(tilt) * momentum * speed * np.cos(tilt) * np.sqrt(lift * column))


def fly_ardupilot(text: str, course: Course, *, own: bool = True) -> State:
    """Fly an exported vehicle by the equations of ArduPilot's multicopter; see `Otherwise.fly`."""
    keys = json.loads("\n".join(line for line in text.splitlines() if not line.startswith("#")))
    motors, mass, most = keys["num_motors"], keys["mass"], keys["rotor_speed_max_rad_s"]
    order = np.array(keys["rotors"]) - 1
    hubs = np.array([keys[f"motor{motor}_position"] for motor in range(1, motors + 1)]) * [1.0, -1.0, -1.0]
    yaw = -np.array([keys[f"motor{motor}_yaw"] for motor in range(1, motors + 1)])
    weight, density = mass * _GRAVITY, _density(keys["refAlt"])
    moments, expo, hovering = np.array(keys["moment_inertia"]), keys["propExpo"], keys["hoverThrOut"]
    lever = yaw * _YAW_SHARE * keys["diagonal_size"]
    momentum, body = _drags(keys, weight, density)
    slipstream = 2 * keys["refVoltage"] * keys["refCurrent"] / weight
    damping = _DAMPING / keys["refRotRate"] if keys["refRotRate"] > 0 else 0.0
    hover = float((np.sqrt((1 - expo) ** 2 + 4 * expo * hovering) - (1 - expo)) / (2 * expo))

    def wrench_of(speed: Array, air: Array, rate: Array, _rotation: Array) -> tuple[Array, Array]:
        command = speed[:, order] / most
        thrust = weight / motors * ((1 - expo) * command + expo * command**2) / hovering
        through = air[:, None] + rotations.cross(rate[:, None], hubs)
        if own:
            thrust = thrust - weight / motors * (np.maximum(through[..., 2], 0.0) / slipstream) ** 2
            root, turning = np.sqrt(np.abs(thrust)), lever * command * thrust
        else:
            full = weight / motors / hovering
            root = np.sqrt(full * expo) * command
            # The square that grows as the cube does in hover.
            turning = lever * full * (3 * expo * hover**2 + 2 * (1 - expo) * hover) / (2 * hover) * command**2
        force = thrust[..., None] * [0.0, 0.0, 1.0] - momentum * root[..., None] * through
        torque = rotations.cross(hubs, force).sum(axis=1) - damping * moments * rate
        torque[:, 2] += turning.sum(axis=1)
        total = force.sum(axis=1)
        if own:
            torque = torque + rotations.cross(rate, rate * moments)
            total = total - body * np.abs(air) * air
        return torque, total

    return fly_body(course, mass, np.diag(moments), wrench_of, 0.0)


def _drags(keys: Mapping[str, Any], weight: float, density: float) -> tuple[float, float]:
    """Give the drag of a motor by velocity and the root of its thrust, and that of the body by velocity squared."""
    tilt, speed, column = np.radians(keys["refAngle"]), keys["refSpd"], density * keys["disc_area"]
    coefficient = keys["mdrag_coef"]
    needed, given = weight * np.tan(tilt), _momentum_drag(coefficient, weight, column, speed, tilt)
    if given > needed:
        coefficient *= needed / given
    return coefficient * np.sqrt(column / keys["num_motors"]), max(needed - given, 0.0) / speed**2
