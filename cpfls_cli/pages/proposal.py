"""What a log is taken for: the answer of `cpfls init`, and the commented config that it writes."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any, Final

from cpfls_cli.config.load import ASK, how_to_fill_in
from cpfls_cli.flightlog.airframe import Airframe, RotorPlace, usual_airframe
from cpfls_cli.flightlog.layouts import USUAL
from cpfls_cli.flightlog.proposal import DECIDES_ROTORS, Proposal
from cpfls_cli.flightlog.recognised import Guess, KeyChoice
from cpfls_cli.flightlog.settings import ROTORS, ColumnMap
from cpfls_cli.flightlog.stated_vehicle import FAST_HZ, log_faster
from cpfls_cli.report.content import Block, Cell, Folded, Table, Text
from cpfls_cli.report.numbers import number
from cpfls_cli.words import capitalised, joined

_WIDTH = 110
_SURE: Final = {"data": "the data", "named": "its name", "guess": "a guess"}
_SPINS: Final = {1: "ccw", -1: "cw", 0: "turning an unknown way"}
_ORDER: Final = ("body_frame", "world_frame", "quaternion_order", "acceleration_frame", "rotor_command_is")
_FASTEST_HZ, _RATE_HZ, _LOWPASS_HZ = 500.0, 250.0, 60.0


@dataclass(frozen=True)
class Stated:
    """What the person who asks knows of the vehicle; what is None is not known, and for `cpfls vehicle` to find."""

    mass_kg: float | None = None
    arm_m: float | None = None
    inertia_kg_m2: tuple[float, float, float] | None = None
    thrust_factor_n_s2: float | None = None
    drag_factor_n_m_s2: float | None = None
    scale_to_arm: bool = False

    @property
    def knows_constants(self) -> bool:
        """Whether it is any of what `cpfls vehicle` finds."""
        return (self.inertia_kg_m2, self.thrust_factor_n_s2, self.drag_factor_n_m_s2) != (None, None, None)


def asked_keys(proposal: Proposal, stated: Stated) -> tuple[str, ...]:
    """List the keys of the config that only a person can fill in."""
    keys = [] if stated.mass_kg is not None else ["vehicle.mass_kg"]
    airframe = proposal.airframe
    if not proposal.rotors:
        keys.append("vehicle.rotors")
    for index in range(proposal.rotors):
        if airframe is None or airframe.is_asked or not airframe.in_metres:
            keys.append(f"vehicle.rotors.{index}.position_m")
        if airframe is None or airframe.is_asked or airframe.rotors[index].spin == 0:
            keys.append(f"vehicle.rotors.{index}.spin")
    return tuple(keys)


def answer(proposal: Proposal, stated: Stated, output: str) -> Iterator[Block]:
    """Say what every column is taken for and why, what was cut, what is asked, and what comes next."""
    several = len(proposal.logs) > 1
    names = f"{len(proposal.logs)} logs" if several else proposal.logs[0].name
    topic = _topic(proposal)
    yield Text("; ".join([names, *proposal.facts, *([f"columns of {topic}"] if topic else [])]))
    short = [_short_row(guess, topic) for guess in proposal.signals]
    yield Table("signals", "", ("Signal", "Columns", "Unit"), short, frozenset(range(3)))
    if proposal.choices:
        chosen = (f"{choice.key} {choice.value}{_guessed(choice)}" for choice in proposal.choices)
        yield Text(", ".join(chosen))
    yield Text(_rotors_in_words(proposal))
    why = [] if proposal.airframe is None else [Text(f"rotors: {proposal.airframe.reason}")]
    yield Folded("the reason of each guess", [_reasons_table(proposal), *why])
    yield from (Text(warning, "warning", always=True) for warning in proposal.warnings)
    named = [(guess.signal, guess.rivals) for guess in proposal.signals]
    for name, rivals in [*named, *((choice.key, choice.rivals) for choice in proposal.choices)]:
        for rival in rivals:
            other = (
                f"{rival.text} if it is wrong" if rival.text.startswith("leave ") else f"it may also be {rival.text}"
            )
            yield Text(f"{name}: a guess; {other}: {rival.reason}", "warning")
    cut: list[Text] = []
    for one in proposal.logs:
        prefix = f"{one.name}: " if several else ""
        reasons = one.recognition.flown.cut or ("all of it is flight, nothing is cut",)
        cut += [Text(f"{prefix}{reason}") for reason in reasons]
        cut += [Text(f"{prefix}not mapped: {words}", "note") for words in one.recognition.left_out]
        cut += [Text(f"{prefix}not used: {words}", "note") for words in _by_topic(one.recognition.unused)]
    yield Folded("what is cut or not mapped", cut)
    asked = asked_keys(proposal, stated)
    if asked:
        # Last, since the commands that follow it refuse the config until it is done.
        side = None if stated.arm_m is None else f"{stated.arm_m / sqrt(2):.3g}"
        known = {} if side is None else {"position_m": f"[{side}, -{side}, 0.0]"}
        how = how_to_fill_in(asked, brief=True, **known)
        yield Text(f"first edit {output}: write {_asked_words(asked)} in place of {ASK}{how}")


def _by_topic(names: Sequence[str]) -> Iterator[str]:
    """List columns, those of each topic by themselves, and those that differ in a number alone as one."""
    topics: dict[str, dict[str, list[str]]] = {}
    for name in names:
        topic, dot, _ = name.partition(".")
        same = topics.setdefault(topic if dot else "", {})
        same.setdefault(re.sub(r"\d+(?=\]?$)", "*", name), []).append(name)
    for same in topics.values():
        yield ", ".join(_in_braces(own) for own in same.values())


def _topic(proposal: Proposal) -> str:
    """Name the topic of all columns; empty where there are several."""
    names = [column for guess in proposal.signals for column in guess.columns.columns]
    topics = {name.partition(".")[0] for name in names if name.count(".") > 1}
    return topics.pop() if len(topics) == 1 and all(name.count(".") > 1 for name in names) else ""


def _short_row(guess: Guess, topic: str) -> list[str | Cell]:
    columns = [name.removeprefix(f"{topic}.") for name in guess.columns.columns]
    return [guess.signal, _in_braces(columns), f"{_unit(guess.columns)}{_guessed(guess)}"]


def _guessed(entry: Guess | KeyChoice) -> str:
    return " (a guess)" if entry.sure == "guess" else ""


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


def _reasons_table(proposal: Proposal) -> Table:
    rows = [
        _row(guess.signal, ", ".join(guess.columns.columns), _unit(guess.columns), guess) for guess in proposal.signals
    ]
    rows += [_row(choice.key, choice.value, "", choice) for choice in proposal.choices]
    header = ("Signal or key", "Columns or value", "Unit", "Told by", "Why")
    return Table("reasons", "", header, rows, frozenset(range(4)), frozenset({1, 4}))


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


def _row(name: str, value: str, unit: str, entry: Guess | KeyChoice) -> list[str | Cell]:
    return [name, value, unit, Cell(_SURE[entry.sure], "warning" if entry.sure == "guess" else "plain"), entry.reason]


def _unit(columns: ColumnMap) -> str:
    scale = "" if columns.scale == 1.0 else f" x {number(columns.scale, 4)}"
    offset = "" if columns.offset == 0.0 else f" {'+' if columns.offset > 0 else '-'} {number(abs(columns.offset), 4)}"
    sign = "" if columns.sign is None else f", sign {' '.join('+' if s > 0 else '-' for s in columns.sign)}"
    mixed = "" if columns.mixer is None else f", mixed for {len(columns.mixer)} rotors"
    return f"{columns.unit}{scale}{offset}{sign}{mixed}"


_SURFACE: Final = re.compile(r"aileron|elevator|rudder|elevon")


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
            "neither parameters nor the motion say where they are; a log with more motion, given beside this one, may"
        )
        return f"{proposal.rotors} rotors{more}; {unknown}"
    places = ", ".join(
        f"M{index} {rotor.name or 'at its place'} {_SPINS[rotor.spin]}"
        for index, rotor in enumerate(proposal.airframe.rotors, start=1)
    )
    return f"rotors{', a guess' if proposal.airframe.is_guess else ''}: {places}{more}"


def summary(proposal: Proposal, stated: Stated, output: str) -> dict[str, Any]:
    """Give the proposal for machines."""
    return {
        "output": output,
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
        "asked": list(asked_keys(proposal, stated)),
        "warnings": list(proposal.warnings),
    }


def _grounds(entry: Guess | KeyChoice) -> dict[str, Any]:
    rivals = [{"text": rival.text, "reason": rival.reason} for rival in entry.rivals]
    return {"told_by": entry.sure, "reason": entry.reason, "rivals": rivals}


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


def config_text(proposal: Proposal, stated: Stated) -> str:
    """Write the config, with the reason of every guess above it."""
    names = ", ".join(one.name for one in proposal.logs)
    lines = [
        *_comment(f"Proposed by `cpfls init` from {names}{''.join(f'; {fact}' for fact in proposal.facts)}.", 0),
        "# The reason of every guess stands above it; what is wrong can be changed here.",
        "seed: 1",
        "",
        "vehicle:",
        *_vehicle(proposal, stated),
        "",
        "import:",
        *_import(proposal),
    ]
    return "\n".join(lines) + "\n"


def _vehicle(proposal: Proposal, stated: Stated) -> Iterator[str]:
    if stated.mass_kg is None:
        yield from _comment("In kg, as it flew, with battery: no log states it.", 2)
    yield f"  mass_kg: {ASK if stated.mass_kg is None else _flow(stated.mass_kg)}"
    if None in (stated.inertia_kg_m2, stated.thrust_factor_n_s2, stated.drag_factor_n_m_s2):
        yield from _comment("null: not known; `cpfls vehicle` finds what the flights determine.", 2)
    yield f"  inertia_kg_m2: {_flow(stated.inertia_kg_m2 and list(stated.inertia_kg_m2))}"
    if proposal.share_of_speed:
        yield from _comment(
            "The commands are shares of the largest speed, which the log does not state: with a different number here "
            "the thrust factor comes out different, but the thrust the same.",
            2,
        )
    yield f"  rotor_speed_max_rad_s: {_flow(proposal.speed_max)}"
    yield from _rotors(proposal, stated)


def _rotors(proposal: Proposal, stated: Stated) -> Iterator[str]:
    if not proposal.rotors:
        states = "states a torque and no rotors" if proposal.states_torque else "has no columns of rotors"
        yield from _comment(f"The log {states}; the vehicle has some all the same, in its order, one line each:", 2)
        yield f"  #{_rotor(None, None, stated)[3:]}"
        yield f"  rotors: {ASK}"
        return
    airframe = proposal.airframe
    if airframe is None:
        yield from _comment(
            "Neither parameters nor the motion say where the rotors are: x forward, y left, z up from the centre of"
            " mass, in m; spin 1 turns counter-clockwise seen from above, -1 clockwise.",
            2,
        )
        if proposal.rotors == 4:
            frames = ((kind, usual_airframe(kind, 4)) for kind in USUAL)
            usual = (
                f"{kind}: {', '.join(f'{rotor.name} {rotor.spin}' for rotor in own.rotors)}"
                for kind, own in frames
                if own is not None
            )
            yield from _comment(f"Four in an X are usually, from M1 to M4, in {'; in '.join(usual)}.", 2)
    else:
        if airframe.is_asked:
            yield from _comment(f"Not known. A guess from {airframe.reason}; {DECIDES_ROTORS}.", 2)
        elif airframe.is_guess:
            yield from _comment(f"A guess, order and directions: {airframe.reason}; {DECIDES_ROTORS}.", 2)
        else:
            yield from _comment(f"Told by {airframe.reason}.", 2)
        if airframe.moment_ratio_m:
            yield from _comment(
                f"The parameters state a drag factor of {number(airframe.moment_ratio_m, 3)} m times the thrust factor;"
                " often a number that nobody measured.",
                2,
            )
        if airframe.scaled and stated.arm_m is not None:
            yield from _comment(
                f"Placed for an arm of {stated.arm_m:g} m; measured x, y and z are better: torques go with"
                " them, and so do the moments of inertia that are found.",
                2,
            )
        if not airframe.in_metres:
            yield from _comment(
                "In m from the centre of mass, x forward, y left, z up; a is the distance from the middle to a rotor,"
                " which `cpfls init --arm` fills in.",
                2,
            )
    yield "  rotors:"
    for index in range(proposal.rotors):
        yield _rotor(None if airframe is None else airframe.rotors[index], airframe, stated)


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


def _import(proposal: Proposal) -> Iterator[str]:
    first = proposal.first
    yield f"  time_column: {_flow(proposal.time_column)}"
    yield f"  time_unit: {proposal.time_unit}"
    choices = {choice.key: choice for choice in proposal.choices}
    for key in _ORDER:
        if key in choices:
            yield from _entry(choices[key], [f"  {key}: {choices[key].value}"], 2)
    yield "  signals:"
    for guess in proposal.signals:
        yield from _entry(guess, list(_signal(guess)), 4)
    if proposal.states_torque:
        yield "  torque_source: column"
    else:
        yield from _comment(
            "No torque is computed: `cpfls vehicle` works with the rotors. For `cpfls identify`, name rotor-speed or"
            " rotor-command here when the factors above are numbers.",
            2,
        )
        yield "  torque_source: null"
    alone = len(proposal.logs) == 1
    for one in proposal.logs:
        for reason in one.recognition.flown.cut:
            yield from _comment(reason if alone else f"{one.name}: {reason}", 2)
    if proposal.crop_s == "flown":
        yield from _comment("Each log is cut to what flies in it, a later one too; to s from the first stamp now:", 2)
        for name, crop in proposal.crops.items():
            yield f"  # {name}: {'all of it' if crop is None else f'[{crop[0]:g}, {crop[1]:g}]'}"
    yield f"  crop_s: {_flow(list(proposal.crop_s) if isinstance(proposal.crop_s, tuple) else proposal.crop_s)}"
    yield f"  gap_s: {_flow(proposal.gap_s)}"
    yield "  gap_rule: longest-part"
    if first.rate_hz > _FASTEST_HZ:
        yield from _comment(
            f"Logged at {first.rate_hz:.4g} Hz: the shaking of propellers is filtered away before the rate is lowered.",
            2,
        )
        yield f"  rate_hz: {_flow(_RATE_HZ)}"
        yield f"  lowpass_hz: {_flow(_LOWPASS_HZ)}"
    elif proposal.rate_hz is not None:
        yield from _comment("The logs are of several rates, and what learns from them takes flights of one.", 2)
        yield f"  rate_hz: {_flow(proposal.rate_hz)}"


def _entry(entry: Guess | KeyChoice, lines: Sequence[str], indent: int) -> Iterator[str]:
    words = f"A guess: {entry.reason}" if entry.sure == "guess" else capitalised(entry.reason)
    yield from _comment(f"{words}.", indent)
    yield from lines
    for rival in entry.rivals:
        yield from _comment(f"or {rival.text} ({rival.reason})", indent)


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


def _comment(text: str, indent: int) -> Iterator[str]:
    start = f"{' ' * indent}# "
    for line in textwrap.wrap(text, _WIDTH - len(start), break_long_words=False, break_on_hyphens=False):
        yield start + line


_PLAIN = re.compile(r"[A-Za-z_][\w./^ -]*")


def _flow(value: Any) -> str:
    """Write a value on one line of YAML."""
    match value:
        case Mapping():
            return "{" + ", ".join(f"{key}: {_flow(item)}" for key, item in value.items()) + "}"
        case list():
            return "[" + ", ".join(_flow(item) for item in value) + "]"
        case str():
            is_word = _PLAIN.fullmatch(value) and value == value.strip()
            needs_quotes = not is_word or value.lower() in ("true", "false", "null")
            return json.dumps(value, ensure_ascii=False) if needs_quotes else value
        case _:
            return json.dumps(value)
