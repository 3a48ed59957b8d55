"""Reader of ArduPilot's DataFlash logs, binary or text: messages that describe themselves, each with own stamps."""

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from math import nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.topics import STAMP, YAW_RESETS
from cpfls_cli.logs.formats import DATAFLASH_MAGIC, DATAFLASH_TEXT_MAGIC, SDLOG2_MAGIC, TABLE_ENDS, LogContents
from cpfls_cli.logs.records import bytes_of, date, numbers, plain, seconds, stamps_while, table, undone_turns
from cpfls_cli.logs.sdlog2 import is_sdlog2, of_messages
from cpfls_cli.rotations import wrapped

_HEAD = b"\xa3\x95"
_OF_FORMATS = 0x80
# Name that the head of a message has in a record; no field may have it.
_BEFORE = "(head)"
_FORMAT = np.dtype([("", "V3"), ("kind", "u1"), ("length", "u1"), ("name", "S4"), ("types", "S16"), ("fields", "S64")])
# Letter of a type to its place in memory and the factor that the letter implies.
_NUMBERS = {
    **{own[0]: (own[1:], 1.0) for own in ("bi1", "Bu1", "Mu1", "hi2", "Hu2", "ii4", "Iu4", "qi8", "Qu8")},
    **{own[0]: (own[1:], 1.0) for own in ("gf2", "ff4", "df8")},
    **{own[0]: (own[1:], 0.01) for own in ("ci2", "Cu2", "ei4", "Eu4")},
    "L": ("i4", 1e-7),
}
_WHOLE = "bBhHiIqQ"
_OF_TEXT: dict[str, Callable[[str], float | bytes]] = {"i": int, "f": float, "S": lambda text: text.encode("latin-1")}
_OTHERS = {"n": "S4", "N": "S16", "Z": "S64", "a": "V64"}
_STAMPS = {"TimeUS": 10**6, "TimeMS": 10**3, "T": 10**3}
# Kinds that are stamped as what comes before them, where they have no stamps of their own: to Copter 3.2.
_EVENTS = frozenset(("EV", "ERR", "MODE", "MSG"))
# Bytes at the beginning of a file among which the first description of a kind is sought: a log may begin within a
# message, and one in text with what the console says.
_HEAD_BYTES = 65536
_NO_STAMPS = (
    "its attitude and outputs have no time stamps, as ArduCopter to 3.1 logs them, so nothing can be computed from"
    " them; later versions stamp all messages"
)
# Of 1980-01-06, less the 18 leap seconds since.
_GPS_BEGAN, _WEEK_S = 315_964_800 - 18, 604_800
_INSTANCE, _INSTANCES = "#", ("I", "Instance", "C", "IMU")  # And fields that hold it where no unit says so.
_MOST_INSTANCES = 16
_NO_FACTOR = "-?0"
# Events of Copter: the estimated yaw is reset; what ends a stand on the ground, and a flight.
_YAW_RESET, _TAKES_OFF, _LANDS = 62, (28,), (11, 18)
# The attitude is logged 10 times a second; below this, rad, its stamps and the gyroscope's make such turns as well.
_RESET_WITHIN_S, _LEAST_TURN = 0.25, 0.05
_AROUND_S, _BEYOND = 2.0, 4.0  # And the multiple of what is usual about it.
_MOST_RESETS = 100  # Of a log that is not damaged.
_SCALED = "cCeEL"
# Our names of units that ArduPilot calls otherwise.
_UNITS = {"m/s/s": "m/s^2", "degheading": "deg", "RPM": "rpm", "PWM": "us"}


class _Kind(NamedTuple):
    """One kind of message: its name, the letters of its fields' types, and where the messages begin."""

    name: str
    letters: dict[str, str]
    record: np.dtype
    begins: list[int]
    text: bool = False

    @property
    def stamp(self) -> str:
        """Name of the field of the stamps; empty where there is none."""
        # In a record with a week, TimeMS is that of GPS, and the log's own clock is T.
        names = ("T",) if {"Week", "TimeMS", "T"} <= self.letters.keys() else ("TimeUS", "TimeMS")
        return next((name for name in names if self.letters.get(name) in ("I", "Q")), "")


