"""Numbers of the vehicle that a command needs: of the config, of a vehicle that was found, or guesses asked for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from cpfls_cli.artifacts.job import Job, require_numbers
from cpfls_cli.artifacts.model import ModelRecord
from cpfls_cli.artifacts.store import holds, read_record
from cpfls_cli.artifacts.vehicle_model import VehicleRecord
from cpfls_cli.errors import InputError
from cpfls_cli.flights.models import is_vehicle, with_found_numbers
from cpfls_cli.pages.model import cautions_of
from cpfls_cli.words import joined


def with_numbers(job: Job, command: str, model: Path | None, *, whole: bool = False) -> Job:
    """Take what a config leaves open from a model of a whole vehicle, or from guesses that are asked for.

    What speaks against the model, or makes guesses of the numbers, goes with what the job writes.

    Parameters
    ----------
    whole : bool
        Whether the command needs none of the open numbers: its model has its own.

    Raises
    ------
    ConfigError
        If nobody says what the config leaves open.
    """
    given = None if model is None or is_vehicle(model) or not model.is_file() else model
    if given is not None and holds(given, ModelRecord):
        job.cautions.update(dict.fromkeys(cautions_of(read_record(given, ModelRecord), given.name)))
    if not whole and given is not None and job.study.vehicle.unknown and holds(given, VehicleRecord):
        return replace(job, study=with_found_numbers(job.study, given), open_numbers="found")
    require_numbers(job, command, whole=whole)
    return job


def with_numbers_of(job: Job, found: Path) -> Job:
    """Take what a config leaves open from a vehicle that was found, of a command that takes no model.

    Raises
    ------
    InputError
        If it is no vehicle that was found.
    """
    if not (found.is_file() and holds(found, VehicleRecord)):
        raise InputError(f"--model {found}: is no vehicle that `cpfls vehicle` found")
    job.cautions.update(dict.fromkeys(cautions_of(read_record(found, VehicleRecord), found.name)))
    unknown = joined(name.replace("_", " ") for name in job.study.vehicle.unknown)
    if unknown:
        job.cautions[f"{unknown}: null in the config, taken from {found.name}"] = None
    return replace(job, study=with_found_numbers(job.study, found), open_numbers="found")
