"""A vehicle for Webots: a PROTO of a Robot with a Propeller for each rotor.

By ``docs/reference/propeller.md`` and ``src/webots/nodes/WbPropeller.cpp`` of cyberbotics/webots, a propeller whose
motor turns at w about its shaft axis z, positive counter-clockwise, gives

    thrust = thrustConstants[0] w |w|,   yaw torque of the body = -torqueConstants[0] w |w|,

at centerOfThrust, the torque at most maxTorque; speeds follow commands at once. As in ``Mavic2Pro.proto``, rotors that
turn clockwise have negative speeds, and lift by a negative constant. The second constants act on the speed through the
air along the z of the world, not of the body, so they are 0. ``Physics`` states mass and inertia about the centre.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.scales import arm
from cpfls_cli.export.holding import Held, Holds, constant_body, held_by
from cpfls_cli.export.numbers import numbers_of, places, spins
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.source import fill_template
from cpfls_cli.export.text import checked_identifier, comment_lines, number
from cpfls_cli.inertia import INERTIA_ENTRIES
from cpfls_cli.playback.model import VehicleModel

_HEIGHT_SHARE, _SPARE = 0.2, 2.0
"""Height of the box that collides, in arms; and what motors may turn by, in torques of their largest speed."""


def webots_held(model: VehicleModel) -> tuple[Held, Holds]:
    """Take what Webots flies of a vehicle."""
    numbers = numbers_of(model, lambda _see: {}, alike=False)
    return held_by(model, numbers.holds, constant_body(model), numbers), numbers.holds


def webots_text(sheet: Sheet, held: Held, remarks: Sequence[str], file: str) -> str:
    """Write a vehicle as a PROTO, which is named as its file is, with what it does not hold."""
    vehicle, found, most = sheet.model.vehicle, held.numbers, sheet.model.vehicle.rotor_speed_max_rad_s
    hubs, ways = places(sheet.model, alike=False), (-spins(vehicle)).astype(int).tolist()
    six, length = [held.body.inertia[at] for at in INERTIA_ENTRIES], arm(vehicle)
    rotors = [
        {
            "place": _numbers(hub),
            "thrust": number(way * found[f"thrust_{index}"]),
            "torque": number(found[f"yaw_{index}"]),
            "most": number(_SPARE * abs(found[f"yaw_{index}"]) * most**2),
        }
        for index, (hub, way) in enumerate(zip(hubs, ways, strict=True), 1)
    ]
    clockwise = [f"motor{index}" for index, way in enumerate(ways, 1) if way < 0]
    words = {
        "name": checked_identifier(Path(file).stem),
        "facts": comment_lines(sheet.said(remarks, _use(clockwise))),
        "rotors": rotors,
        "speed": number(most),
        "mass": number(held.body.mass),
        "moments": _numbers(six[:3]),
        "products": _numbers(six[3:]),
        "size": _numbers([2 * length, 2 * length, _HEIGHT_SHARE * length]),
    }
    return fill_template("webots.proto.j2", words)


def _numbers(values: Sequence[float] | Array) -> str:
    return " ".join(number(value) for value in np.asarray(values).tolist())


def _use(clockwise: Sequence[str]) -> tuple[str, ...]:
    return (
        "For Webots: put this file into the folder protos of your project. motorN turns rotor N of the config: set its "
        "position to infinity, then its velocity in rad/s"
        + (f", negative for {', '.join(clockwise)}." if clockwise else "."),
    )