def contents(path: Path, wanted: Collection[str] | None = None) -> LogContents:
    """Read all messages, ``MESSAGE.field`` or ``MESSAGE[instance].field``; a part of them takes no less time."""
    del wanted
    content = bytes_of(path)
    text = re.search(rb"^" + DATAFLASH_TEXT_MAGIC, content[:_HEAD_BYTES], re.MULTILINE)
    if DATAFLASH_MAGIC in content[:_HEAD_BYTES] or content.startswith(SDLOG2_MAGIC):
        kinds, lost = _find_messages(content, max(content[:_HEAD_BYTES].find(DATAFLASH_MAGIC), 0))
        tables = {kind.name: table(content, kind.begins, kind.record) for kind in kinds.values() if kind.begins}
    elif text is not None:
        kinds, tables, lost = _read_lines(content[text.start() :])
    else:
        raise InputError(
            f"{path}: not a DataFlash log: it does not start like one (encrypted, or of another kind?); {TABLE_ENDS}"
        )
    return _of_tables(path, kinds, tables, _stated_units(tables, kinds), lost)


def exported(path: Path, variables: Mapping[str, Any]) -> LogContents | None:
    """Read messages that a ground station made variables of MATLAB; None where no variables are messages.

    A structure has a vector for each field; or a matrix, of each instance with its number behind the name, has a column
    for each, which another variable names.
    """
    kinds: dict[int, _Kind] = {}
    tables: dict[str, np.ndarray] = {}
    stated: dict[str, dict[str, str]] = {}
    for name, fields in _exported(variables).items():
        stamps = np.atleast_1d(fields["TimeUS"])
        if stamps.dtype.kind not in "iuf" or stamps.ndim != 1 or not len(stamps) or not np.isfinite(stamps).all():
            continue
        own = {each: np.atleast_1d(values) for each, values in fields.items()}
        own = {
            each: values
            for each, values in own.items()
            if values.shape == stamps.shape and values.dtype.kind in "iufUO"
        }
        numbers = {"i": "q", "u": "q", "f": "d"}
        letters = {each: numbers.get(values.dtype.kind, "Z") for each, values in own.items()}
        # A matrix has all numbers alike, and I is an integral too.
        instances = [each for each in _INSTANCES if each in own and np.isin(own[each], range(_MOST_INSTANCES)).all()]
        letters |= dict.fromkeys(instances, "q") | {"TimeUS": "Q"}
        record = np.dtype([(each, "S64" if letter == "Z" else _NUMBERS[letter][0]) for each, letter in letters.items()])
        tables[name] = np.empty(len(stamps), dtype=record)
        for each, values in own.items():
            texts = letters[each] == "Z"
            tables[name][each] = (
                [str(value).strip().encode("latin-1", "replace") for value in values] if texts else values
            )
        kinds[len(kinds)] = _Kind(name, letters, record, [*range(len(stamps))], text=True)
        stated[name] = dict.fromkeys(instances, _INSTANCE)
    return _of_tables(path, kinds, tables, stated, 0) if "ATT" in tables or "IMU" in tables else None


