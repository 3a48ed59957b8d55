"""Look into logs of one vehicle, or a simulator's file, and write a config, with the reason of every number."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import nan, sqrt
from pathlib import Path
from typing import Annotated, Any

import typer
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from cpfls_cli.arguments import moments
from cpfls_cli.artifacts.vehicle_model import FOUND_AS, name_of
from cpfls_cli.config.check import why_no_body
from cpfls_cli.config.load import ASK, how_to_fill_in, parse_config, validate
from cpfls_cli.consistency.findings import Finding
from cpfls_cli.errors import ConfigError, CpflsError, InputError
from cpfls_cli.flightlog.airframe import Airframe, RotorPlace, usual_airframe
from cpfls_cli.flightlog.proposal import DECIDES_ROTORS, Proposal, known_log, propose
from cpfls_cli.flightlog.recognised import Guess, KeyChoice, Recognition, Rival
from cpfls_cli.flightlog.settings import ROTORS, ColumnMap
from cpfls_cli.flightlog.stated_vehicle import FAST_HZ, USUAL, log_faster
from cpfls_cli.flights.models import found_vehicle, is_found
from cpfls_cli.flights.recordings import check_flight, imported, read_import, seen_twice
from cpfls_cli.logs.formats import MOST_LISTED, about_flight, log_contents, suffixes_in_words
from cpfls_cli.page import TEMPLATES
from cpfls_cli.pages.trust import contradicted
from cpfls_cli.report.content import Command, number
from cpfls_cli.result import about as described
from cpfls_cli.result import result
from cpfls_cli.simulators.formats import file_of, read_model
from cpfls_cli.simulators.model import SimulatorModel, of_settings
from cpfls_cli.simulators.study import VehicleOf, of_log
from cpfls_cli.stage import Run, stage
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle_limits import beyond_any_vehicle, figures_of, room
from cpfls_cli.words import by_name, capitalised, joined, some

_IMPORTED = 4
"""Logs that are imported one by one; more are taken as they are."""
_WIDTH = 110
_SPINS = {1: "ccw", -1: "cw", 0: "turning an unknown way"}
_PLAIN = re.compile(r"[A-Za-z_][\w./^ -]*")
_SURFACE = re.compile(r"aileron|elevator|rudder|elevon")

MayLogsArgument = Annotated[
    list[Path] | None,
    typer.Argument(metavar="LOG", help=f"Flight logs of one vehicle: {suffixes_in_words()}.", show_default=False),
]
FromOption = Annotated[
    Path | None,
    typer.Option(
        "--from",
        metavar="MODEL",
        help="A simulator's own file, whose vehicle the config gets (SDF, URDF, MJCF, RotorPy, ArduPilot, crazyflow, "
        "Crazyflie), or vehicle.h5.",
        show_default=False,
    ),
]
MassOption = Annotated[
    float | None, typer.Option("--mass", metavar="KG", min=1e-6, help="Mass as it flew, with battery, kg.")
]
ArmOption = Annotated[float | None, typer.Option("--arm", metavar="M", min=1e-6, help="Middle to a rotor's axis, m.")]
ScaleOption = Annotated[bool, typer.Option("--scale-to-arm", help="Scale places of rotors that a log states to --arm.")]
InertiaOption = Annotated[
    Any,  # Of a tuple typer takes three words.
    typer.Option(
        "--inertia",
        metavar="IXX,IYY,IZZ",
        parser=moments,
        help="Moments of inertia where they are known, from CAD, a swing test or an earlier study, kg m^2.",
    ),
]
ThrustOption = Annotated[
    float | None,
    typer.Option(
        "--thrust-factor",
        metavar="N_S2",
        min=1e-12,
        help="Thrust of a rotor over its squared speed in rad/s, N s^2, where a data sheet gives it.",
    ),
]
DragOption = Annotated[
    float | None,
    typer.Option("--drag-factor", metavar="N_M_S2", min=1e-15, help="Torque of its drag over the same, N m s^2."),
]


@dataclass(frozen=True)
class Stated:
    """What the person who asks knows of the vehicle; what is None is not known, and for `cpfls vehicle` to find."""

    mass_kg: float | None = None
    arm_m: float | None = None
    inertia_kg_m2: tuple[float, float, float] | None = None
    thrust_factor_n_s2: float | None = None
    drag_factor_n_m_s2: float | None = None
    model: SimulatorModel | None = None
    like: VehicleSettings | None = None  # Made of the same file with other logs.


def asked_keys(proposal: Proposal, stated: Stated) -> tuple[str, ...]:
    """List the keys of the config of logs that only a person can fill in."""
    keys = [] if stated.mass_kg is not None or stated.model is not None else ["vehicle.mass_kg"]
    airframe = proposal.airframe
    if not proposal.rotors:
        keys.append("vehicle.rotors")
    for index in range(proposal.rotors):
        if airframe is None or airframe.is_asked or not airframe.in_metres:
            keys.append(f"vehicle.rotors.{index}.position_m")
        if airframe is None or airframe.is_asked or airframe.rotors[index].spin == 0:
            keys.append(f"vehicle.rotors.{index}.spin")
    return tuple(keys)


@result
class Proposed:
    """A config for logs; ``--json`` shows all of the proposal."""

    proposal: Proposal | None
    stated: Stated
    vehicle: VehicleOf | None
    output: str = described("file of the config")
    contradictions: tuple[str, ...] = described("what contradicts itself in the leading log", "sentence")
    doubted_guesses: tuple[str, ...] = described("what contradicts a guess", "sentence")
    twice: tuple[str, ...] = described("logs that were given twice", "sentence", brief=False)

    @cached_property
    def asked(self) -> tuple[str, ...]:
        """Keys of the config that only a person can fill in."""
        if self.vehicle is not None and (self.vehicle.model.rotors or self.proposal is None):
            return self.vehicle.asked
        return () if self.proposal is None else asked_keys(self.proposal, self.stated)

    @property
    def edits(self) -> str:
        """What is to be written in the place of what is asked."""
        arm = self.stated.arm_m
        side = None if arm is None else f"{arm / sqrt(2):.3g}"
        known = {} if side is None else {"position_m": f"[{side}, -{side}, 0.0]"}
        return f"write {_asked_words(self.asked)} in place of {ASK}{how_to_fill_in(self.asked, brief=True, **known)}"

    @property
    def topic(self) -> str:
        """Topic of all columns; empty where there are several."""
        signals = () if self.proposal is None else self.proposal.signals
        names = [column for guess in signals for column in guess.columns.columns]
        topics = {name.partition(".")[0] for name in names if name.count(".") > 1}
        return topics.pop() if len(topics) == 1 and all(name.count(".") > 1 for name in names) else ""

    @property
    def rivals(self) -> Iterator[tuple[str, Rival]]:
        """What each guess may be too, with its signal or key."""
        if self.proposal is None:
            return
        yield from ((each.signal, rival) for each in self.proposal.signals for rival in each.rivals)
        yield from ((each.key, rival) for each in self.proposal.choices for rival in each.rivals)

    def rotor(self, rotor: RotorPlace | None) -> str:
        """Write the line of a rotor."""
        return _rotor(rotor, None if self.proposal is None else self.proposal.airframe, self.stated)


def _unused(recognition: Recognition) -> Iterator[str]:
    """List unused columns, those of each topic by themselves, which differ in a number alone as one; whole topics."""
    columns = (column for guess in recognition.signals for column in guess.columns.columns)
    taken = {re.split(r"[.[]", column)[0] for column in columns if "." in column}
    topics: dict[str, dict[str, list[str]]] = {}
    whole: dict[str, None] = {}
    for name in recognition.unused:
        topic, dot, _ = name.partition(".")
        # An instance of a topic is not all of it.
        kind = topic.partition("[")[0]
        if dot and taken and kind not in taken:
            whole[kind] = None
            continue
        same = topics.setdefault(topic if dot else "", {})
        same.setdefault(re.sub(r"\d+(?=\]?$)", "*", name), []).append(name)
    for same in topics.values():
        yield ", ".join(_in_braces(own) for own in same.values())
    if whole:
        yield f"anything of {some(list(whole), MOST_LISTED)}"


def _in_braces(names: Sequence[str]) -> str:
    """List names with what they begin and end with written once, as a shell does."""
    begin = _beginning(names)
    if len(names) < 2 or not begin:
        return ", ".join(names)
    rest = [name.removeprefix(begin) for name in names]
    # An end that all have is none of a word, such as the bracket of an index.
    alike = _beginning([own[::-1] for own in rest])[::-1]
    end = next((alike[place:] for place, letter in enumerate(alike) if not letter.isalnum()), "")
    return f"{begin}{{{','.join(own.removesuffix(end) for own in rest)}}}{end}"


def _beginning(names: Sequence[str]) -> str:
    first, last = min(names), max(names)
    return first[: next((place for place, letter in enumerate(first) if letter != last[place : place + 1]), None)]


def _unit(columns: ColumnMap) -> str:
    scale = "" if columns.scale == 1.0 else f" x {number(columns.scale, 4)}"
    offset = "" if columns.offset == 0.0 else f" {'+' if columns.offset > 0 else '-'} {number(abs(columns.offset), 4)}"
    sign = "" if columns.sign is None else f", sign {' '.join('+' if s > 0 else '-' for s in columns.sign)}"
    mixed = "" if columns.mixer is None else f", mixed for {len(columns.mixer)} rotors"
    return f"{columns.unit}{scale}{offset}{sign}{mixed}"


def _rotors_in_words(proposal: Proposal) -> str:
    if proposal.states_torque:
        return "the log states a torque and no rotors"
    if not proposal.has_rotors:
        surfaces = [name for name in proposal.first.unused if _SURFACE.search(name.lower())]
        if len(surfaces) > 1:
            return (
                f"no column is recognised as a rotor's, and {joined(surfaces)} are by their names surfaces of an"
                " airplane, or sticks: only vehicles that rotors carry are modelled"
            )
        system, parameters = proposal.logs[0].system, proposal.logs[0].parameters
        return (
            "no column is recognised as a rotor's, and a model of the vehicle needs rotors; if some are, name"
            " them in import.signals (rotor_speed or rotor_command)"
            + (f"; else {log_faster('them', FAST_HZ, system, parameters=parameters)}" if system else "")
        )
    own = (guess.other_columns for guess in proposal.signals if guess.signal in ROTORS)
    more = next((f", or more {rival.reason}" for rival in own if rival is not None), "")
    if proposal.airframe is None:
        unknown = (
            "neither parameters nor the motion say where they are; a log with more motion, given with this one, may"
        )
        return f"{proposal.rotors} rotors{more}; {unknown}"
    places = ", ".join(
        f"M{index} {rotor.name or 'at its place'} {_SPINS[rotor.spin]}"
        for index, rotor in enumerate(proposal.airframe.rotors, start=1)
    )
    return f"rotors{', a guess' if proposal.airframe.is_guess else ''}: {places}{more}"


def _asked_words(keys: Sequence[str]) -> str:
    """Name keys, those of each rotor once."""
    others: list[str] = []
    of_rotors: dict[str, list[str]] = {}
    for key in keys:
        _, *rest = key.split(".")
        if len(rest) == 1:
            others.append(key)
        else:
            of_rotors.setdefault(f"M{int(rest[1]) + 1}", []).append(rest[2])
    by_keys: dict[tuple[str, ...], list[str]] = {}
    for rotor, own in of_rotors.items():
        by_keys.setdefault(tuple(own), []).append(rotor)
    return ", ".join([*others, *(f"{joined(list(own))} of {joined(rotors)}" for own, rotors in by_keys.items())])


@stage(Proposed, words=by_name(_unused, contradicted, _in_braces, _unit, _rotors_in_words))
def init(
    run: Run,
    logs: MayLogsArgument = None,
    model: FromOption = None,
    mass: MassOption = None,
    arm: ArmOption = None,
    scale_to_arm: ScaleOption = False,
    inertia: InertiaOption = None,
    thrust_factor: ThrustOption = None,
    drag_factor: DragOption = None,
) -> Proposed:
    """Write a commented config for logs of one vehicle, a simulator's file of it, or both."""
    if not logs and model is None:
        raise InputError("Missing argument 'LOG...': give logs, or a simulator's file by --from, or both")
    file = None
    if model is not None:
        file = taken(run, model, "model")
        also = (arm, thrust_factor, drag_factor, scale_to_arm or None) if file.rotors else ()
        if any(each is not None for each in (inertia, *also)):
            raise InputError(
                f"{file.file}: states inertia{', rotors and their factors' if file.rotors else ''}, so leave out "
                f"--inertia{', --arm and the factors' if file.rotors else ''}; --mass takes the mass as it flew"
            )
    stated = Stated(mass, arm, inertia, thrust_factor, drag_factor, file)
    _require_possible(stated)
    made, given, text = proposed(run, logs or (), stated, scale_to_arm=scale_to_arm)
    run.texts[run.output] = text
    proposal = made.proposal
    if proposal is not None:
        run.also = _summary(proposal, made.asked)
        # A config that asks for something is refused by every command until it is filled in, and a log that contradicts
        # itself by the one that learns from it.
        wrong = (("cpfls", "config", run.output, "--section", "import"),) if made.contradictions else ()
        run.next += wrong or _next(run, proposal, given) if not made.asked else ()
    return made


