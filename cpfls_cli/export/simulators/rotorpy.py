"""A vehicle for RotorPy: the dictionary of numbers that its `Multirotor` takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import hub_wrench, thrust_wrench, wrench
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.export.holding import Held, Holds, constant_body, held_by
from cpfls_cli.export.numbers import numbers_of, places, spins
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.source import fill_template
from cpfls_cli.export.text import comment_lines, comment_text, number, python_rows
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.rotors import RotorResponse

# What RotorPy's `Multirotor` allocates to, and has in its code.
_ROTORS, _GRAVITY = 4, 9.81
_FASTEST_S = 1e-3
"""RotorPy divides by the time constant of its motors."""

# So exact that what its step leaves is below what it is compared by.


def rotorpy_held(model: VehicleModel) -> tuple[Held, Holds]:
    """Take what RotorPy flies of a vehicle."""
    if model.rotors != _ROTORS:
        raise InputError(
            f"RotorPy allocates thrust and torque to four rotors, but this vehicle has {model.rotors}; --format mjcf, "
            "sdf, jax and casadi take any number"
        )
    numbers = numbers_of(model, _wrenches, alike=True)
    body = constant_body(model)._replace(gravity=_GRAVITY)
    return held_by(model, numbers.holds, RotorResponse(lag_s=model.response.lag_s), body, numbers), numbers.holds


def _wrenches(signals: Signals) -> Mapping[str, Array]:
    """Write RotorPy's `compute_body_wrench` for a unit of each of its numbers."""
    air, local, speed = signals.air_velocity, signals.hub_velocity, signals.speed[..., None]
    drag = -np.linalg.norm(air, axis=1, keepdims=True) * air
    x, y, _ = np.moveaxis((speed * local).sum(axis=1), 1, 0)
    of_axis = {f"c_D{axis}": wrench(force=drag * np.eye(3)[k]) for k, axis in enumerate("xyz")}
    return of_axis | {
        "k_d": hub_wrench(signals.hubs, -speed * local * [1.0, 1.0, 0.0]),
        "k_z": hub_wrench(signals.hubs, -speed * local * [0.0, 0.0, 1.0]),
        "k_h": thrust_wrench(signals.hubs, (local[..., :2] ** 2).sum(axis=-1)),
        "k_flap": wrench(-np.column_stack([y, -x, np.zeros_like(x)])),
    }


def rotorpy_text(sheet: Sheet, held: Held, told: Sequence[str], file: str) -> str:
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
        "facts": comment_lines([*sheet.facts, "", *told]),
        "lags": held.response.lag_s > 0.0,
        "numbers": {name: number(value) for name, value in given.items()},
        "positions": [python_rows(place, 0) for place in places(model, alike=True)],
        "directions": python_rows(spins(model.vehicle), 0),
    }
    return fill_template("rotorpy.py.j2", words)
