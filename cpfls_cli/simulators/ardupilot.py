"""ArduPilot's SITL: the JSON of a frame that ``--model x:FILE`` flies.

Its equations, as published with it (``SIM_Frame.cpp``, ``SIM_Motor.cpp``): a motor's command u from 0 to 1, its pulse
between ``spin_min`` and ``spin_max`` of ``pwmMin`` to ``pwmMax``, lifts by
``weight / num_motors ((1 - propExpo) u + propExpo u^2) / hoverThrOut`` at ``motorN_position``, and turns the body by
``0.05 diagonal_size motorN_yaw u`` times the thrust; positive is a rotor that turns counter-clockwise. The axes are
x forward, y right, z down. Without positions the motors are those of the frame that is named on the command line, at
``diagonal_size`` from the middle, which the comments of such files have as the diameter.

It has no speed of rotors: a study's are commands times its largest speed, and thrust by squared speed is that of hover,
as the slope of the yaw torque is, for torques cancel there.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi, sqrt
from pathlib import Path

import numpy as np

from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.errors import InputError
from cpfls_cli.simulators.document import Stated
from cpfls_cli.simulators.literals import Numbers, json_numbers
from cpfls_cli.simulators.model import Rotor, SimulatorModel, of_one_body
from cpfls_cli.vehicle_limits import room_between

KEYS = ("hoverThrOut", "diagonal_size", "propExpo", "refRotRate")
"""Of which such a file has some."""
_FASTEST = 1e5  # Of a rotor, rad/s: no propeller turns so fast.
_GRAVITY, _YAW_SHARE, _AIR, _THRUST_NUMBER = 9.80665, 0.05, 1.2, 0.025
"""The last is that of usual propellers which fit between the motors."""
_MOST_MOTORS = 32
_USUAL = {
    "mass": 3.0, "diagonal_size": 0.35, "hoverThrOut": 0.39, "propExpo": 0.65, "spin_min": 0.15, "spin_max": 0.95,
    "num_motors": 4.0,
}  # fmt: skip
"""What ArduPilot takes for what a file does not state."""
CANNOT = (
    "how fast rotors turn: controls are commands, which a study counts as shares of its largest speed",
    "the frame, and with it motors without a position: SITL takes it on its command line",
    "products of inertia and the centre of mass",
    "a lag of its motors: slew_max limits how fast commands change",
)


def read_ardupilot(file: Path) -> SimulatorModel:
    """Read the JSON of a frame; InputError if it is of no multicopter."""
    numbers = json_numbers(file)
    if not any(numbers.get(key) for key in KEYS):
        raise InputError(f"{file}: states none of {', '.join(KEYS)}, so it is no frame of ArduPilot's SITL; give one")
    notes = list[str]()
    mass, size, motors = (_or_usual(numbers, key) for key in ("mass", "diagonal_size", "num_motors"))
    for each in (mass, size, motors):
        if not each.value > 0 or (each is size and each.value > _FASTEST):
            raise InputError(f"{each.where} is {each.value:g}; write a number above 0")
    if motors.value not in range(1, _MOST_MOTORS + 1):
        raise InputError(f"{motors.where} is {motors.value:g}; write a number of motors, at most {_MOST_MOTORS}")
    given = [numbers.get("moment_inertia", axis) for axis in range(3)]
    shares = (0.25, 0.25, 0.5)
    if any(each is None or each.value == 0 for each in given):
        notes.append("it states no moment_inertia, for which ArduPilot takes half of the mass on a ring")
    moments = [
        Stated(
            share * mass.value * (size.value / 2) ** 2, f"{file.name}: no moment_inertia", name=f"moment_inertia[{at}]"
        )
        if notes
        else each
        for at, (share, each) in enumerate(zip(shares, given, strict=True))
    ]
    none = Stated(0.0, f"{file.name}: ArduPilot's frames have no products of inertia")
    body = of_one_body(
        mass,
        [*(each for each in moments if each is not None), none, none, none],
        "the motors are where its frame has them: write motorN_position of each, the other way by as much",
    )
    rotors = _rotors(numbers, round(motors.value), mass.value, size.value, notes)
    return SimulatorModel(file.stem, "ardupilot", (body,), rotors, CANNOT, tuple(notes), (file,), of_commands=True)


def _or_usual(numbers: Numbers, key: str) -> Stated:
    usual = Stated(_USUAL[key], f"{numbers.file.name}: no {key}, for which ArduPilot takes {_USUAL[key]:g}", name=key)
    return numbers.get(key) or usual


def _rotors(numbers: Numbers, count: int, mass: float, size: float, notes: list[str]) -> tuple[Rotor, ...]:
    places = [numbers.below(f"motor{motor}_position") for motor in range(1, count + 1)]
    cross = AUTOPILOTS["ardupilot"].cross
    if not all(places) and count != len(cross):
        notes.append(f"it states no motorN_position of its {count} motors, so its rotors are those of the log")
        return ()
    if not all(places):
        notes.append(
            "it states no motorN_position: the motors of ArduPilot's X are taken, and diagonal_size for the arm, as "
            "SITL does"
        )
    hover, expo, low, high = (_or_usual(numbers, key) for key in ("hoverThrOut", "propExpo", "spin_min", "spin_max"))
    if not 0 < hover.value <= 1 or not 0 <= expo.value <= 1 or not low.value < high.value:
        raise InputError(
            f"{hover.where} is {hover.value:g}, propExpo {expo.value:g}, spin_min to spin_max {low.value:g} to "
            f"{high.value:g}; write numbers of 0 to 1 in order"
        )
    lift, command = mass * _GRAVITY / count, _hover_command(hover.value, expo.value)
    share = low.value + command * (high.value - low.value)
    stated = [_place(numbers, motor) if all(places) else () for motor in range(1, count + 1)]
    hubs = np.array([_hub(motor, size, place) for motor, place in enumerate(stated, 1)])
    room = _THRUST_NUMBER * _AIR * room_between(hubs) ** 4 / (4 * pi**2)
    words = "Commands of 0 to 1 count as speeds of 0 to this, as propellers of this size turn; any number will do"
    speed = numbers.get("rotor_speed_max_rad_s") or Stated(float(f"{sqrt(lift / room) / share:.2g}"), words)
    if not 0 < speed.value < _FASTEST:
        raise InputError(f"{speed.where} is {speed.value:g}; write the largest speed of a rotor in rad/s")
    turning = share * speed.value
    factor = lift / turning**2
    # Torques of rotors cancel in hover, so their slope counts, and not their value.
    slope = hover.value + command * (1 - expo.value + 2 * expo.value * command)
    arm = _YAW_SHARE * size * slope / hover.value * turning / (2 * speed.value * (high.value - low.value))
    thrust = Stated(factor, f"{hover.where}, in hover", hover.span, hover.value * factor, -1, name="hoverThrOut")
    most = Stated(lift / hover.value, f"{hover.where}: weight over it")
    yaws = [_yaw(numbers, motor, count) for motor in range(1, count + 1)]
    return tuple(
        Rotor(
            f"motor {motor}",
            yaw.where,
            hub,
            np.array([0.0, 0.0, 1.0]),
            int(np.sign(yaw.value)),
            thrust=thrust,
            ratio=replace(yaw, value=arm * abs(yaw.value), scale=float(np.sign(yaw.value)) / arm),
            speed_max=speed,
            most=most,
            turn=yaw,
            place=place,
        )
        for motor, (hub, yaw, place) in enumerate(zip(hubs, yaws, stated, strict=True), 1)
    )


def _yaw(numbers: Numbers, motor: int, count: int) -> Stated:
    """Give the yaw factor of a motor, that of its frame where there is none or 0."""
    own, cross = numbers.get(f"motor{motor}_yaw"), AUTOPILOTS["ardupilot"].cross
    if own is not None and own.value != 0:
        return own
    turn = float(cross[motor - 1][2]) if count == len(cross) else 0.0
    return Stated(turn, f"{numbers.file.name}: no motor{motor}_yaw, for which the frame has its own")


def _place(numbers: Numbers, motor: int) -> tuple[Stated, ...]:
    """Give the stated place of a motor, x forward, y left, z up."""
    place = numbers.row(f"motor{motor}_position", count=3)
    return tuple(replace(own, value=sign * own.value, scale=sign) for own, sign in zip(place, (1, -1, -1), strict=True))


def _hub(motor: int, size: float, place: tuple[Stated, ...]) -> list[float]:
    """Give the place of a motor, that of its frame where none is stated."""
    if place:
        return [own.value for own in place]
    x, y, _ = AUTOPILOTS["ardupilot"].cross[motor - 1]
    return [x * size * sqrt(0.5), y * size * sqrt(0.5), 0.0]


def _hover_command(hover: float, expo: float) -> float:
    """Solve ``(1 - expo) u + expo u^2 = hover`` for the command u."""
    return hover if expo == 0 else (sqrt((1 - expo) ** 2 + 4 * expo * hover) - (1 - expo)) / (2 * expo)