def taken(run: Run, model: Path, role: str) -> SimulatorModel:
    """Read a simulator's file, which is an input of the run with all that it includes, or a vehicle that was found."""
    run.take({role: file_of(model)})
    if is_found(model):
        record = found_vehicle(model)
        made = of_settings(model, record.model.vehicle, record.model.response.lag_s)
        weak = joined(name_of(name) for name in record.not_determined if name in FOUND_AS.values())
        note = f"{weak}: not identified by the flights of {model.name}, so maybe not the vehicle's own"
        return replace(made, notes=(note,)) if weak else made
    read = read_model(model)
    run.take({f"{role}-include-{at}": file for at, file in enumerate(read.files[1:], start=1)})
    return read


def proposed(
    run: Run, logs: Sequence[Path], stated: Stated, *, scale_to_arm: bool = False
) -> tuple[Proposed, list[Path], str]:
    """Propose a config: what it is made of, the logs that it is for, each once, and its text."""
    inputs = run.take({f"log-{at}": log for at, log in enumerate(logs)})
    files = [file for role, file in inputs.items() if role.startswith("log-")]
    firsts: dict[str, Path] = {}
    for log, file in zip(logs, files, strict=True):
        firsts.setdefault(file.sha256, log)
    given, known = list(firsts.values()), []
    for at, log in enumerate(given):
        run.progress(at, len(given), log.name)
        own = log_contents(log)
        with about_flight(log):
            one = known_log(str(log), own.topics, own.units, own.parameters, own.system)
            known.append(replace(one, of_file=own.warnings))
    mass, model = stated.mass_kg, stated.model
    mass = model.mass_kg if mass is None and model is not None else mass
    proposal = None
    if known:
        thrust = stated.thrust_factor_n_s2
        proposal = propose(known, mass, stated.arm_m, thrust_factor=thrust, scale_to_arm=scale_to_arm)
    vehicle = None if model is None else of_log(model, proposal, stated.mass_kg, stated.like)
    made = Proposed(
        proposal=proposal,
        stated=stated,
        vehicle=vehicle,
        output=str(run.output),
        contradictions=(),
        doubted_guesses=(),
        twice=tuple(seen_twice(files)),
    )
    text, whole = config_text(made), not made.asked
    constants = (stated.model, stated.inertia_kg_m2, stated.thrust_factor_n_s2, stated.drag_factor_n_m_s2)
    if whole and any(each is not None for each in constants):
        # Numbers that the log's rotors make impossible, such as a thrust that lifts nothing.
        name = str(run.output) if model is None else f"{model.file}, as a config"
        validate(parse_config(text, name), name)
    if proposal is None:
        return made, given, text
    wrong, doubted = _parted(_findings(text, given[0], whole=whole), guessed_keys(proposal))
    return replace(made, contradictions=tuple(wrong), doubted_guesses=tuple(doubted)), given, text


