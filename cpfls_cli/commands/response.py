"""Command `response`: frequency responses of a vehicle as flights show it, and of a model along them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from cpfls_cli.artifacts.job import Job, begin, check_outputs, finish
from cpfls_cli.artifacts.output import refuse_own, write_text
from cpfls_cli.artifacts.replay import VEHICLE, contradictions_of
from cpfls_cli.artifacts.response import NOT_ACCEPTABLE, NOT_JUDGED, ResponseRecord
from cpfls_cli.commands.compare import to_correct, to_gap
from cpfls_cli.commands.numbers import to_fly, with_numbers
from cpfls_cli.commands.replay import model_notes
from cpfls_cli.flights.inputs import known_by, numbered_roles
from cpfls_cli.flights.models import is_found, learned_by, read_model
from cpfls_cli.flights.playback import flights_to_play
from cpfls_cli.flights.recordings import seen_twice
from cpfls_cli.pages.response import answer
from cpfls_cli.pages.source import source_of
from cpfls_cli.pages.trust import seen_warnings
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.instruments import Instruments, instruments
from cpfls_cli.report.content import Text
from cpfls_cli.report.outcome import Command, Outcome, nothing_written
from cpfls_cli.response.flown import vehicle_responses

_DIGITS = 9


def run(job: Job, flights: Sequence[Path], model: Path | None, table: Path | None = None) -> Outcome:
    """Estimate frequency responses and write them."""
    roles = numbered_roles("flight", flights)
    inputs = begin(job, ({} if model is None else {"model": model}) | roles)
    job = with_numbers(job, "response", model, whole=model is not None and is_found(model))
    if table is not None:
        refuse_own(table, job.output)
        check_outputs(job, table)
    name = VEHICLE if model is None else model.name
    judged = read_model(Path(VEHICLE) if model is None else model, job.study)
    given = flights_to_play(flights, job.study)
    if job.dry_run:
        return nothing_written(job)
    moved_by = instruments([flight.playback for flight in given])
    responses = vehicle_responses(judged, given, moved_by.beside)
    warnings = [
        *seen_twice(inputs[role] for role in roles),
        *seen_warnings(name, learned_by(model), known_by(roles, inputs)),
        *(warning for flight in given for warning in flight.warnings),
        *model_notes(name, judged, given),
        *_left_out(moved_by, given),
    ]
    flown = [flight.name for flight in given]
    made = ResponseRecord.of(name, flown, moved_by.kind, responses, warnings, contradictions_of(given))
    record = finish(job, made, inputs)
    written: tuple[Text, ...] = ()
    if table is not None:
        write_text(table, _csv(record))
        written = (Text(f"{table}: written, the curves as CSV"),)
    blocks = (*answer(source_of(job, record)), *written)
    return Outcome(record.summary, blocks, next=(_next(job, record, flights, model),))


def _next(job: Job, record: ResponseRecord, flights: Sequence[Path], model: Path | None) -> Command:
    """Give the command that goes on: a flight that can be judged, what a model lacks, or the model handed over."""
    words = [record.word(index) for index in range(len(record.name))]
    if record.contradiction:
        return to_correct(job)
    if not record.has_instruments or set(words) <= {NOT_JUDGED}:
        return to_fly(job)
    if NOT_ACCEPTABLE not in words and model is not None:
        return "cpfls", "export", model, "-o", job.beside(f"{model.stem}.c")
    return to_gap(job, flights, model)


def _left_out(moved_by: Instruments, flights: Sequence[LoggedFlight]) -> Iterator[str]:
    """Say which flights hold no instrument beside others that do: they tell nothing of the vehicle."""
    lacks = {
        "repeats": "no other of these flights flies its path",
        "setpoints": "it holds no setpoint from outside of its loops",
    }
    for number, flight in enumerate(flights):
        if moved_by.kind in lacks and number not in moved_by.flights:
            yield f"{flight.name}: {lacks[moved_by.kind]}, so its response to torque is left out"


def _csv(record: ResponseRecord) -> str:
    """Write one line for each response and frequency at which a window tells something; empty where not known."""
    columns = record.columns
    lines = [",".join(["response", "frequency_hz", *columns])]
    for row, name in enumerate(record.name):
        for at in np.flatnonzero(np.isfinite(record.measured.magnitude[row])):
            values = [record.frequency[at], *(values[row, at] for values in columns.values())]
            lines.append(",".join([name, *(f"{value:.{_DIGITS}g}" if np.isfinite(value) else "" for value in values)]))
    return "\n".join(lines) + "\n"
