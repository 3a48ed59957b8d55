"""Models that are given to a command: read, of the vehicle of the config, and rebuilt."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from cpfls_cli.artifacts.extended import ExtendedRecord
from cpfls_cli.artifacts.identified import IdentifiedRecord
from cpfls_cli.artifacts.learned import LearnedFlight
from cpfls_cli.artifacts.model import ModelRecord
from cpfls_cli.artifacts.rebuilt import observer, vehicle_model
from cpfls_cli.artifacts.store import holds, read_record
from cpfls_cli.artifacts.vehicle_model import VehicleRecord
from cpfls_cli.config.study import Study
from cpfls_cli.errors import InputError, about
from cpfls_cli.flights.same_vehicle import read_of_vehicle, with_numbers_of
from cpfls_cli.playback.history import Observer
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.settings import VEHICLE


def read_model(path: Path, study: Study, *, forecast: bool = False) -> VehicleModel:
    """Read any model of the vehicle of a study, or take the vehicle itself for the word `VEHICLE`.

    To forecast along logged rotor speeds, a model for that is taken where the file holds one beside the vehicle.
    """
    if is_vehicle(path):
        return VehicleModel(vehicle=study.vehicle)
    record = read_of_vehicle(path, ModelRecord, study)
    apart = record.forecast if forecast and isinstance(record, VehicleRecord) else None
    return rebuilt(path, record if apart is None else replace(record, vehicle=apart))


def with_found_numbers(study: Study, path: Path) -> Study:
    """Put the numbers of a vehicle that was found in the place of those that a config leaves open.

    They stay among its unknown ones: a flight of the config is one of this vehicle, whatever stands for them.
    """
    found = read_of_vehicle(path, VehicleRecord, study).vehicle.vehicle()
    return study.model_copy(update={"vehicle": with_numbers_of(study.vehicle, found)})


def read_observer(path: Path, past_s: float) -> Observer:
    """Read the observer by which the forecast of a model uses so much of the flight before a start."""
    known = not is_vehicle(path) and holds(path, VehicleRecord)
    held = read_record(path, VehicleRecord).history if known else None
    if held is None:
        raise InputError(
            f"{path}: holds no forecast that uses the past, which --history asks for; `cpfls vehicle` finds one if "
            "playback.history_s is above 0 and the past helps on held-out parts of the flights; or leave out "
            "--history"
        )
    return observer(held, past_s)


def read_fading(path: Path) -> float | None:
    """Read how fast body rates fade in the flights that a model was found in, s; None where its file does not know."""
    record = None if is_vehicle(path) else read_record(path, ModelRecord)
    if isinstance(record, ExtendedRecord):
        return None if record.playback is None else record.playback.fading_s
    return record.fading_s if isinstance(record, VehicleRecord) else None


def holds_forecast(path: Path) -> bool:
    """Tell whether a model holds a forecast along logged rotor speeds beside the vehicle."""
    known = not is_vehicle(path) and holds(path, VehicleRecord)
    return known and read_record(path, VehicleRecord).forecast is not None


def learned_by(path: Path | None) -> tuple[LearnedFlight, ...]:
    """List the flights that a model learned from: none by the vehicle of the config."""
    return () if path is None or is_vehicle(path) else read_record(path, ModelRecord).learned_from


def read_base(path: Path | None, study: Study) -> VehicleModel:
    """Read what effects are sought for: a vehicle that was found, an identified model, or else the rigid body."""
    rigid = VehicleModel(vehicle=study.vehicle)
    if path is None:
        return rigid
    if holds(path, VehicleRecord):
        return read_model(path, study)
    return replace(rigid, fuzzy=rebuilt(path, read_of_vehicle(path, IdentifiedRecord, study)).fuzzy)


def rebuilt(path: Path, record: ModelRecord) -> VehicleModel:
    """Rebuild the model of a record; the path is for messages."""
    with about(path, InputError):
        return vehicle_model(record.vehicle)


def is_vehicle(path: Path) -> bool:
    """Tell whether the vehicle of the config is meant; a file of that name has to be given with its folder."""
    return str(path) == VEHICLE
