"""Models that are given to a command: which model a file is, read, of the vehicle of the config."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from cpfls_cli import store
from cpfls_cli.artifacts.diagnosis import Extended
from cpfls_cli.artifacts.gate import format_name, read_origin
from cpfls_cli.artifacts.identified import IdentifiedModel, require_whole
from cpfls_cli.artifacts.model import AnyModel, LearnedFlight
from cpfls_cli.artifacts.vehicle_model import Vehicle
from cpfls_cli.config.study import Study
from cpfls_cli.effects.registry import effect
from cpfls_cli.errors import InputError, SettingError, about
from cpfls_cli.flights.same_vehicle import require_vehicle_of, with_numbers_of
from cpfls_cli.playback.model import VehicleModel, commanded_anew
from cpfls_cli.playback.player import Observer
from cpfls_cli.playback.settings import VEHICLE


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


def read_anew(path: Path, study: Study) -> VehicleModel:
    """Read a model of the vehicle of a study for commands that are not those of a log."""
    return commanded_anew(read_model(path, study))


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
    if (held := format_name(path)) not in (None, IdentifiedModel.FORMAT):
        raise InputError(f"{path}: is a {held}; this command needs a model made by `cpfls identify` or `cpfls vehicle`")
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