def _exported(variables: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    messages: dict[str, Mapping[str, Any]] = {}
    messages |= {name: own for name, own in variables.items() if isinstance(own, dict) and "TimeUS" in own}
    for label in (own for own in variables if own.endswith("_label")):
        name, fields = label.removesuffix("_label"), [str(own) for own in np.ravel(variables[label])]
        parts = [own for each, own in variables.items() if re.fullmatch(rf"{re.escape(name)}(_\d+)?", each)]
        parts = [own for own in parts if isinstance(own, np.ndarray) and own.shape[1:] == (len(fields),)]
        if parts and "TimeUS" in fields:
            rows = np.concatenate(parts)
            order = np.argsort(rows[:, fields.index("TimeUS")], kind="stable")
            messages[name] = dict(zip(fields, rows[order].T, strict=True))
    return messages


def _of_tables(
    path: Path,
    kinds: Mapping[int, _Kind],
    tables: Mapping[str, np.ndarray],
    stated: Mapping[str, Mapping[str, str]],
    lost: int,
) -> LogContents:
    stamps = _all_stamps(kinds, tables)
    topics = {
        topic: fields
        for kind in kinds.values()
        if kind.name in tables and kind.name in stamps
        for topic, fields in _topics(kind, tables[kind.name], stamps[kind.name], stated.get(kind.name, {}))
    }
    if not topics and is_sdlog2(tables):
        places = {kind.name: kind.begins for kind in kinds.values() if kind.begins}
        return of_messages(path, places, tables, _parameters(tables))
    if topics.keys() <= {"GPS", *_EVENTS} and "ATT" in tables:
        raise InputError(f"{path}: {_NO_STAMPS}")
    if not topics:
        raise InputError(f"{path}: holds no messages with time stamps (TimeUS)")
    origin = min(fields[STAMP][0] for fields in topics.values())
    for fields in topics.values():
        # Whole microseconds again: a difference of two large numbers of seconds is none.
        fields[STAMP] = np.round(fields[STAMP] - origin, 6)
    _undo_yaw_resets(topics)
    units = {
        f"{topic}.{each}": unit
        for topic, fields in topics.items()
        for each, unit in stated.get(topic.partition("[")[0], {}).items()
        if each in fields and unit != _INSTANCE
    }
    broken = f"{lost} bytes belong to no message: the file is damaged in places; what could be read is used"
    texts = (plain(_text(own)) for (own,) in _rows(tables, "MSG", Message="S"))
    said = [(round(float(at - origin), 6), "", own) for at, own in zip(stamps.get("MSG", ()), texts, strict=False)]
    begins, flown_at = {"": float(origin)}, _flown_at(topics.get("GPS", {}))
    warnings = (broken,) if lost else ()
    return LogContents(topics, units, _parameters(tables), _system(tables), warnings, flown_at, begins, tuple(said))


def _undo_yaw_resets(topics: dict[str, dict[str, Array]]) -> None:
    """Turn attitudes, and those asked for, to the yaw that the estimator holds in flight.

    ArduPilot says when it resets its yaw, and not by how much: by what the attitude turns there beyond the gyroscope.
    """
    event, attitude, gyro = (topics.get(name, {}) for name in ("EV", "ATT", "IMU"))
    known = event.keys() >= {"Id"} and attitude.keys() >= {"Roll", "Pitch", "Yaw"} and gyro.keys() >= {"GyrY", "GyrZ"}
    if not known or min(len(attitude[STAMP]), len(gyro[STAMP])) < 2:
        return
    time, read = attitude[STAMP], gyro[STAMP]
    roll, pitch, yaw = (np.radians(attitude[name]) for name in ("Roll", "Pitch", "Yaw"))
    leant, nose = (np.interp(read, time, own) for own in (roll, pitch))
    rate = np.nan_to_num((gyro["GyrY"] * np.sin(leant) + gyro["GyrZ"] * np.cos(leant)) / np.cos(nose))
    turned = np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(read)))
    beyond = np.asarray(wrapped(np.diff(yaw) - np.diff(np.interp(time, read, turned))))
    sizes, turns = np.abs(beyond), []
    for at in np.unique(event[STAMP][event["Id"] == _YAW_RESET])[:_MOST_RESETS]:
        away = np.maximum(time[:-1] - at, at - time[1:])
        near = np.flatnonzero(away <= _RESET_WITHIN_S)
        # What late stamps or vibration make about it is as large.
        least = max(_LEAST_TURN, _BEYOND * float(np.median(sizes[away <= _AROUND_S]))) if len(near) else np.inf
        turns += [(-sizes[row], away[row], float(at), int(row)) for row in near if sizes[row] > least]
    marked: dict[int, float] = {}
    for _, _, at, row in sorted(turns):
        # Each event is of a turn of its own.
        if row not in marked and at not in marked.values():
            marked[row] = at
    kept = np.array(sorted(marked), dtype=int)
    if len(kept):
        topics[YAW_RESETS] = {STAMP: time[kept + 1], "turn": beyond[kept]}
        takes_off, lands = (np.isin(event["Id"], own) for own in (_TAKES_OFF, _LANDS))
        aloft = stamps_while(time, event[STAMP][takes_off | lands], takes_off[takes_off | lands])
        undone = np.degrees(undone_turns(time, time[kept + 1], beyond[kept], aloft))
        for name in {"Yaw", "DesYaw"} & attitude.keys():
            attitude[name] = (attitude[name] + undone) % 360.0


