"""Command `replay`: a model played back along flights, beside what it has to beat."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cpfls_cli.artifacts.job import Job, begin, finish
from cpfls_cli.artifacts.replay import ReplayRecord
from cpfls_cli.commands.numbers import with_numbers
from cpfls_cli.errors import InputError
from cpfls_cli.flights.inputs import known_by, numbered_roles
from cpfls_cli.flights.models import holds_forecast, is_vehicle, learned_by, read_fading, read_model, read_observer
from cpfls_cli.flights.playback import flights_to_play, model_notes, played
from cpfls_cli.flights.recordings import seen_twice
from cpfls_cli.pages.replay import answer
from cpfls_cli.pages.source import source_of
from cpfls_cli.pages.trust import seen_warnings
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.history import Observer, past_of
from cpfls_cli.playback.replay import Played, ReplayOptions, ReplayWindows, replay
from cpfls_cli.report.outcome import Outcome, nothing_written

_FORECAST = "{}: its forecast along logged rotor speeds is played, loop included; its constants are a different model"


def run(job: Job, model: Path, flights: Sequence[Path], options: ReplayOptions) -> Outcome:
    """Play a model back along flights and write its errors by horizon."""
    of_model = {} if is_vehicle(model) else {"model": model}
    roles = numbered_roles("flight", flights)
    inputs = begin(job, of_model | roles)
    job = with_numbers(job, "replay", model, whole=not is_vehicle(model))
    to_play = read_model(model, job.study, forecast=True)
    observer = read_observer(model, options.history_s) if options.history_s > 0 else None
    given = flights_to_play(flights, job.study, options.hold)
    fading_s = read_fading(model)
    pairs = [replace(played(to_play, flight, job.study.vehicle), fading_s=fading_s) for flight in given]
    horizon = _samples(options.horizon_s, given[0], "--horizon")
    if observer is not None:
        _samples(observer.past_s, given[0], "--history")
        pairs = [replace(pair, model=replace(pair.model, observer=observer)) for pair in pairs]
    for each in pairs:
        each.flight.starts(horizon, options.every)
    if job.dry_run:
        return nothing_written(job)
    errors = replay(pairs, horizon, options.every, lambda done: job.progress(done, 1))
    warnings = [
        *seen_twice(inputs[role] for role in roles),
        *seen_warnings(model.name, learned_by(model), known_by(roles, inputs)),
        *(warning for flight in given for warning in flight.warnings),
        *([_FORECAST.format(model.name)] if holds_forecast(model) else []),
        *([] if observer is None else _past_notes(observer, pairs, errors.windows)),
        *model_notes(model.name, to_play, given),
    ]
    record = finish(job, ReplayRecord.of(model.name, options, given, pairs, errors, warnings), inputs)
    return Outcome(record.summary, tuple(answer(source_of(job, record))))


def _past_notes(observer: Observer, pairs: Sequence[Played], windows: ReplayWindows) -> Iterator[str]:
    """Say where there is less of the past than was asked for."""
    short = 0
    for index, pair in enumerate(pairs):
        starts = windows.start[windows.flight == index]
        samples = observer.samples(pair.flight.motion.period)
        short += int(np.sum(past_of(pair.flight, starts, samples)[1].sum(axis=1) < samples))
    if short:
        yield (
            f"{short} of {len(windows.start)} windows begin less than {observer.past_s:g} s after the start of a "
            f"stretch and use what past there is"
        )


def _samples(time_s: float, flight: LoggedFlight, option: str) -> int:
    period = flight.parts[0].period
    if time_s < 0.5 * period:
        raise InputError(f"{option} {time_s:g} s is shorter than a sample of {flight.name}, {period:.4g} s")
    return round(time_s / period)
