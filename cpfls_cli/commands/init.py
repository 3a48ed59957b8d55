"""Command `init`: look into logs, and propose a config for them with the reason of every guess."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import nan
from pathlib import Path

from cpfls_cli.artifacts.job import Job, check_outputs, take_inputs
from cpfls_cli.artifacts.output import write_text
from cpfls_cli.config.check import why_no_body
from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.consistency.findings import Finding
from cpfls_cli.errors import ConfigError, CpflsError, InputError, about
from cpfls_cli.flightlog.proposal import Proposal, known_log, propose
from cpfls_cli.flights.imported import imported
from cpfls_cli.flights.recordings import check_flight, read_import, seen_twice
from cpfls_cli.logs.formats import log_contents
from cpfls_cli.pages.proposal import Stated, answer, asked_keys, config_text, guessed_keys, summary
from cpfls_cli.pages.sensors import contradicted
from cpfls_cli.report.content import Text
from cpfls_cli.report.outcome import Command, Outcome
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle_limits import beyond_any_vehicle, figures_of, room
from cpfls_cli.words import joined

_IMPORTED = 4


def run(job: Job, logs: Sequence[Path], stated: Stated) -> Outcome:
    """Write a commented config for logs of one vehicle."""
    _require_possible(stated)
    inputs = take_inputs(job, {f"log-{number}": log for number, log in enumerate(logs)})
    twice = seen_twice(inputs.values())
    firsts: dict[str, Path] = {}
    for log, file in zip(logs, inputs.values(), strict=True):
        firsts.setdefault(file.sha256, log)
    logs = list(firsts.values())
    check_outputs(job, job.output)
    known = []
    for number, log in enumerate(logs):
        job.progress(number, len(logs), log.name)
        own = log_contents(log)
        with about(log, InputError):
            one = known_log(str(log), own.topics, own.units, own.parameters, own.system)
            known.append(replace(one, of_file=own.warnings))
    proposal = propose(known, stated.mass_kg, stated.arm_m, scale_to_arm=stated.scale_to_arm)
    text, output = config_text(proposal, stated), str(job.output)
    whole = not asked_keys(proposal, stated)
    if whole and stated.knows_constants:
        # Numbers that the log's rotors make impossible, such as a thrust that lifts nothing.
        validate(parse_config(text, str(job.output)), str(job.output))
    wrong, doubted = _parted(_findings(text, logs[0], whole=whole), guessed_keys(proposal))
    if not job.dry_run:
        write_text(job.output, text)
    flown = ((one.name, one.recognition.flown) for one in proposal.logs)
    ended = (f"{name}: {own.cut[0]}" for name, own in flown if own.ended)
    sentences = (*ended, *map(contradicted, wrong), *doubted, *twice)
    said = (Text(each, "warning", always=True) for each in sentences)
    told = summary(proposal, stated, output) | {"contradictions": wrong, "doubted_guesses": doubted}
    # A config that asks for something is refused by every command until it is filled in.
    followed = tuple(_next(job, proposal, logs)) if whole else ()
    return Outcome(told, (*said, *answer(proposal, stated, output)), next=followed)


def _next(job: Job, proposal: Proposal, given: Sequence[Path]) -> Iterator[Command]:
    """Give the commands that import all logs, and one that learns from those of one mass but the last, which judges.

    Logs whose rotors carry something else are played back along, which shows how far off the same vehicle is there.
    """
    # Many logs are taken as they are.
    as_logs = proposal.has_rotors and len(given) > _IMPORTED
    named = list(given) if as_logs else [job.beside(name) for name in _flight_names(given)]
    for log, flight in zip([] if as_logs else given, named, strict=False):
        yield ("cpfls", "import", job.output, log, "-o", flight)
    equal = {Path(name) for name in proposal.equal}
    flights = [flight for log, flight in zip(given, named, strict=True) if log in equal]
    others = [flight for flight in named if flight not in flights]
    learned, judged = (flights[:-1], flights[-1:]) if len(flights) > 1 else (flights, [])
    if proposal.has_rotors:
        apart = [word for flight in judged for word in ("--held-out", flight)]
        yield ("cpfls", "vehicle", job.output, *learned, *apart, "-o", job.beside("vehicle.h5"))
        if others:
            played = job.beside("other-loads.h5")
            yield ("cpfls", "replay", job.output, job.beside("vehicle.h5"), *others, "-o", played)
    elif proposal.states_torque:
        apart = [word for flight in judged for word in ("--validate", flight)]
        yield ("cpfls", "identify", job.output, *learned, *apart, "-o", job.beside("model.h5"))


def _flight_names(logs: Sequence[Path]) -> list[str]:
    """Name the flight of each log, apart from each other and from the logs."""
    stems = [log.name.partition(".")[0] for log in logs]
    alike = len(set(stems)) < len(stems)
    names = [f"{stem}-{number}" if alike else stem for number, stem in enumerate(stems, start=1)]
    taken = {log.name for log in logs}
    return [f"{name}-flight.h5" if f"{name}.h5" in taken else f"{name}.h5" for name in names]


def _require_possible(stated: Stated) -> None:
    """Refuse numbers that no vehicle has, before a log is read; by its arms it is taken for a quadrotor.

    Raises
    ------
    ConfigError
    """
    arm, moments = _or_nan(stated.arm_m), stated.inertia_kg_m2 or (nan,)
    known = {
        "mass": _or_nan(stated.mass_kg),
        "arm": arm,
        "room": room(arm, 4),
        "rotors": 4.0,
        "inertia": max(moments),
        "least_inertia": min(moments),
        "thrust_factor": _or_nan(stated.thrust_factor_n_s2),
        "drag_factor": _or_nan(stated.drag_factor_n_m_s2),
    }
    lines = [
        f"--{each.name.replace('_', '-')} = {known[each.name]:g}: {each.why}"
        for each in beyond_any_vehicle(figures_of(**known))
    ]
    if stated.inertia_kg_m2 is not None and not lines:
        why = why_no_body(VehicleSettings(inertia_kg_m2=stated.inertia_kg_m2))
        lines += [f"--inertia = {','.join(f'{each:g}' for each in moments)}: {why}"] if why else []
    if lines:
        raise ConfigError("\n".join(lines))


def _or_nan(value: float | None) -> float:
    return nan if value is None else value


def _parted(findings: Sequence[Finding], guessed: Sequence[str]) -> tuple[list[str], list[str]]:
    """Part what contradicts itself in a log from what only contradicts a guess: no guess is held against a log."""
    wrong, doubted = [], []
    for finding in findings:
        ours = [key for key in guessed if key in finding.sentence or key in finding.channels]
        if ours:
            many = len(ours) > 1
            doubted.append(
                f"{joined(ours)} {'are guesses' if many else 'is a guess'}, and {'one of them' if many else 'it'} is "
                f"likely wrong: {finding.sentence}"
            )
        else:
            wrong.append(finding.sentence)
    return wrong, doubted


def _findings(text: str, log: Path, *, whole: bool) -> tuple[Finding, ...]:
    """Read the leading log by the config that is proposed, and find what of it contradicts itself, or its vehicle."""
    data = parse_config(text, "the config that is proposed")
    if not whole:
        data = {"import": data["import"] | {"torque_source": None}}
    try:
        study = validate(data, "the config that is proposed")
        flight = read_import(log.name, [imported(log, study)], study)
    except CpflsError:
        # What does not import is for the person who fills it in; the import says why.
        return ()
    found = (finding.of(log.name) for finding in check_flight(flight, study, driven=whole))
    return tuple(finding for finding in found if finding.contradiction)