def _all_stamps(kinds: Mapping[int, _Kind], tables: Mapping[str, np.ndarray]) -> dict[str, Array]:
    """Give the stamps of messages by kind, s; events without any have those of what was written before them."""
    held = [kind for kind in kinds.values() if kind.name in tables]
    stamps = {kind.name: seconds(tables[kind.name][kind.stamp], 0, _STAMPS[kind.stamp]) for kind in held if kind.stamp}
    late = [kind for kind in held if not kind.stamp and kind.name in _EVENTS]
    if late and stamps:
        places = np.concatenate([np.asarray(kind.begins) for kind in held if kind.stamp])
        order, given = np.argsort(places), np.concatenate([*stamps.values()])
        for kind in late:
            before = np.maximum(np.searchsorted(places[order], kind.begins) - 1, 0)
            stamps[kind.name] = given[order][before]
    return stamps


def _find_messages(content: bytes, place: int) -> tuple[dict[int, _Kind], int]:
    """Note where each message begins, by kind, and count the bytes between messages that are none."""
    kinds = {_OF_FORMATS: _Kind("FMT", {}, _FORMAT, [])}
    lost = place
    while 0 <= place < len(content) - 2:
        kind = kinds.get(content[place + 2]) if content.startswith(_HEAD, place) else None
        end = place + (kind.record.itemsize if kind else 0)
        if kind is None or not (content.startswith(_HEAD, end) or len(content) - end < len(_HEAD)):
            following = content.find(_HEAD, place + 1)
            lost += following - place if following >= 0 else 0
            place = following
            continue
        if end > len(content):
            # The last message is cut off, as the power was.
            break
        kind.begins.append(place)
        if kind.name == "FMT":
            (own,) = np.frombuffer(content[place:end], _FORMAT)
            letters, names = own["types"].decode("latin-1"), own["fields"].decode("latin-1").split(",")
            described = _described(own["name"].decode("latin-1"), letters, names, text=False)
            if own["kind"] not in kinds and described is not None and described.record.itemsize == own["length"]:
                kinds[int(own["kind"])] = described
        place = end
    return kinds, lost


def _described(name: str, letters: str, names: list[str], *, text: bool) -> _Kind | None:
    """Make a kind of message of its description; None of one that contradicts itself."""
    known = {*letters} <= {*_NUMBERS, *_OTHERS}
    if not known or len(names) != len(letters) or len({"", _BEFORE, *names}) != len(names) + 2:
        return None
    if text:
        # A mode is written as its name.
        places = ["S64" if letter in {*_OTHERS, "M"} else "i8" if letter in _WHOLE else "f8" for letter in letters]
        fields = list(zip(names, places, strict=True))
    else:
        places = [f"<{_NUMBERS[letter][0] if letter in _NUMBERS else _OTHERS[letter]}" for letter in letters]
        fields = [(_BEFORE, "V3"), *zip(names, places, strict=True)]
    return _Kind(name, dict(zip(names, letters, strict=True)), np.dtype(fields), [], text)


def _read_lines(content: bytes) -> tuple[dict[int, _Kind], dict[str, np.ndarray], int]:
    """Read a log that was written or turned into text: its kinds, their messages as tables, and the bytes of others."""
    kinds: dict[int, _Kind] = {}
    rows: dict[str, list[tuple[float | bytes, ...]]] = {}
    named: dict[str, _Kind] = {}
    lost = 0
    for place, line in enumerate(content.decode("latin-1").splitlines()):
        name, *fields = (each.strip() for each in line.split(","))
        kind = named.get(name)
        if name == "FMT" and len(fields) > 4 and fields[0].isdecimal():
            described = _described(fields[2], fields[3], fields[4:], text=True)
            if described is not None and int(fields[0]) != _OF_FORMATS and described.name not in named:
                kinds[int(fields[0])] = named[described.name] = described
        elif kind is None or (values := _values(kind, fields)) is None:
            lost += len(line)
        else:
            rows.setdefault(name, []).append(values)
            kind.begins.append(place)
    tables = {name: np.array(own, dtype=named[name].record) for name, own in rows.items()}
    return kinds, tables, lost