def _next(run: Run, proposal: Proposal, given: Sequence[Path]) -> Iterator[Command]:
    """Give the commands that import all logs, and one that learns from those of one mass but the last, which judges.

    Logs whose rotors carry something else are played back along, which shows how far off the same vehicle is there.
    """
    # Many logs are taken as they are.
    as_logs = proposal.has_rotors and len(given) > _IMPORTED
    named = list(given) if as_logs else [run.sibling(name) for name in _flight_names(given)]
    for log, flight in zip([] if as_logs else given, named, strict=False):
        yield ("cpfls", "import", run.output, log, "-o", flight)
    equal = {Path(name) for name in proposal.equal}
    flights = [flight for log, flight in zip(given, named, strict=True) if log in equal]
    others = [flight for flight in named if flight not in flights]
    learned, judged = (flights[:-1], flights[-1:]) if len(flights) > 1 else (flights, [])
    if proposal.has_rotors:
        apart = [word for flight in judged for word in ("--held-out", flight)]
        yield ("cpfls", "vehicle", run.output, *learned, *apart, "-o", run.sibling("vehicle.h5"))
        if others:
            played = run.sibling("other-loads.h5")
            yield ("cpfls", "replay", run.output, run.sibling("vehicle.h5"), *others, "-o", played)
    elif proposal.states_torque:
        apart = [word for flight in judged for word in ("--validate", flight)]
        yield ("cpfls", "identify", run.output, *learned, *apart, "-o", run.sibling("model.h5"))


