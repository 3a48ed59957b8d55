"""A vehicle for Pegasus in Isaac Sim: numbers of its thrust curve and drag, and the mass for the USD file.

With rotor speeds w in rad/s and the velocity v in the axes of the body, rotor i pushes rotor_constant[i] w_i^2 at its
link, the body turns by sum rot_dir[i] rolling_moment_coefficient[i] w_i^2 about z and is held back by diag(drag) v;
speeds follow commands at once. What is called rolling moment there is the yaw torque of a rotor.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cpfls_cli.export.holding import FOUR, Held, Holds, constant_body, held_by, of_a_body, require_four
from cpfls_cli.export.numbers import numbers_of, places, spins
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.simulators.crazyflow import DRAG, with_drag
from cpfls_cli.export.source import fill_template
from cpfls_cli.export.text import comment_lines, comment_text, number, python_rows
from cpfls_cli.playback.model import VehicleModel


def pegasus_held(model: VehicleModel) -> tuple[Held, Holds]:
    """Take what Pegasus flies of a vehicle."""
    require_four(model, "Pegasus pushes at")
    numbers = numbers_of(model, lambda _see: {}, alike=False)
    holds = with_drag(numbers, model.vehicle, lambda drag: np.diag(np.diag(drag)))
    return held_by(model, holds, of_a_body(constant_body(model)), numbers), holds


def pegasus_text(sheet: Sheet, held: Held, remarks: Sequence[str], file: str) -> str:
    """Write a vehicle as a module with the numbers of Pegasus, with what it does not hold."""
    found, vehicle = held.numbers, sheet.model.vehicle

    def of_rotors(name: str) -> str:
        return python_rows(np.array([found[f"{name}_{rotor + 1}"] for rotor in range(FOUR)]), 0)

    moments, axes = np.linalg.eigh(held.body.inertia)
    axes = axes * np.sign(np.linalg.det(axes))
    curve = {
        "num_rotors": str(FOUR),
        "rotor_constant": of_rotors("thrust"),
        "rolling_moment_coefficient": of_rotors("yaw"),
        "rot_dir": str([int(each) for each in spins(vehicle)]),
        "min_rotor_velocity": python_rows(np.zeros(FOUR), 0),
        "max_rotor_velocity": python_rows(np.full(FOUR, vehicle.rotor_speed_max_rad_s), 0),
    }
    words = {
        "source": comment_text(file),
        "facts": comment_lines(sheet.said(remarks)),
        "curve": curve,
        "drag": python_rows(-np.diag(held.weights[DRAG]), 0),
        "mass": number(held.body.mass),
        "moments": python_rows(moments, 0),
        "axes": python_rows(axes, 0),
        "positions": python_rows(places(sheet.model, alike=False), 0),
    }
    return fill_template("pegasus.py.j2", words)
