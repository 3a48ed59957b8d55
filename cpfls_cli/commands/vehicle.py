"""Command `vehicle`: a whole vehicle found in flights, fitted on what it predicts."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path

from cpfls_cli.artifacts.job import Job, begin, finish
from cpfls_cli.artifacts.replay import HeldOutGroup
from cpfls_cli.artifacts.vehicle_model import VehicleRecord
from cpfls_cli.commands.compare import flight_roles
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.errors import ConfigError, InputError, StoppedError
from cpfls_cli.flights.playback import flights_to_play, whole
from cpfls_cli.pages.source import source_of
from cpfls_cli.pages.vehicle_model import answer
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.parameters import blocks_of
from cpfls_cli.playback.replay import replay
from cpfls_cli.playback.structure import SearchStoppedError
from cpfls_cli.playback.vehicle import FoundVehicle, find_vehicle
from cpfls_cli.report.outcome import Outcome, nothing_written

_FROM_SIGNAL = 128
"""What a shell adds to the number of the signal that ended a program."""


def run(job: Job, flights: Sequence[Path], held_out: Sequence[Path]) -> Outcome:
    """Find a vehicle and write it.

    Parameters
    ----------
    flights : sequence of Path
        Artifacts, or logs that the config describes; the vehicle is found in them.
    held_out : sequence of Path
        Others to judge it on, once.

    Raises
    ------
    InputError
        If a flight has no rotor speeds or commands, or is shorter than the horizon.
    """
    study = job.study
    inputs = begin(job, flight_roles("flight", flights) | flight_roles("held-out", held_out))
    _check_left_out(study)
    read = flights_to_play([*flights, *held_out], study)
    for flight in read:
        if flight.playback.wrench is not None:
            raise InputError(
                f"{flight.name}: states torque and thrust instead of rotor speeds; a vehicle is found from rotor_speed "
                "or rotor_command, name their columns in import.signals"
            )
        flight.playback.starts(_horizon(job, flight), 1)
    training, rest = read[: len(flights)], read[len(flights) :]
    if job.dry_run:
        return nothing_written(job)
    found, signal = _found(job, training)
    judged = _judged(found.model, rest, job) if rest else None
    warnings = [warning for flight in read for warning in flight.warnings]
    record = finish(job, VehicleRecord.of(found, judged, warnings), inputs)
    code = 0 if record.complete or signal is None else _FROM_SIGNAL + signal
    return Outcome(record.summary, tuple(answer(source_of(job, record))), code)


def _found(job: Job, flights: Sequence[LoggedFlight]) -> tuple[FoundVehicle, int | None]:
    """Search; an interrupt ends the search, and its number is given beside what has been found until then.

    Raises
    ------
    StoppedError
        If there is nothing to take yet.
    """
    study = job.study
    job.progress(0.0, 1, "loads compiled loops; at the first use on a machine compiles them")
    with settings_of("playback", study), job.deferred_interrupts() as interrupted:

        def progress(done: int, total: int, best: float) -> None:
            job.progress(done, total, f"structure {done}, smallest error {best:.3g}")
            if interrupted() is not None:
                raise SearchStoppedError

        along = [flight.playback for flight in flights]
        try:
            found = find_vehicle(study.vehicle, along, study.playback, generator(study, "vehicle"), progress)
        except SearchStoppedError:
            message = "the search was interrupted before a vehicle was found, so none is written"
            raise StoppedError(message, _FROM_SIGNAL + (interrupted() or 0)) from None
    return found, interrupted()


def _judged(model: VehicleModel, flights: Sequence[LoggedFlight], job: Job) -> HeldOutGroup:
    """Play a vehicle back along flights that it was not found in, from every sample."""
    to_play = whole(model)
    played = [to_play.played(flight) for flight in flights]
    errors = replay(
        played, _horizon(job, flights[0]), 1, lambda done: job.progress(done, 1, "plays back the flights held out")
    )
    return HeldOutGroup.of([flight.name for flight in flights], errors, flights[0].parts[0].period)


def _horizon(job: Job, flight: LoggedFlight) -> int:
    return max(1, round(job.study.playback.horizon_s / flight.parts[0].period))


def _check_left_out(study: Study) -> None:
    """Refuse names in `playback.leave_out` that no block has."""
    known = blocks_of(study.vehicle)
    for name in study.playback.leave_out:
        if name not in known:
            near = get_close_matches(name, known, n=1, cutoff=0.4)
            hint = f"did you mean {near[0]}?" if near else f"the blocks are {', '.join(known)}"
            raise ConfigError(f"playback.leave_out = {name}: no such block ({hint})")