def _flight_names(logs: Sequence[Path]) -> list[str]:
    """Name the flight of each log, apart from each other and from the logs."""
    stems = [log.name.partition(".")[0] for log in logs]
    alike = len(set(stems)) < len(stems)
    names = [f"{stem}-{number}" if alike else stem for number, stem in enumerate(stems, start=1)]
    taken = {log.name for log in logs}
    return [f"{name}-flight.h5" if f"{name}.h5" in taken else f"{name}.h5" for name in names]


def _require_possible(stated: Stated) -> None:
    """Refuse numbers that no vehicle has, before a log is read; by its arms it is taken for a quadrotor."""
    arm, moments = stated.arm_m, stated.inertia_kg_m2 or (nan,)
    values = {
        "mass": stated.mass_kg,
        "arm": arm,
        "room": arm and room(arm, 4),
        "rotors": 4.0,
        "inertia": max(moments),
        "least_inertia": min(moments),
        "thrust_factor": stated.thrust_factor_n_s2,
        "drag_factor": stated.drag_factor_n_m_s2,
    }
    known = {name: nan if value is None else value for name, value in values.items()}
    lines = [
        f"--{each.name.replace('_', '-')} = {known[each.name]:g}: {each.why}"
        for each in beyond_any_vehicle(figures_of(**known))
    ]
    if stated.inertia_kg_m2 is not None and not lines:
        why = why_no_body(VehicleSettings(inertia_kg_m2=stated.inertia_kg_m2))
        lines += [f"--inertia = {','.join(f'{each:g}' for each in moments)}: {why}"] if why else []
    if lines:
        raise ConfigError("\n".join(lines))


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


