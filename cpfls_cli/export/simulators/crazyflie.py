"""A vehicle for the Crazyflie's firmware: the lines of ``platform_defaults_*.h`` that state it.

By ``src/platform/interface/platform_defaults.h`` and ``src/modules/src/power_distribution_quadrotor.c`` of
bitcraze/crazyflie-firmware, motors lift along z at ARM_LENGTH on the diagonals, motor 1 in front on the right, then
clockwise, 1 and 3 counter-clockwise, and turn the body by THRUST2TORQUE times their thrust; a command is a share of
THRUST_MAX. ``cpfls init --from`` and ``gap`` read it again (`cpfls_cli.simulators.crazyflie`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.errors import InputError
from cpfls_cli.export.holding import ANY_ROTORS, Held, Holds, held_by
from cpfls_cli.export.numbers import Numbers, cross_order, numbers_of, spins
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.text import commented, number
from cpfls_cli.playback.model import VehicleModel

LACKS = (
    "It states no inertia, and no thrust by speed: VMOTOR2THRUST0 to 3 go by the volts of a motor, which no model "
    "holds, so keep those of your header."
)
_USE = (
    "Put these lines into platform_defaults_cf2.h, or the header of your platform, in the place of those of the same "
    "names, THRUST_MAX and THRUST2TORQUE within its CONFIG_ENABLE_THRUST_BAT_COMPENSATED; PID gains stay as they are.",
)


def crazyflie_held(model: VehicleModel) -> tuple[Held, Holds]:
    """Take what the firmware knows of a vehicle: one thrust, one yaw torque, one arm on the diagonals."""
    order, cross = cross_order(model.vehicle, "crazyflie"), AUTOPILOTS["crazyflie"].cross
    if order is None or [-turn for *_, turn in cross] != spins(model.vehicle)[order].tolist():
        raise InputError(
            "the Crazyflie has four rotors on diagonals, that in front on the right counter-clockwise, which this "
            f"vehicle has not; {ANY_ROTORS}"
        )
    each = numbers_of(model, lambda _see: {}, alike=True)
    tables = dict(zip(each.names, each.tables, strict=True))
    # Thrust times the side of the square turns the body by roll and pitch alike.
    side = sum(
        left * tables[f"roll_{rotor + 1}"] - forward * tables[f"pitch_{rotor + 1}"]
        for rotor, (forward, left, _) in zip(order.tolist(), cross, strict=True)
    )
    numbers = Numbers(("thrust", "yaw", "side"), np.array([tables["thrust"], tables["yaw"], side]), each.size)
    return held_by(model, numbers.holds, None, numbers), numbers.holds


def crazyflie_text(sheet: Sheet, held: Held, remarks: Sequence[str], file: str) -> str:
    """Write the lines of a header, with what they do not hold."""
    found, most = held.numbers, sheet.model.vehicle.rotor_speed_max_rad_s
    given = {
        "CF_MASS": (held.body.mass, "kg"),
        "ARM_LENGTH": (np.sqrt(2) * found["side"] / found["thrust"], "m"),
        "THRUST_MAX": (found["thrust"] * most**2, "N, of one motor at the largest speed of the config"),
        "THRUST2TORQUE": (found["yaw"] / found["thrust"], "m"),
    }
    order = cross_order(sheet.model.vehicle, "crazyflie")
    motors = "" if order is None else ", ".join(f"motor {at} is rotor {own + 1}" for at, own in enumerate(order, 1))
    said = [f"{file}: a vehicle found in flights.", "", *sheet.said(remarks, _USE), f"Of the config {motors}."]
    lines = commented(" *", said)
    defines = [f"#define {name} {number(value)}f // {unit}" for name, (value, unit) in given.items()]
    return "\n".join(["/*", *lines, " */", *defines, ""])
