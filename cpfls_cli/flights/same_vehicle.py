"""Files of one vehicle: read those of it, and list the keys in which others differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TypeVar

from cpfls_cli.artifacts.gate import Origin, read_origin
from cpfls_cli.config.load import stored_study
from cpfls_cli.config.study import Study
from cpfls_cli.config.unknown import KEYS
from cpfls_cli.errors import ConfigError, InputError
from cpfls_cli.store import read
from cpfls_cli.vehicle.settings import VehicleSettings

T = TypeVar("T")


def require_same_vehicle(path: Path, given: VehicleSettings, wanted: VehicleSettings) -> None:
    """Refuse a file that was made with another vehicle than that of the config."""
    # What the config left open is open still, whatever stands for it now.
    different = _different(_with_what_was_open(given, wanted) if given.unknown == wanted.unknown else given, wanted)
    if different:
        raise InputError(
            f"{path}: was made with another vehicle; these differ: {different}; use the config of that vehicle, or "
            "make the file again"
        )


def read_result_of_vehicle(path: Path, wanted: type[T], study: Study) -> tuple[T, Origin]:
    """Read a result that must have been made with the vehicle of the config, and where it comes from."""
    given, origin = read(path, wanted)
    require_vehicle_of(path, study)
    return given, origin


def require_vehicle_of(path: Path, study: Study) -> None:
    """Refuse a file that was not made with the vehicle of the config."""
    made_with = _with_what_was_open(_vehicle_of(path, read_origin(path)), study.vehicle)
    require_same_vehicle(path, made_with, study.vehicle)


def _with_what_was_open(given: VehicleSettings, wanted: VehicleSettings) -> VehicleSettings:
    """Take from the config what the one of a model left open: the model has numbers of its own."""
    return replace(with_numbers_of(given, wanted), unknown=wanted.unknown)


def with_numbers_of(vehicle: VehicleSettings, other: VehicleSettings) -> VehicleSettings:
    """Put the numbers of another vehicle in the place of those that one leaves open, as far as both have the rotors."""
    rotors = vehicle.rotors
    if len(rotors) == len(other.rotors):
        keys = [KEYS[name] for name in vehicle.unknown if name != "inertia"]
        pairs = zip(rotors, other.rotors, strict=True)
        rotors = tuple(replace(own, **{key: getattr(found, key) for key in keys}) for own, found in pairs)
    inertia = other.inertia_kg_m2 if "inertia" in vehicle.unknown else vehicle.inertia_kg_m2
    return replace(vehicle, rotors=rotors, inertia_kg_m2=inertia)


def other_vehicles(paths: Sequence[Path], study: Study) -> tuple[str, ...]:
    """Say which flights were made with another vehicle, a sentence each; configs that are not read are passed over."""
    differences = [(path, _difference_of(path, study)) for path in dict.fromkeys(paths)]
    return tuple(
        f"{path.name}: was made with another vehicle; these differ: {different}; what it says applies to that vehicle"
        for path, different in differences
        if different
    )


def model_of_another(path: Path, study: Study) -> tuple[str, ...]:
    """Say of a model that it is one of another vehicle than that of the config, in a sentence or none."""
    different = _difference_of(path, study)
    return (f"{path.name}: models a vehicle other than the config's; these differ: {different}",) if different else ()


def _difference_of(path: Path, study: Study) -> str:
    try:
        return _different(_vehicle_of(path, read_origin(path)), study.vehicle)
    except ConfigError:
        return ""


def _vehicle_of(path: Path, header: Origin) -> VehicleSettings:
    return stored_study(header.config, path).vehicle


def _different(given: VehicleSettings, wanted: VehicleSettings) -> str:
    """Name the keys that differ, the first with its values; empty where none does."""
    different = [f.name for f in fields(given) if getattr(given, f.name) != getattr(wanted, f.name)]
    if not different:
        return ""
    first = different[0]
    values = "" if first == "rotors" else f" ({getattr(given, first)} there, {getattr(wanted, first)} in the config)"
    return ", ".join([f"vehicle.{first}{values}", *(f"vehicle.{name}" for name in different[1:])])
