"""Numbers of the vehicle that a command needs: of the config, of a vehicle that was found, or guesses asked for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from cpfls_cli.artifacts.gate import read_origin
from cpfls_cli.artifacts.job import Job, require_numbers
from cpfls_cli.artifacts.vehicle_model import Vehicle, too_heavy
from cpfls_cli.config.check import why_no_body
from cpfls_cli.errors import InputError
from cpfls_cli.flights.models import any_model, found_vehicle, is_found, is_model, is_vehicle, with_found_numbers
from cpfls_cli.flights.training import log_formats
from cpfls_cli.pages.gap_words import BY_HAND, WHAT_TO_FLY, flown_by_hand
from cpfls_cli.pages.model import cautions_of, slow_words
from cpfls_cli.report.content import Command, command_line
from cpfls_cli.trajectory.settings import coarsest_excited
from cpfls_cli.words import joined

J = TypeVar("J", bound=Job)

_ARDUPILOT = "bin"
"""Format of the logs that ArduPilot writes."""


def cautions_in(path: Path) -> tuple[str, ...]:
    """Say what speaks against the use of the model in a file."""
    return cautions_of(any_model(path), path.name, read_origin(path).cautions)


def with_numbers(job: J, command: str, model: Path | None, *, whole: bool = False) -> J:
    """Take what a config leaves open from a model of a whole vehicle, or from guesses that are asked for.

    What speaks against the model, or makes guesses of the numbers, goes with what the job writes. `whole`: the command
    needs none of the open numbers, its model has its own. `ConfigError` where nobody says them.
    """
    given = None if model is None or is_vehicle(model) or not model.is_file() else model
    if given is not None and is_model(given):
        job.cautions.update(dict.fromkeys(cautions_in(given)))
    if given is not None and job.study.vehicle.unknown and is_found(given):
        job.found = given
        if not whole:
            return _with_found(job, given)
    require_numbers(job, command, whole=whole)
    return job


def with_numbers_of(job: J, found: Path) -> J:
    """Take what a config leaves open from a vehicle that was found, of a command that takes no model."""
    if not (is_found(found)):
        raise InputError(f"--model {found}: is not a vehicle that `cpfls vehicle` found")
    open_ = [name.replace("_", " ") for name in job.study.vehicle.unknown]
    if not open_:
        job.cautions[f"--model {found.name}: not used; the config states all numbers of the vehicle"] = None
        return job
    job.cautions.update(dict.fromkeys(cautions_in(found)))
    job.cautions[f"{joined(open_)}: null in the config, taken from {found.name}"] = None
    return _with_found(job, found)


def _with_found(job: J, found: Path) -> J:
    # In place: a run of a stage says by its own study where its result comes from.
    job.study, job.open_numbers, job.found = with_found_numbers(job.study, found), "found", found
    return job


def why_no_body_found(job: Job, found: Path) -> str:
    """Say why no such vehicle has the inertia that one puts into the config of a job; empty where it can have it."""
    if "inertia" not in job.study.vehicle.unknown:
        return ""
    heavy = too_heavy(found_vehicle(found))
    return why_no_body(with_found_numbers(job.study, found).vehicle) or (heavy and f"its inertia is {heavy}")


def missing_flight(job: Job, record: Vehicle) -> str:
    """Say which flight would identify what a vehicle leaves open, and first what to log faster."""
    # A study that comes with a vehicle is written with the results, of which a refusal leaves none.
    config = job.config if job.config is None or job.config.is_file() else "CONFIG"
    planned = command_line(to_fly(job, systems=record.logged_by, config=config)).removeprefix("fly ")
    slow = slow_words(record)
    if slow:
        return f"{slow} Then: {planned}, flown in still air, and `cpfls vehicle` again"
    return f"The flight that is missing: {planned}, flown in still air, then `cpfls vehicle` again"


def to_fly(
    job: Job, output: Path | None = None, *, systems: Sequence[str] = (), config: str | Path | None = None
) -> Command:
    """Give the command that plans flights that show more, or what to fly by hand where the autopilot flies no file.

    `systems`: what wrote the logs, where that is known otherwise than by files of the job; `config`: what to call the
    config, if not that of the job.
    """
    formats = log_formats(job.inputs)
    if flown_by_hand(formats, systems):
        return f"fly {BY_HAND}"
    planned = job.study.trajectory
    words = [config or job.config if word == "CONFIG" else word for word in WHAT_TO_FLY.split()[:-1]]
    coarsest = coarsest_excited(planned.excite)
    # A config of coarser paths is refused an excitation.
    finer = ("--set", f"trajectory.sample_time_s={coarsest:g}") if planned.sample_time_s > coarsest else ()
    # Its autopilot sweeps by itself, from numbers in a file.
    form = ("--format", "ardupilot") if formats == {_ARDUPILOT} else ()
    return (*words[:-1], *finer, *form, words[-1], output or job.sibling("mission.h5"))