def _values(kind: _Kind, fields: list[str]) -> tuple[float | bytes, ...] | None:
    """Read the fields of a line; a comma in the text at its end is part of the text."""
    places = [place.kind for place, *_ in (kind.record.fields or {}).values()]
    if places[-1] == "S" and len(fields) > len(places):
        fields = [*fields[: len(places) - 1], ", ".join(fields[len(places) - 1 :])]
    if len(fields) != len(places):
        return None
    try:
        return tuple(_OF_TEXT[place](text) for place, text in zip(places, fields, strict=True))
    except ValueError:
        return None


def _topics(
    kind: _Kind, samples: np.ndarray, stamps: Array, units: Mapping[str, str]
) -> Iterator[tuple[str, dict[str, Array]]]:
    """Give the numbers of one kind of message, each instance of it a topic."""
    instance = next((each for each, unit in units.items() if unit == _INSTANCE), None)
    for number in np.unique(samples[instance]).tolist() if instance else [0]:
        rows = samples[instance] == number if instance else slice(None)
        own = samples[rows]
        yield (
            f"{kind.name}[{number}]" if number else kind.name,
            {
                STAMP: np.array(stamps[rows]),
                **{
                    each: (1.0 if kind.text else _NUMBERS[letter][1]) * numbers(own[each])
                    for each, letter in kind.letters.items()
                    if letter in _NUMBERS and each != kind.stamp and samples.dtype[each].kind != "S"
                },
            },
        )


def _stated_units(tables: Mapping[str, np.ndarray], kinds: Mapping[int, _Kind]) -> dict[str, dict[str, str]]:
    """Look up the units that the log states, by kind and field, of fields that need no further factor to be in them."""
    # Logs of before 3.6 state none.
    labels = {chr(int(letter) % 256): _text(label) for letter, label in _rows(tables, "UNIT", Id="iu", Label="S")}
    described = _rows(tables, "FMTU", FmtType="iu", UnitIds="S", MultIds="S")
    stated = {int(number): (_text(units), _text(factors)) for number, units, factors in described}
    labels = {letter: _UNITS.get(label, label) for letter, label in labels.items()} | {_INSTANCE: _INSTANCE}
    return {
        kind.name: {
            each: labels[unit]
            for (each, letter), unit, factor in zip(kind.letters.items(), *stated[number], strict=False)
            if labels.get(unit) and (factor in _NO_FACTOR or letter in _SCALED)
        }
        for number, kind in kinds.items()
        if number in stated
    }


def _flown_at(fields: Mapping[str, Array]) -> float:
    """Compute the time at which the log begins from the weeks and seconds of GPS."""
    for week, since in (("GWk", "GMS"), ("Week", "TimeMS")):
        if week in fields and since in fields:
            begins = _GPS_BEGAN + _WEEK_S * fields[week] + 1e-3 * fields[since] - fields[STAMP]
            return next((at for at in map(date, begins[fields[week] > 0]) if np.isfinite(at)), nan)
    return nan


def _parameters(tables: Mapping[str, np.ndarray]) -> dict[str, float | str]:
    parameters: dict[str, float | str] = {}
    for name, value in _rows(tables, "PARM", Name="S", Value="fiu"):
        # As the log begins.
        parameters.setdefault(_text(name), float(value))
    return parameters


def _system(tables: Mapping[str, np.ndarray]) -> str:
    for (said,) in _rows(tables, "MSG", Message="S"):
        program = re.match(r"(?:APM:)?(\w+) [Vv](\d[\w.]*)", _text(said))
        if program:
            name = program[1] if program[1].startswith("Ardu") else f"Ardu{program[1]}"
            return f"{name} {program[2]}"
    return ""


def _rows(tables: Mapping[str, np.ndarray], name: str, **kinds: str) -> Iterator[tuple[Any, ...]]:
    """Give some fields of each message of a kind; none where a damaged log describes them as something else."""
    table = tables.get(name)
    if table is not None and all(
        field in (table.dtype.names or ()) and table.dtype[field].kind in kind for field, kind in kinds.items()
    ):
        yield from zip(*(table[field] for field in kinds), strict=True)


def _text(field_of: bytes) -> str:
    return field_of.decode("latin-1")
