"""A vehicle for RotorPy: the dictionary of numbers that its `Multirotor` takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from cpfls_cli.export.holding import Held, Holds, constant_body, held_by, require_four
from cpfls_cli.export.numbers import numbers_of, places, spins
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.source import fill_template
from cpfls_cli.export.text import comment_lines, comment_text, number, python_rows
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.vehicle.motion import Instant, Wrench
from cpfls_cli.vehicle.values import dot

_GRAVITY = 9.81
"""RotorPy's `Multirotor` has it in its code."""
_FASTEST_S = 1e-3
"""RotorPy divides by the time constant of its motors."""


def rotorpy_held(model: VehicleModel) -> tuple[Held, Holds]:
    """Take what RotorPy flies of a vehicle."""
    require_four(model, "RotorPy allocates thrust and torque to")
    numbers = numbers_of(model, _wrenches, alike=True)
    body = constant_body(model)._replace(gravity=_GRAVITY)
    return held_by(model, numbers.holds, body, numbers, lags=True), numbers.holds


def _wrenches(see: Instant) -> Mapping[str, Wrench]:
    """Write RotorPy's `compute_body_wrench` for a unit of each of its numbers."""
    (u, v, w), (x, y, z), speed, total = see.air_velocity, see.hub_velocity, see.rotor_speed, see.functions.total
    fast = -see.functions.sqrt(dot(see.air_velocity, see.air_velocity))
    return {
        "c_Dx": Wrench(force=(fast * u, 0, 0)),
        "c_Dy": Wrench(force=(0, fast * v, 0)),
        "c_Dz": Wrench(force=(0, 0, fast * w)),
        "k_d": Wrench(at_hubs=(-speed * x, -speed * y, 0)),
        "k_z": Wrench(at_hubs=(0, 0, -speed * z)),
        "k_h": Wrench(at_hubs=(0, 0, x**2 + y**2)),
        "k_flap": Wrench((-total(speed * y), total(speed * x), 0)),
    }


def rotorpy_text(sheet: Sheet, held: Held, remarks: Sequence[str], file: str) -> str:
    """Write a vehicle as a module with RotorPy's dictionary, with what it does not hold."""
    model = sheet.model
    found = held.numbers
    given = {
        "mass": held.body.mass,
        **{f"I{'xyz'[i]}{'xyz'[j]}": held.body.inertia[i, j] for i in range(3) for j in range(i, 3)},
        **{name: value for name, value in found.items() if name.startswith(("c_", "k_"))},
        "k_eta": found["thrust"],
        "k_m": found["yaw"],
        "tau_m": held.response.lag_s or _FASTEST_S,
        "rotor_speed_min": 0.0,
        "rotor_speed_max": model.vehicle.rotor_speed_max_rad_s,
    }
    words = {
        "source": comment_text(file),
        "facts": comment_lines(sheet.said(remarks)),
        "lags": held.response.lag_s > 0.0,
        "numbers": {name: number(value) for name, value in given.items()},
        "positions": [python_rows(place, 0) for place in places(model, alike=True)],
        "directions": python_rows(spins(model.vehicle), 0),
    }
    return fill_template("rotorpy.py.j2", words)