def _summary(proposal: Proposal, asked: Sequence[str]) -> dict[str, Any]:
    """Give the proposal for ``--json``."""
    return {
        "logs": [one.name for one in proposal.logs],
        "systems": [one.system for one in proposal.logs],
        "time_column": proposal.time_column,
        "time_unit": proposal.time_unit,
        "signals": {guess.signal: {**_columns(guess.columns), **_grounds(guess)} for guess in proposal.signals},
        "choices": {choice.key: {"value": choice.value, **_grounds(choice)} for choice in proposal.choices},
        "crop_s": proposal.crop_s,
        "crops_s": dict(proposal.crops),
        "cut": {one.name: list(one.recognition.flown.cut) for one in proposal.logs},
        "left_out": {one.name: list(one.recognition.left_out) for one in proposal.logs},
        "unused": {one.name: list(one.recognition.unused) for one in proposal.logs},
        "rotors": [
            {"name": rotor.name, "spin": rotor.spin, "position_m": _position(rotor, proposal.airframe)}
            for rotor in (proposal.airframe.rotors if proposal.airframe else ())
        ],
        "asked": list(asked),
        "warnings": list(proposal.warnings),
    }


def _grounds(entry: Guess | KeyChoice) -> dict[str, Any]:
    rivals = [{"text": rival.text, "reason": rival.reason} for rival in entry.rivals]
    return {"certainty": entry.sure, "reason": entry.reason, "rivals": rivals}


def _columns(columns: ColumnMap) -> dict[str, Any]:
    return {
        "columns": list(columns.columns),
        "unit": columns.unit,
        "sign": None if columns.sign is None else list(columns.sign),
        "scale": columns.scale,
        "offset": columns.offset,
        **({} if columns.mixer is None else {"mixer": [list(row) for row in columns.mixer]}),
    }


def _position(rotor: RotorPlace, airframe: Airframe | None) -> list[float] | None:
    if airframe is None or not airframe.in_metres:
        return None
    return [round(value, 6) + 0.0 for value in (*rotor.direction, rotor.height_m)]


