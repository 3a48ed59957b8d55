"""A vehicle's motor mixer for Betaflight: lines of its command line.

By ``src/main/flight/mixer.c``, ``mixer_init.c`` and ``src/main/cli/cli.c`` of betaflight/betaflight, motor i gets

    throttle_i throttle + roll_i R + pitch_i P - yaw_i Y

of ``mmix i throttle roll pitch yaw``, with sums of its controllers that are positive to the right (R), nose down (P)
and counter-clockwise (Y), and ``yaw_motors_reversed`` off; its own mixers, such as QUADX and HEX6X, have a motor on the
left positive in roll, at the rear positive in pitch, and one that turns counter-clockwise positive in yaw.

The columns here invert the matrix from thrusts of rotors to torques and lift (pseudo-inverse), so each sum turns the
vehicle about its own axis alone; of equal arms they are Betaflight's own. Roll and pitch have one scale, in which the
largest number of the two is 1; so has yaw, and throttle.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.export.holding import Held, Holds, held_by
from cpfls_cli.export.numbers import numbers_of
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.text import commented, number
from cpfls_cli.playback.model import VehicleModel

LACKS = "It states how motors share thrust and torques: no mass, inertia, size of thrust, lag or drag."
_MOST_MOTORS, _LEAST = 8, 1e-6
"""Of Betaflight; and numbers of a mixer that are none."""
_USE = (
    "For Betaflight's CLI. Motor N - 1 of mmix is rotor N of the config; commands count as shares of the largest "
    "thrust, so set thrust_linear where they are shares of the speed. Yaw is for yaw_motors_reversed = OFF, whatever "
    "way rotors turn. One sum of roll or pitch gives the same torque about either axis.",
)


def betaflight_held(model: VehicleModel) -> tuple[Held, Holds]:
    """Take what a mixer knows of a vehicle: thrust and torques of each rotor."""
    numbers = numbers_of(model, lambda _see: {}, alike=False)
    held = held_by(model, numbers.holds, None, numbers)
    _mixer(held)
    return held, numbers.holds


def betaflight_text(sheet: Sheet, held: Held, remarks: Sequence[str], _file: str) -> str:
    """Write the mixer of a vehicle, with what it does not hold."""
    lines = commented("#", sheet.said(remarks, _USE))
    mixers = [
        f"mmix {motor} {' '.join(number(share, '.6f') for share in shares)}"
        for motor, shares in enumerate(_mixer(held).tolist())
    ]
    return "\n".join([*lines, "mixer CUSTOM", "mmix reset", *mixers, "save", ""])


def _mixer(held: Held) -> Array:
    """Mix throttle, roll, pitch and yaw to the rotors, shape (rotor, 4); refuse what Betaflight cannot mix."""
    rotors = len(held.vehicle.rotors)
    squares = slice(1 + rotors, 1 + 2 * rotors)
    lift, roll, pitch, yaw = (held.weights[row, 0, squares] for row in (5, 0, 1, 2))
    gives = np.array([lift, roll, pitch, -yaw]) / lift.mean()
    # Levers in their own sizes, so that the rank is no matter of units.
    sizes = np.abs(gives).max(axis=1)
    if rotors > _MOST_MOTORS or not sizes.all() or np.linalg.matrix_rank(gives / sizes[:, None], tol=_LEAST) < 4:
        raise InputError(
            f"Betaflight mixes lift, roll, pitch and yaw to at most {_MOST_MOTORS} motors, and the {rotors} rotors of "
            "this vehicle cannot give each of the four alone; check their places and spins"
        )
    mixer = np.linalg.pinv(gives / sizes[:, None]) / sizes
    for own in ([0], [1, 2], [3]):
        mixer[:, own] /= np.abs(mixer[:, own]).max()
    if not (mixer[:, 0] > _LEAST).all():
        idle = int(np.argmin(mixer[:, 0])) + 1
        raise InputError(
            f"level flight needs no lift of rotor {idle}, and a throttle of 0 ends Betaflight's list of motors; check "
            "the centre of mass and the places of the rotors"
        )
    return np.asarray(mixer)
