"""Effects of the catalogue with the values that a flight shall have, checked against what is possible."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Coefficient, Effect, Shape
from cpfls_cli.effects.registry import effect as find
from cpfls_cli.errors import SettingError
from cpfls_cli.vehicle.settings import VehicleSettings

MEASURING_POINT = ("reference_x", "reference_y", "reference_z")
"""Coefficients of parameter_error: the point whose motion is logged, relative to the centre of mass, body frame, m."""

_HIDING_SPEEDS = frozenset({"motor_lag", "command_delay", "battery_sag"})


@dataclass(frozen=True)
class FlownEffect:
    """An effect with a value for each of its coefficients and shapes.

    Attributes
    ----------
    effect : Effect
    values : mapping of str to float
        Coefficients, then shapes, in the units of the catalogue.
    """

    effect: Effect
    values: Mapping[str, float]

    @property
    def linear(self) -> Array:
        """Coefficients of the columns; 1 where everything is in the shape."""
        if self.effect.unit_coefficient:
            return np.ones(1)
        physical = np.array([self.values[coefficient.name] for coefficient in self.effect.coefficients])
        return physical if self.effect.linear is None else self.effect.linear(physical)

    @property
    def acting(self) -> Array:
        """The same with 0 for what acts on the log alone: the place where motion is measured."""
        measured = [coefficient.name in MEASURING_POINT for coefficient in self.effect.coefficients]
        return np.where(measured, 0.0, self.linear) if any(measured) else self.linear

    @property
    def shape(self) -> Mapping[str, float]:
        """Values of the shapes."""
        return {shape.name: self.values[shape.name] for shape in self.effect.shapes}


@dataclass(frozen=True)
class FlownEffects:
    """All effects of a flight."""

    flown: tuple[FlownEffect, ...] = ()

    def values(self, name: str) -> Mapping[str, float] | None:
        """Give the values of an effect, None where it is not flown.

        Returns
        -------
        mapping of str to float, or None
        """
        return next((one.values for one in self.flown if one.effect.name == name), None)

    @property
    def hides_rotor_speed(self) -> bool:
        """Whether the flight logs what the rotors are told instead of how fast they turn."""
        return any(one.effect.name in _HIDING_SPEEDS for one in self.flown)


def flown_effects(asked: Mapping[str, Sequence[float] | Mapping[str, float]], vehicle: VehicleSettings) -> FlownEffects:
    """Look up effects in the catalogue and check their values.

    Parameters
    ----------
    asked : mapping
        By name of the effect: values in the order of the catalogue, coefficients before shapes, or by their names;
        coefficients without a value are 0.
    vehicle : VehicleSettings

    Raises
    ------
    InputError
        If there is no such effect.
    SettingError
        If values are missing, too many or physically impossible, or effects do not go together.
    """
    chosen = FlownEffects(tuple(_flown(name, given, vehicle) for name, given in asked.items()))
    refuse_conflict(chosen)
    return chosen


def refuse_conflict(chosen: FlownEffects) -> None:
    """Refuse effects that do not go together.

    Raises
    ------
    SettingError
    """
    if chosen.hides_rotor_speed and chosen.values("channel_delay") is not None:
        raise SettingError(
            _key("channel_delay"),
            "shifts measured rotor speeds, which a flight with motor_lag, command_delay or battery_sag does not log",
        )


def _flown(name: str, given: Sequence[float] | Mapping[str, float], vehicle: VehicleSettings) -> FlownEffect:
    effect = find(name)
    if "rotor_radius" in effect.needs and any(rotor.radius_m is None for rotor in vehicle.rotors):
        raise SettingError(_key(name), "needs vehicle.rotors.radius_m of every rotor")
    values = _by_name(effect, given)
    for coefficient in effect.coefficients:
        _refuse_outside(effect, coefficient, values[coefficient.name], coefficient.bounds(vehicle))
    for shape in effect.shapes:
        _refuse_outside(effect, shape, values[shape.name], (shape.grid[0], shape.grid[-1]))
    return FlownEffect(effect, values)


def _by_name(effect: Effect, given: Sequence[float] | Mapping[str, float]) -> dict[str, float]:
    names = [entry.name for entry in _entries(effect)]
    if not isinstance(given, Mapping):
        if len(given) != len(names):
            raise SettingError(_key(effect.name), f"takes {_wanted(effect)}; {len(given)} given")
        return dict(zip(names, given, strict=True))
    unknown = [name for name in given if name not in names]
    unset = [shape.name for shape in effect.shapes if shape.name not in given]
    if unknown or unset:
        problem = f"has no {', '.join(unknown)}" if unknown else f"needs {', '.join(unset)}"
        raise SettingError(_key(effect.name), f"{problem}; takes {_wanted(effect)}")
    return {name: given.get(name, 0.0) for name in names}


def _entries(effect: Effect) -> list[Coefficient | Shape]:
    return [*effect.coefficients, *effect.shapes]


def _wanted(effect: Effect) -> str:
    entries = _entries(effect)
    if not entries:
        return "no values"
    listed = ", ".join(f"{entry.name} ({entry.unit})" for entry in entries)
    return f"{len(entries)} value{'s' if len(entries) > 1 else ''}: {listed}"


def _refuse_outside(effect: Effect, entry: Coefficient | Shape, value: float, bounds: tuple[float, float]) -> None:
    low, high = bounds
    # A bound that is printed with a few digits and typed back is inside.
    margin = 1e-3 * (high - low)
    if not low - margin <= value <= high + margin:
        unit = "" if entry.unit == "1" else f" {entry.unit}"
        message = f"{entry.name} = {value:g} is not possible on this vehicle: {low:.4g} to {high:.4g}{unit}"
        raise SettingError(_key(effect.name), f"{message} ({entry.meaning})")


def _key(name: str) -> str:
    return f"closed_loop.effects.{name}"
