"""Models that are given to a command: which model a file is, read, of the vehicle of the config."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TypeVar

from cpfls_cli import store
from cpfls_cli.artifacts.diagnosis import Extended
from cpfls_cli.artifacts.gate import Origin, format_name, read_origin
from cpfls_cli.artifacts.identified import IdentifiedModel, require_whole
from cpfls_cli.artifacts.model import AnyModel, LearnedFlight
from cpfls_cli.artifacts.vehicle_model import Vehicle
from cpfls_cli.config.load import stored_study
from cpfls_cli.config.study import Study
from cpfls_cli.config.unknown import KEYS
from cpfls_cli.effects.registry import effect
from cpfls_cli.errors import ConfigError, InputError, SettingError, about
from cpfls_cli.playback.history import Observer
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.settings import VEHICLE
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


def identified_in(path: Path) -> IdentifiedModel:
    """Read an identified model."""
    try:
        made = store.read(path, IdentifiedModel)[0]
    except SettingError as error:
        raise InputError(f"{path}: model/fuzzy/structure: {error}") from None
    require_whole(path, made.functions)
    return made


_READ: Mapping[str, Callable[[Path], AnyModel]] = {
    Extended.FORMAT: lambda path: store.read(path, Extended)[0],
    Vehicle.FORMAT: lambda path: store.read(path, Vehicle)[0],
    IdentifiedModel.FORMAT: identified_in,
}
"""What reads a model, by the format of its file."""
MAKERS = "`cpfls identify`, `cpfls extend`, `cpfls gap` or `cpfls vehicle`"


def is_model(path: Path) -> bool:
    """Tell whether a file is a model, whoever found it."""
    return path.is_file() and format_name(path) in _READ


def is_found(path: Path) -> bool:
    """Tell whether a file is a vehicle that was found in flights."""
    return path.is_file() and format_name(path) == Vehicle.FORMAT


def is_identified(path: Path) -> bool:
    """Tell whether a file is an identified model."""
    return path.is_file() and format_name(path) == IdentifiedModel.FORMAT


def any_model(path: Path) -> AnyModel:
    """Read which model a file is: identified, extended, or a vehicle that was found."""
    held = format_name(path)
    if held is None:
        # Says why it is no file of a stage.
        read_origin(path)
    elif held in _READ:
        return _READ[held](path)
    raise InputError(f"{path}: is a {held}; this command needs a model (made by {MAKERS})")


def model_of_vehicle(path: Path, study: Study) -> AnyModel:
    """Read a model of the vehicle of a study."""
    record = any_model(path)
    require_vehicle_of(path, study)
    return record


def found_vehicle(path: Path) -> Vehicle:
    """Read a vehicle that was found in flights."""
    return store.read(path, Vehicle)[0]


def read_model(path: Path, study: Study, *, forecast: bool = False) -> VehicleModel:
    """Read any model of the vehicle of a study, or take the vehicle itself for the word `VEHICLE`.

    To forecast along logged rotor speeds, a model for that is taken where the file holds one apart from the vehicle.
    """
    if is_vehicle(path):
        return VehicleModel(vehicle=study.vehicle)
    record = model_of_vehicle(path, study)
    apart = record.forecast if forecast and isinstance(record, Vehicle) else None
    return apart or modelled(path, record)


def with_found_numbers(study: Study, path: Path) -> Study:
    """Put the numbers of a vehicle that was found in the place of those that a config leaves open.

    They stay among its unknown ones: a flight of the config is one of this vehicle, whatever stands for them.
    """
    found = model_of_vehicle(path, study).model.vehicle
    return study.model_copy(update={"vehicle": with_numbers_of(study.vehicle, found)})


def read_observer(path: Path, past_s: float) -> Observer:
    """Read the observer by which the forecast of a model uses so much of the flight before a start."""
    held = found_vehicle(path).history if is_found(path) else None
    if held is None:
        raise InputError(
            f"{path}: holds no forecast that uses the past, which --history asks for; `cpfls vehicle` finds one if "
            "playback.history_s is above 0 and the past helps on held-out parts of the flights; or leave out "
            "--history"
        )
    return replace(held, past_s=past_s)


def read_fading(path: Path) -> float | None:
    """Read how fast body rates fade in the flights that a model was found in, s; None where its file does not know."""
    record = None if is_vehicle(path) else any_model(path)
    if isinstance(record, Extended):
        return None if record.playback is None else record.playback.fading_s
    return record.fading_s if isinstance(record, Vehicle) else None


def holds_forecast(path: Path) -> bool:
    """Tell whether a model holds a forecast along logged rotor speeds apart from the vehicle."""
    return is_found(path) and found_vehicle(path).forecast is not None


def learned_by(path: Path | None) -> tuple[LearnedFlight, ...]:
    """List the flights that a model learned from: none by the vehicle of the config."""
    return () if path is None or is_vehicle(path) else any_model(path).learned_from


def read_base(path: Path | None, study: Study) -> VehicleModel:
    """Read what effects are sought for: a vehicle that was found, an identified model, or else the rigid body."""
    rigid = VehicleModel(vehicle=study.vehicle)
    if path is None:
        return rigid
    if is_found(path):
        return read_model(path, study)
    record = identified_in(path)
    require_vehicle_of(path, study)
    return replace(rigid, fuzzy=record.functions)


def modelled(path: Path, record: AnyModel) -> VehicleModel:
    """Take the model out of what a file holds; the path is for messages."""
    with about(path, InputError):
        for each in record.model.effects:
            effect(each.name)
        return record.model


def is_vehicle(path: Path) -> bool:
    """Tell whether the vehicle of the config is meant; a file of that name has to be given with its folder."""
    return str(path) == VEHICLE