def guessed_keys(proposal: Proposal) -> tuple[str, ...]:
    """List the keys of the config whose values the log neither states nor shows."""
    airframe = proposal.airframe
    rotors = ("vehicle.rotors",) if airframe is not None and airframe.sure not in ("stated", "data") else ()
    signals = (f"import.signals.{guess.signal}" for guess in proposal.signals if guess.sure == "guess")
    choices = (f"import.{choice.key}" for choice in proposal.choices if choice.sure == "guess")
    largest = ("vehicle.rotor_speed_max_rad_s",) if proposal.share_of_speed else ()
    return (*rotors, *largest, *choices, *signals)


def config_text(made: Proposed) -> str:
    """Write the config, with the reason of every guess above it."""
    plain = Environment(
        loader=FileSystemLoader(TEMPLATES), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    plain.filters.update(flow=_flow, comment=_comment, number=number)
    known = {
        "ASK": ASK,
        "DECIDES_ROTORS": DECIDES_ROTORS,
        "capitalised": capitalised,
        "signal_lines": lambda guess: "\n".join(_signal(guess)),
    }
    usual = [(kind, own) for kind in USUAL if (own := usual_airframe(kind, 4)) is not None]
    return plain.get_template("init.yaml.j2").render(r=made, usual_airframes=usual, **known)


def _comment(text: str, indent: int) -> str:
    start = f"{' ' * indent}# "
    lines = textwrap.wrap(text, _WIDTH - len(start), break_long_words=False, break_on_hyphens=False)
    return "".join(f"{start}{line}\n" for line in lines)


def _rotor(rotor: RotorPlace | None, airframe: Airframe | None, stated: Stated) -> str:
    is_guess = airframe is not None and airframe.is_asked
    position = None if rotor is None else _position(rotor, airframe)
    spin = ASK if rotor is None or rotor.spin == 0 else str(rotor.spin)
    entry = (
        f"    - {{position_m: {ASK if position is None or is_guess else _flow(position)},"
        f" spin: {ASK if is_guess else spin},"
        f" thrust_factor_n_s2: {_flow(stated.thrust_factor_n_s2)},"
        f" drag_factor_n_m_s2: {_flow(stated.drag_factor_n_m_s2)}}}"
    )
    if rotor is None:
        return entry
    where = rotor.name
    if position is None:
        x, y = (f"{value:.3g} a" if value else "0.0" for value in rotor.direction)
        where = f"{where}: [{x}, {y}, 0.0]"
    elif is_guess:
        where = f"{where}: {_flow(position)}"
    if is_guess:
        where = f"perhaps {where}, spin {spin}"
    return f"{entry}  # {where}" if where else entry


def _signal(guess: Guess) -> Iterator[str]:
    columns = guess.columns
    entries = _entries(columns)
    if not columns.required:
        entries["required"] = False
    line = f"    {guess.signal}: {_flow(entries)}"
    if len(line) <= _WIDTH and not columns.otherwise:
        yield line
        return
    yield f"    {guess.signal}:"
    for key, value in entries.items():
        line = f"      {key}: {_flow(value)}"
        if len(line) <= _WIDTH or not isinstance(value, list):
            yield line
        else:
            yield f"      {key}:"
            yield from (f"        - {_flow(item)}" for item in value)
    if columns.otherwise:
        yield "      otherwise:"
        yield from (f"        - {_flow(_entries(other))}" for other in columns.otherwise)


def _entries(columns: ColumnMap) -> dict[str, Any]:
    entries: dict[str, Any] = {"columns": list(columns.columns), "unit": columns.unit}
    if columns.sign is not None:
        entries["sign"] = [int(sign) for sign in columns.sign]
    entries |= {"scale": columns.scale} if columns.scale != 1.0 else {}
    entries |= {"offset": columns.offset} if columns.offset != 0.0 else {}
    entries |= {"mixer": [list(row) for row in columns.mixer]} if columns.mixer is not None else {}
    return entries


def _flow(value: Any) -> str:
    """Write a value on one line of YAML."""
    match value:
        case Mapping():
            return "{" + ", ".join(f"{key}: {_flow(item)}" for key, item in value.items()) + "}"
        case list() | tuple():
            return "[" + ", ".join(_flow(item) for item in value) + "]"
        case str():
            is_word = _PLAIN.fullmatch(value) and value == value.strip()
            needs_quotes = not is_word or value.lower() in ("true", "false", "null")
            return json.dumps(value, ensure_ascii=False) if needs_quotes else value
        case _:
            return json.dumps(value)
