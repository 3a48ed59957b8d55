"""Command `vehicle`: a whole vehicle found in flights, fitted on what it predicts."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, NamedTuple

from cpfls_cli.artifacts.job import Job, check_outputs, finish
from cpfls_cli.artifacts.learned import LearnedGroup
from cpfls_cli.artifacts.output import refuse_own, write_text
from cpfls_cli.artifacts.parameters import vehicle_section
from cpfls_cli.artifacts.playback import HeldOutGroup
from cpfls_cli.artifacts.vehicle_model import VehicleRecord
from cpfls_cli.commands.numbers import to_fly
from cpfls_cli.commands.stopped import stopped, without_model
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.config.yaml_text import to_yaml
from cpfls_cli.errors import ConfigError, InputError
from cpfls_cli.flights.inputs import numbered_roles
from cpfls_cli.flights.playback import flights_to_play, played
from cpfls_cli.flights.recordings import refuse_seen, seen_twice
from cpfls_cli.pages.model import answer
from cpfls_cli.pages.sensors import NOTHING_COMES, contradicted, tell_before_search
from cpfls_cli.pages.source import source_of
from cpfls_cli.pages.vehicle_model import slow_words, too_slow
from cpfls_cli.playback.flight import LoggedFlight, contradictions_of
from cpfls_cli.playback.loop import shows_loop_anyhow
from cpfls_cli.playback.parameters import MASS, blocks_of
from cpfls_cli.playback.replay import fading, replay
from cpfls_cli.playback.settings import GroupSettings, PlaybackSettings
from cpfls_cli.playback.structure import Judged, Kept, SearchStoppedError
from cpfls_cli.playback.vehicle import FoundVehicle, find_vehicle
from cpfls_cli.report.content import Text
from cpfls_cli.report.outcome import Outcome, nothing_written
from cpfls_cli.response.flown import VehicleResponse, vehicle_responses
from cpfls_cli.search.resumable import Watch
from cpfls_cli.search.vehicle_search import VehicleCheckpoint, begin_vehicle_search
from cpfls_cli.validation.trust import Trust
from cpfls_cli.words import did_you_mean, joined

_KEPT_EVERY = 10
"""Structures after which the checkpoint is written again: what a killed search has to judge anew at most."""


class ConfigCopy(NamedTuple):
    """A config, as it is with what the command line changes, to be written again with the numbers that are found."""

    name: str
    data: dict[str, Any]
    copy: Path


def run(
    job: Job,
    flights: Sequence[Path],
    held_out: Sequence[Path],
    config: ConfigCopy | None = None,
    *,
    resume: bool = False,
) -> Outcome:
    """Find a vehicle and write it."""
    study = job.study
    learned, unseen = numbered_roles("flight", flights), numbered_roles("held-out", held_out)
    inputs, checkpoint, kept = begin_vehicle_search(job, learned | unseen, resume=resume)
    refuse_seen(*([inputs[role] for role in roles] for roles in (learned, unseen)))
    twice = seen_twice(inputs[role] for role in learned)
    if config is not None:
        refuse_own(config.copy, job.output)
        check_outputs(job, config.copy)
    read = _grouped(flights_to_play([*flights, *held_out], study), [*flights, *held_out], study.playback.groups)
    for flight in read:
        _require_rotors(flight)
        flight.playback.starts(_horizon(job, flight), 1)
    # After the rotors are known to be those of a vehicle that flies: blocks of others cannot be scaled.
    _check_blocks(study)
    _check_groups(study.playback.groups, read[: len(flights)])
    training, rest = read[: len(flights)], read[len(flights) :]
    settings, limit = _what_can_come(job, read, training)
    if job.dry_run:
        return nothing_written(job)
    if kept is None:
        checkpoint.remove()
    with checkpoint.kept():
        vehicle, signal = _found(job, training, settings, checkpoint, kept or {})
        fading_s = fading([flight.playback for flight in training], _horizon(job, training[0]))
        judged = _judged(vehicle, rest, job, fading_s) if rest else None
        warnings = [*limit, *twice, *(warning for flight in read for warning in flight.warnings)]
        commanded = any(flight.parts[0].commanded for flight in training)
        samples = [sum(map(len, flight.parts)) for flight in training]
        parts = LearnedGroup.parts(learned, [(own, own) for own in samples])
        found_vehicle = VehicleRecord.of(
            vehicle,
            judged,
            warnings,
            contradictions_of(read) or None,
            parts,
            _responses(vehicle, training),
            fading_s=fading_s,
            rotors_told=min(flight.told_hz for flight in training),
            logged_by=tuple(dict.fromkeys(flight.system for flight in training if flight.system)),
            commanded=commanded,
            shares=any(flight.shares for flight in training),
        )
        record = finish(job, found_vehicle, inputs)
    written: tuple[Text, ...] = ()
    if record.complete:
        # Of a search that goes on, the numbers are not those that are found; nothing is then in the way of --resume.
        written = _write_config(config, record)
        checkpoint.remove()
    outcome = Outcome(
        record.summary, (*answer(source_of(job, record)), *written), next=next_commands(job, record, flights, held_out)
    )
    return stopped(outcome, "generations" if record.complete else "interrupted", signal, job.output)


def next_commands(
    job: Job, record: VehicleRecord, flights: Sequence[Path], held_out: Sequence[Path]
) -> tuple[Sequence[str | Path], ...]:
    """Give the commands that show what was found, and that judge it, plan what would tell more, or hand it over."""
    config, name = job.config, job.output.stem
    page = ("cpfls", "report", config, job.output, "-o", job.output.with_suffix(".html"))
    if not record.complete:
        return (page,)
    if any(slow_words(record)):
        # No flight that is planned tells more before the logs are faster.
        return (page,)
    if record.trust in (Trust.LOOP, Trust.NOT_DETERMINED, Trust.LACKING, Trust.DO_NOT_USE):
        mission = job.output.with_name(f"{name}-mission.h5")
        return page, to_fly(job, mission)
    if not held_out and len(flights) > 1:
        judged = job.output.with_name(f"{name}-judged.h5")
        return page, ("cpfls", "vehicle", config, *flights[:-1], "--held-out", flights[-1], "-o", judged)
    return page, ("cpfls", "export", job.output, "-o", job.output.with_suffix(".c"))


def _write_config(config: ConfigCopy | None, record: VehicleRecord) -> tuple[Text, ...]:
    """Write a config with the numbers that were found in the place of its section `vehicle`, and say so."""
    if config is None:
        return ()
    data = config.data | {"vehicle": vehicle_section(record)}
    write_text(config.copy, f"# {config.name}, with the vehicle that `cpfls vehicle` found\n{to_yaml(data)}")
    return (Text(f"{config.copy}: written, the config with these constants"),)


def _what_can_come(
    job: Job, flights: Sequence[LoggedFlight], training: Sequence[LoggedFlight]
) -> tuple[PlaybackSettings, tuple[str, ...]]:
    """Refuse logs that contradict themselves, and seek no more than slow ones can tell; first a word of it.

    Returns
    -------
    PlaybackSettings
    tuple of str
        What to say beside the answer.
    """
    settings, wrong = job.study.playback, contradictions_of(flights)
    if wrong and not settings.anyway:
        raise InputError("\n".join(map(contradicted, wrong)) + f"\n{NOTHING_COMES}")
    tell_before_search(wrong)
    own = [flight for flight in training if not flight.group]
    told_hz = min(flight.told_hz for flight in own)
    along = [flight.playback for flight in own]
    if settings.anyway or not shows_loop_anyhow(job.study.vehicle, along, told_hz):
        return settings, ()
    said = too_slow(told_hz)
    logging.getLogger("cpfls_cli").warning(said)
    return replace(settings, leave_out=blocks_of(job.study.vehicle), history_s=0.0), (said,)


def _require_rotors(flight: LoggedFlight) -> None:
    if flight.playback.wrench is not None:
        raise InputError(
            f"{flight.name}: holds torque instead of rotor speeds; `cpfls vehicle` needs rotor_speed or rotor_command, "
            "or thrust beside body_torque, of four rotors with known factors: name their columns in import.signals"
        )


def _found(
    job: Job,
    flights: Sequence[LoggedFlight],
    settings: PlaybackSettings,
    checkpoint: VehicleCheckpoint,
    kept: Kept,
) -> tuple[FoundVehicle, int | None]:
    """Search; an interrupt ends the search, and its number is given beside what has been found until then."""
    study, watch = job.study, Watch(job, None)
    job.progress(0.0, 1, "loads compiled loops")

    def progress(judged: Sequence[Judged], total: int) -> None:
        best = min(each.error for each in judged)
        job.progress(len(judged), total, f"structure {len(judged)}, smallest error {best:.3g}")
        stop = watch.should_stop()
        if stop or len(judged) % _KEPT_EVERY == 0:
            checkpoint.write(judged)
        if stop:
            raise SearchStoppedError

    along = [flight.playback for flight in flights]
    with settings_of("playback", study), watch.deferring():
        try:
            vehicle = find_vehicle(study.vehicle, along, settings, generator(study, "vehicle"), progress, kept)
        except SearchStoppedError as error:
            raise (without_model("interrupted", watch.signal) or error) from None
    return vehicle, watch.signal


def _judged(vehicle: FoundVehicle, flights: Sequence[LoggedFlight], job: Job, fading_s: float) -> HeldOutGroup:
    """Play a vehicle back along flights that it was not found in, from every sample."""
    models = {"": vehicle.forecast or vehicle.model, **vehicle.others}
    pairs = [replace(played(models[flight.group], flight, job.study.vehicle), fading_s=fading_s) for flight in flights]
    if vehicle.history is not None:
        pairs = [replace(pair, with_past=replace(pair.model, observer=vehicle.history)) for pair in pairs]
    errors = replay(
        pairs, _horizon(job, flights[0]), 1, lambda done: job.progress(done, 1, "plays back the flights held out")
    )
    return HeldOutGroup.judged(pairs, errors)


def _responses(vehicle: FoundVehicle, flights: Sequence[LoggedFlight]) -> dict[str, VehicleResponse]:
    """Estimate frequency responses beside those of the model; none where the flights tell of the loop alone."""
    own = [flight for flight in flights if not flight.group]
    if vehicle.constants is None and vehicle.loop.unexplained:
        return {}
    try:
        return vehicle_responses(vehicle.model, own, vehicle.instruments.beside)
    except InputError:
        # Stretches that are too short for a window; the flights' inputs were checked before.
        return {}


def _grouped(
    flights: Sequence[LoggedFlight], paths: Sequence[Path], groups: Sequence[GroupSettings]
) -> tuple[LoggedFlight, ...]:
    """Say of each flight in which configuration the vehicle flew it: the first whose names match."""
    grouped = []
    for flight, path in zip(flights, paths, strict=True):
        own = (group.name for group in groups if any(fnmatch(path.name, name) for name in group.flights))
        grouped.append(replace(flight, group=next(own, "")))
    return tuple(grouped)


def _check_groups(groups: Sequence[GroupSettings], training: Sequence[LoggedFlight]) -> None:
    """Refuse groups that no flight tells anything of."""
    flown = {flight.group for flight in training}
    for group in groups:
        if group.name not in flown:
            names = joined(repr(name) for name in group.flights)
            raise ConfigError(
                f"playback.groups: no training flight belongs to {group.name}: no file name matches {names}; name its "
                f"files there or leave the group out"
            )
    if "" not in flown:
        raise ConfigError(
            "playback.groups: every flight belongs to a group; at least one has to be of the section vehicle, whose "
            "mass gives all numbers their size"
        )


def _horizon(job: Job, flight: LoggedFlight) -> int:
    return max(1, round(job.study.playback.horizon_s / flight.parts[0].period))


def _check_blocks(study: Study) -> None:
    """Refuse names of blocks that no vehicle has."""
    known = (*study.vehicle.unknown, *blocks_of(study.vehicle))
    for name in study.playback.leave_out:
        _check_block("playback.leave_out", name, known)
    for group in study.playback.groups:
        for name in group.differs or ():
            _check_block(f"playback.groups: {group.name}: differs", name, (MASS, *known))


def _check_block(key: str, name: str, known: Sequence[str]) -> None:
    if name not in known:
        hint = did_you_mean(name, known, f"the blocks are {', '.join(known)}")
        raise ConfigError(f"{key} = {name}: no such block ({hint})")
