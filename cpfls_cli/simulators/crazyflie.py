"""The Crazyflie's firmware: mass, arm and thrust in ``platform_defaults_*.h``, by the options that it is built with.

As its ``power_distribution_quadrotor.c`` has it, motors lift along z at ``ARM_LENGTH`` from the middle on the
diagonals, motor 1 in front on the right, motor 2 behind it, and turn the body by ``THRUST2TORQUE`` times their thrust,
motors 1 and 3 counter-clockwise. By ``motors.c`` a motor lifts by ``VMOTOR2THRUST0 + VMOTOR2THRUST1 v + VMOTOR2THRUST2
v^2 + VMOTOR2THRUST3 v^3`` at v volts, its share of the battery's. So the header states thrust where a log has these
shares and the volts of the battery: that of hover counts. It states no thrust by speed, and no inertia.
"""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from pathlib import Path

import numpy as np

from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.errors import InputError
from cpfls_cli.simulators.document import Stated
from cpfls_cli.simulators.literals import header_numbers
from cpfls_cli.simulators.model import Rotor, SimulatorModel, of_one_body

_ALWAYS = "CONFIG_ENABLE_THRUST_BAT_COMPENSATED"
_USUAL = "CRAZYFLIE_21_PLUS"
CANNOT = (
    "thrust by the speed of rotors: it has thrust by the volts of a motor",
    "inertia and centre of mass",
    "how fast rotors follow their commands, and drag",
)


def read_crazyflie(file: Path, option: str) -> SimulatorModel:
    """Read a header as it is with the battery compensated, and another option where one is named.

    InputError if it states no mass or no arm.
    """
    option = (option or _USUAL).removeprefix("CONFIG_")
    numbers = header_numbers(file, (_ALWAYS, f"CONFIG_{option}"))
    absent = [key for key in ("CF_MASS", "ARM_LENGTH") if numbers.get(key) is None]
    if absent:
        raise InputError(
            f"{file}: states no {' and no '.join(absent)}; give platform_defaults_cf2.h or another header that does"
        )
    side = sqrt(0.5) * numbers.need("ARM_LENGTH").value
    curve = [own for power in range(4) if (own := numbers.get(f"VMOTOR2THRUST{power}")) is not None]
    sized = sorted((own for own in curve if own.value), key=lambda own: -abs(own.value))
    of_volts = replace(sized[0], also=tuple(sized[1:])) if sized else None
    rotors = tuple(
        Rotor(
            f"motor {index}",
            numbers.need("ARM_LENGTH").where,
            np.array([forward * side, left * side, 0.0]),
            np.array([0.0, 0.0, 1.0]),
            turn,
            ratio=numbers.get("THRUST2TORQUE"),
            most=numbers.get("THRUST_MAX"),
            curve=of_volts,
        )
        for index, (forward, left, turn) in enumerate(AUTOPILOTS["crazyflie"].cross, 1)
    )
    unknown = [Stated(0.0, f"{file.name}: no inertia")] * 6
    body = of_one_body(numbers.need("CF_MASS"), unknown, f"{file.name}: no centre of mass")
    notes = (
        f"options CONFIG_{option} and {_ALWAYS} count as set, and no other; {file.name}:CRAZYFLIE_THRUST_UPGRADE_KIT "
        "reads it with that one in place of the first",
    )
    volts = tuple(own.value for own in curve) if len(curve) == 4 else ()
    return SimulatorModel(file.stem, "crazyflie", (body,), rotors, CANNOT, notes, (file,), by_volts=volts)
