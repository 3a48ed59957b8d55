"""Numbers of a vehicle that a config leaves open: null there, a guess in the study, and a refusal where they count."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.config.study import Study
from cpfls_cli.errors import ConfigError
from cpfls_cli.vehicle.settings import Unknown, VehicleSettings

KEYS: Final[dict[Unknown, str]] = {
    "thrust_factor": "thrust_factor_n_s2",
    "drag_factor": "drag_factor_n_m_s2",
    "inertia": "inertia_kg_m2",
}
"""Keys of the numbers that may be null."""

_GYRATION = (0.5, 0.5, 0.7)
"""Radii of gyration in arms: of published quadrotors from 30 g to 6 kg, those about roll are 0.45 to 1."""

_DRAG_LEVER = 0.1
"""Drag factor over thrust factor in arms; it is a tenth to a fifth of a propeller's radius."""

_HOVER = 0.55
"""Rotor speed in hover, share of the largest: a vehicle lifts about three times its weight."""

_OFF: Final[dict[Unknown, str]] = {"thrust_factor": "0.35 to 2", "drag_factor": "0.2 to 3", "inertia": "0.8 to 4"}
"""How many times a guess real vehicles have: by the ranges above, and hover at 0.4 to 0.9 of the largest speed."""

_TAKEN = frozenset({"import", "config", "vehicle", "report", "export", "predict", "trajectory", "changed", "trend"})
_GUESSED: Final = "guesses from mass and arms are used for what the config leaves open (--accept-guesses)"

_OF_MODELS = frozenset({"replay", "response", "compare", "simulate", "gap", "extend", "tune"})
_TAKEN |= _OF_MODELS
"""Commands, and `Model.predict`, that work with guesses; a report and an export are of a model with its own numbers.

`changed` and `trend` compare flights of one vehicle, in which its numbers cancel. Those of models do with those of a
whole vehicle, and ask `require_known` where theirs is another; `trajectory` where torque or effects choose
the path. Else guesses only serve to check what it asks of the rotors.
"""


def with_guesses(data: dict[str, Any]) -> dict[str, Any]:
    """Put guesses in the place of what the section `vehicle` leaves null, and name them under its key `unknown`.

    What is wrong in data that are not validated yet stays, for the validation to say.
    """
    vehicle = data.get("vehicle")
    if not isinstance(vehicle, dict):
        return data
    rotors = vehicle.get("rotors")
    listed = [rotor for rotor in rotors if isinstance(rotor, dict)] if isinstance(rotors, list) else []
    open_ = [
        name
        for name, key in KEYS.items()
        for given in [[holder[key] for holder in (vehicle, *listed) if key in holder]]
        if any(each is None or (isinstance(each, list) and None in each) for each in given)
    ]
    if not open_:
        return data
    try:
        guesses = _guesses(vehicle, listed)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError, IndexError):
        return data
    filled = {**vehicle, "unknown": sorted({*(vehicle.get("unknown") or ()), *open_})}
    if "inertia" in open_:
        given = vehicle[KEYS["inertia"]] or [None, None, None]
        guessed = [*guesses["inertia"], 0.0, 0.0, 0.0]
        filled[KEYS["inertia"]] = [
            guess if value is None else value for value, guess in zip(given, guessed, strict=False)
        ]
    if isinstance(rotors, list):
        filled["rotors"] = [_filled(rotor, guesses) if isinstance(rotor, dict) else rotor for rotor in rotors]
    return {**data, "vehicle": filled}


def _filled(rotor: dict[str, Any], guesses: dict[Unknown, Any]) -> dict[str, Any]:
    given: dict[Unknown, str] = {name: key for name, key in KEYS.items() if key in rotor and rotor[key] is None}
    return {**rotor, **{key: guesses[name] for name, key in given.items()}}


def _guesses(vehicle: dict[str, Any], rotors: list[dict[str, Any]]) -> dict[Unknown, Any]:
    usual = VehicleSettings()
    mass = float(vehicle.get("mass_kg", usual.mass_kg))
    gravity = float(vehicle.get("gravity_m_s2", usual.gravity_m_s2))
    positions = [rotor["position_m"] for rotor in rotors] if rotors else [rotor.position_m for rotor in usual.rotors]
    fastest = float(vehicle.get("rotor_speed_max_rad_s", usual.rotor_speed_max_rad_s))
    stated = [rotor.get(KEYS["thrust_factor"]) for rotor in rotors]
    thrust = next((float(value) for value in stated if value is not None), None)
    # By the speed at which such vehicles hover.
    thrust = thrust or mass * gravity / (len(positions) * (_HOVER * fastest) ** 2)
    return {
        "thrust_factor": thrust,
        "drag_factor": _drag_factor(thrust, positions),
        "inertia": list(_inertia(mass, positions)),
    }


def is_of_guesses(caution: str) -> bool:
    """Tell whether a caution, as `require_known` gives it, says that guesses were taken."""
    return caution.startswith(_GUESSED)


def needs_numbers(vehicle: VehicleSettings, command: str) -> bool:
    """Tell whether a command would take for facts what a config leaves open, of a vehicle without a model."""
    return bool(vehicle.unknown) and command not in _TAKEN - _OF_MODELS


def require_known(study: Study, command: str, *, whole: bool = True, accept: bool = False) -> tuple[str, ...]:
    """Refuse a vehicle with unknown numbers for a command that would take their guesses for facts.

    `whole` is False for a command whose model, known by now, is none of a whole vehicle with numbers of its own. With
    `accept` the guesses are taken, and what is given says how far what follows hangs on them.
    """
    unknown = study.vehicle.unknown
    torque = study.import_.torque_source
    of_rotors = command == "import" and torque in ("rotor-speed", "rotor-command")
    if not unknown or (command in _TAKEN and whole and not of_rotors):
        return ()
    if accept:
        off = ", ".join(f"{name.replace('_', ' ')} {_OFF[name]}" for name in unknown)
        return (
            f"{_GUESSED}; as multiples of these guesses, real vehicles have {off}; the resulting torques, rates and "
            "gains are off by as much",
        )
    keys = ", ".join(f"vehicle.{'' if name == 'inertia' else 'rotors.'}{KEYS[name]}" for name in unknown)
    ways = "--model VEHICLE.h5 takes the numbers that `cpfls vehicle` found, --accept-guesses those from mass and arms"
    if of_rotors:
        raise ConfigError(
            f"import.torque_source = {torque}: needs {keys}, not known in this config; set it to null: `cpfls vehicle` "
            f"needs no torque; {ways}"
        )
    raise ConfigError(f"{keys}: not known in this config, but `cpfls {command}` needs what is null there; {ways}")


def _inertia(mass: float, positions: Sequence[Sequence[float]]) -> tuple[float, float, float]:
    """Guess moments of inertia, kg m^2, of a mass in kg and hubs at these positions in m."""
    x, y, z = (mass * (share * _arm(positions)) ** 2 for share in _GYRATION)
    return x, y, z


def _drag_factor(thrust_factor: float, positions: Sequence[Sequence[float]]) -> float:
    """Guess the drag factor, N m s^2, from the thrust factor, N s^2, and the positions of the hubs, m."""
    return _DRAG_LEVER * _arm(positions) * thrust_factor


def _arm(positions: Sequence[Sequence[float]]) -> float:
    hubs: Array = np.array(positions, dtype=float)
    return float(np.hypot(hubs[:, 0], hubs[:, 1]).max())
