"""The catalogue: every effect that has a module in it."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType

from cpfls_cli.effects import catalogue
from cpfls_cli.effects.effect import Effect
from cpfls_cli.errors import InputError

_ORDER = (
    "linear_damping",
    "quadratic_damping",
    "rotor_plane_damping",
    "rotor_drag",
    "flapping_moment",
    "rolling_moment",
    "inflow",
    "translational_lift",
    "parasitic_drag",
    "ground_effect",
    "vertical_descent",
    "wind",
    "rotor_gyroscopic",
    "rotor_acceleration",
    "motor_lag",
    "command_delay",
    "battery_sag",
    "com_offset",
    "products_of_inertia",
    "rotor_mismatch",
    "torque_bias",
    "payload",
    "euler_axis_torque",
    "gyro_bias",
    "gyro_scale",
    "imu_misalignment",
    "channel_delay",
    "parameter_error",
)


def _place(name: str) -> tuple[int, str]:
    """Sort by the usual order, and what is not in it last, by name."""
    return (_ORDER.index(name) if name in _ORDER else len(_ORDER), name)


def _discover() -> Mapping[str, Effect]:
    names = sorted((module.name for module in iter_modules(catalogue.__path__)), key=_place)
    return MappingProxyType({name: import_module(f"{catalogue.__name__}.{name}").EFFECT for name in names})


CATALOGUE: Mapping[str, Effect] = _discover()
"""Effects by identifier."""


def effect(name: str) -> Effect:
    """Find an effect by its identifier.

    Raises
    ------
    InputError
        If there is none of that name; the message gives the nearest ones.
    """
    if name in CATALOGUE:
        return CATALOGUE[name]
    near = get_close_matches(name, CATALOGUE, n=3, cutoff=0.5)
    hint = f"did you mean {' or '.join(near)}?" if near else "`cpfls effects` lists all"
    raise InputError(f"{name}: no such effect ({hint})")
