"""Numbers of a vehicle that no vehicle has: stated so, or asked for by a log that is wrong."""

from collections.abc import Mapping

import numpy as np

from cpfls_cli.consistency.findings import Finding
from cpfls_cli.effects.catalogue.parameter_error import NUMBERS
from cpfls_cli.inertia import INERTIA_PARAMETERS, beyond_any_body
from cpfls_cli.vehicle.settings import VehicleSettings

_TOO_WIDE = 5.0
"""A frame may be wider than its rotors, and a paper may round; a slipped digit or g cm^2 is more than that."""

_INERTIAS = ("inertia_x", "inertia_y", "inertia_z")
_REVERSED = 0.005  # Ratio below which a torque has the wrong sign, or belongs to another axis.
_ALIKE = 0.3  # Largest logarithm of a ratio of two numbers that one mistake makes wrong.


def beyond_belief(vehicle: VehicleSettings) -> tuple[Finding, ...]:
    """Say which stated moments of inertia are those of no body so light between such rotors; nothing of guesses."""
    if "inertia" in vehicle.unknown:
        return ()
    stated = dict(zip((f"inertia.{name}" for name in INERTIA_PARAMETERS[:3]), vehicle.inertia_kg_m2, strict=False))
    hubs = np.array([rotor.position_m for rotor in vehicle.rotors])
    limits = beyond_any_body(vehicle.mass_kg * _TOO_WIDE, hubs, stated)
    return tuple(
        Finding(
            f"vehicle.inertia_kg_m2: {name.removeprefix('inertia.')} is {stated[name]:.3g} kg m^2, and a body of "
            f"{vehicle.mass_kg:.3g} kg between these rotors barely reaches {limit / _TOO_WIDE:.2g}",
            "check it, vehicle.mass_kg and position_m of vehicle.rotors",
            ("vehicle",),
            stated[name] * _TOO_WIDE / limit,
            # The motion identifies it: a fit finds another.
            contradiction=False,
        )
        for name, limit in limits.items()
        # Rotors that replace others, all in one place, have no size.
        if limit > 0
    )


def impossible(off: Mapping[str, float]) -> tuple[Finding, ...]:
    """Say of numbers of the vehicle that a fit asks for and no vehicle has what makes them so: the log is wrong.

    `off`: their ratios to the config.
    """
    return tuple(
        Finding(
            f"{NUMBERS[name]} would have to be {ratio:.3g} times that of the config, which no vehicle has",
            _suspect(off),
            ("rotors", "gyroscope", "vehicle"),
            ratio,
        )
        for name, ratio in off.items()
    )


def _suspect(off: Mapping[str, float]) -> str:
    """Say what makes just these numbers impossible: a torque or inertia that is wrong changes one ratio, a unit all."""
    thrust, inertias = off.get("thrust_scale"), [off[name] for name in _INERTIAS if name in off]
    if min(off.values()) < _REVERSED:
        if off.keys() == {"inertia_z"}:
            return "x and y fit, so check spin of vehicle.rotors, the order of the rotors' columns and the sign of yaw"
        if off.keys() == {"thrust_scale"}:
            return "check the sign and frame of the acceleration, and thrust_factor_n_s2 of vehicle.rotors"
        return "check the signs and order of the gyroscope's and the rotors' columns"
    if thrust is not None and off.keys() == {"thrust_scale", "inertia_z"} and _alike(thrust * off["inertia_z"], 1.0):
        return f"the rotor speeds look {_times(1 / np.sqrt(thrust))}: check the unit of their columns (rpm for rad/s?)"
    if off.keys() == {"thrust_scale"} and thrust is not None:
        return f"thrust_factor_n_s2 of vehicle.rotors looks {_times(1 / thrust)}, or mass_kg {_times(thrust)}"
    if off.keys() == {"inertia_z"}:
        ratio = off["inertia_z"]
        return (
            f"x and y fit, and about z only drag factor over inertia shows, so drag_factor_n_m_s2 of vehicle.rotors "
            f"looks {_times(ratio)}, or inertia_kg_m2 about z {_times(1 / ratio)}"
        )
    if off.keys() == set(_INERTIAS) and all(_alike(each, inertias[0]) for each in inertias):
        return f"all axes alike, so the gyroscope looks {_times(1 / inertias[0])}: check its unit (deg/s for rad/s?)"
    if off.keys() <= {"inertia_x", "inertia_y"}:
        return "z fits, so suspect inertia_kg_m2 about this axis and position_m of vehicle.rotors"
    return "check the signs, units and order of the gyroscope's and the rotors' columns"


def _alike(one: float, other: float) -> bool:
    return bool(abs(np.log(one / other)) < _ALIKE)


def _times(ratio: float) -> str:
    return f"{ratio:.3g} times too large" if ratio > 1 else f"{1 / ratio:.3g} times too small"
