"""Reader of bags of ROS 1, and of ROS 2, SQLite or MCAP: topics of messages, flattened to their numbers."""

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags import rosbag1
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.topics import STAMP, topic_and_field
from cpfls_cli.logs.formats import ROS1_MAGIC, LogContents
from cpfls_cli.logs.records import date, seconds

_NANOSECOND = 10**9
_MICROSECONDS = 1000
_SAME_CLOCK_S = 1.0
_SLOWEST = 20.0  # Times that a simulation may take as long, or as short, as real time; a stamp that stays is no clock.
_MOST_NUMBERS = 64
_WITHOUT_NUMBERS = re.compile(r"sensor_msgs/msg/(Image|CompressedImage|PointCloud2?)")
_STANDARD = re.compile(r"(sensor|geometry|nav)_msgs/msg/")
# REP 103 sets the units of standard messages.
_UNITS = (
    (re.compile(r"orientation\.[xyzw]$"), "1"),
    (re.compile(r"(angular|angular_velocity)\.[xyz]$"), "rad/s"),
    (re.compile(r"linear_acceleration\.[xyz]$"), "m/s^2"),
    (re.compile(r"linear\.[xyz]$"), "m/s"),
    (re.compile(r"(position|point|translation)\.[xyz]$"), "m"),
    (re.compile(r"^voltage$"), "V"),
)
_Path = tuple[str | int, ...]
_Reader = Reader | rosbag1.Reader


def contents(path: Path, wanted: Collection[str] | None = None) -> LogContents:
    """Read topics, ``/topic.field.of.message`` with the numbers of arrays one by one.

    Stamps are those of the sender, from the header or the field ``timestamp`` (microseconds, as PX4 sends it), and
    those of the recorder where there are none; ``timestamp_received`` is always the recorder's. Where a sender's clock
    runs at another pace, as a simulation's does, all stamps are put on it.
    """
    with path.open("rb") as stream:
        reader_of = rosbag1.Reader if stream.read(len(ROS1_MAGIC)) == ROS1_MAGIC else Reader
    try:
        with reader_of(path) as reader:
            return _read(path, reader, None if wanted is None else {topic_and_field(column)[0] for column in wanted})
    except InputError:
        raise
    except Exception as error:
        # SQLite, MCAP and compression each break in their own way.
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{path}: cannot be read as a bag of ROS: {reason}") from None


def _read(path: Path, reader: _Reader, wanted: set[str] | None) -> LogContents:
    topics: dict[str, dict[str, Array]] = {}
    units: dict[str, str] = {}
    read: dict[str, tuple[np.ndarray, dict[str, np.ndarray]]] = {}
    unknown, shifted, paced = [], [], []
    for topic, about in reader.topics.items():
        kind = about.msgtype or "of several types"
        if wanted is not None and topic not in wanted:
            topics[topic] = {STAMP: np.empty(0)}
        elif about.msgcount and not _WITHOUT_NUMBERS.match(kind):
            try:
                read[topic] = _columns_of_topic(reader, about.connections)
            except Exception:
                # A definition that is missing, of another version or cannot be parsed costs its topic, not the bag.
                unknown.append(f"{topic} ({kind})")
                continue
            topics[topic] = {}
            if _STANDARD.match(kind):
                known = ((name, unit) for name in read[topic][1] for pattern, unit in _UNITS if pattern.search(name))
                units |= {f"{topic}.{name}": unit for name, unit in known}
    pace = _simulated(read)
    for topic, (received, columns) in read.items():
        topics[topic], offset = _on_clock(received, columns, reader.start_time, pace)
        drifts = pace is not None and _drifts(received, _sent(columns))
        paced += [topic] * drifts
        shifted += [f"{topic} ({offset:+.3g} s)"] if offset and not drifts else []
    if not topics:
        listed = f": no definition fits {', '.join(unknown)}" if unknown else ""
        raise InputError(f"{path}: a bag of ROS without readable messages{listed}")
    causes = (
        ("topics left out because the file has no matching definition of their messages", unknown),
        ("these topics do not use the recorder's clock and are shifted by the median offset", shifted),
        ("all stamps are put on a clock at another pace than the recorder's, as a simulation's is, that of", paced),
    )
    warnings = tuple(f"{words}: {', '.join(own)}" for words, own in causes if own)
    begins = reader.start_time / _NANOSECOND
    system = "ROS 1" if isinstance(reader, rosbag1.Reader) else "ROS 2"
    return LogContents(topics, units, system=system, warnings=warnings, flown_at=date(begins), begins={"": begins})


def _columns_of_topic(reader: _Reader, connections: Sequence[Connection]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Read all messages of a topic: when they were received, ns, and their numbers by name."""
    types = _types(connections[0])
    read = types.deserialize_ros1 if isinstance(reader, rosbag1.Reader) else types.deserialize_cdr
    received, rows = [], []
    paths: dict[str, _Path] = {}
    for connection, stamp, data in reader.messages(connections=connections):
        message = read(data, connection.msgtype)
        paths = paths or dict(_ways_to_numbers(message))
        received.append(stamp)
        rows.append([_at(message, path) for path in paths.values()])
    values = zip(paths, zip(*rows, strict=True), strict=False)
    return np.array(received, dtype=np.int64), {name: np.array(own) for name, own in values}


def _types(connection: Connection) -> Typestore:
    """Give the definition of a topic's messages that the file holds, or those of the standard."""
    definition = connection.msgdef
    if definition.format is MessageDefinitionFormat.NONE:
        return get_typestore(Stores.LATEST)
    types = get_typestore(Stores.EMPTY)
    if definition.format is MessageDefinitionFormat.MSG:
        types.register(get_types_from_msg(definition.data, connection.msgtype))
        return types
    # Several files in one, each below a line of its own.
    for part in re.split(r"^=+\nIDL: .*\n", definition.data, flags=re.MULTILINE):
        types.register(get_types_from_idl(part) if part.strip() else {})
    return types


def _ways_to_numbers(value: Any, name: str = "", path: _Path = ()) -> Iterator[tuple[str, _Path]]:
    """Give the name of each number in a message, and the way to it."""
    if is_dataclass(value):
        for own in fields(value):
            # What is in capitals is a constant of the type.
            if own.name != "__msgtype__" and not own.name.isupper():
                yield from _ways_to_numbers(
                    getattr(value, own.name), f"{name}.{own.name}" if name else own.name, (*path, own.name)
                )
    elif isinstance(value, bool | int | float | np.number):
        yield name, path
    elif (
        isinstance(value, Sequence | np.ndarray) and not isinstance(value, str | bytes) and len(value) <= _MOST_NUMBERS
    ):
        for index, own in enumerate(value):
            yield from _ways_to_numbers(own, f"{name}[{index}]", (*path, index))


def _at(value: Any, path: _Path) -> Any:
    for step in path:
        if isinstance(step, str):
            value = getattr(value, step)
        elif step < len(value):
            value = value[step]
        else:
            # This message has fewer of them than the first one.
            return np.nan
    return value


def _sent(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Give the stamps of who sent messages, ns, which a header that was left at 0 does not hold."""
    sent = {name: _MICROSECONDS * values.astype(np.int64) for name, values in columns.items() if name.startswith(STAMP)}
    second, part = (columns.get(f"header.stamp.{name}") for name in ("sec", "nanosec"))
    if second is not None and part is not None:
        stamp = _NANOSECOND * second.astype(np.int64) + part.astype(np.int64)
        # A simulation begins at 0.
        sent |= {STAMP: stamp} if second.all() or (stamp.any() and (np.diff(stamp) > 0).all()) else {}
    return sent


def _drifts(received: np.ndarray, sent: dict[str, np.ndarray]) -> bool:
    """Check whether a sender's clock runs steadily away from the recorder's, at a pace that a simulation may have."""
    own = sent.get(STAMP, received)
    late, spans = received - own, (own[-1] - own[0], received[-1] - received[0])
    same = _SAME_CLOCK_S * _NANOSECOND
    runs = spans[1] < _SLOWEST * spans[0] < _SLOWEST**2 * spans[1]
    return bool(runs and abs(late[-1] - late[0]) > same and (np.abs(np.diff(late)) < same).all())


_Pace = tuple[np.ndarray, np.ndarray]  # Stamps of the recorder and of another clock, ns.


def _simulated(read: dict[str, tuple[np.ndarray, dict[str, np.ndarray]]]) -> _Pace | None:
    """Find a clock at another pace than the recorder's, with a step as long as the log before and after it."""
    clocks = [(received, _sent(columns)) for received, columns in read.values()]
    found = [(received, sent[STAMP]) for received, sent in clocks if _drifts(received, sent)]
    if not found:
        return None
    received, sent = (
        np.r_[2 * own[0] - own[-1], own, 2 * own[-1] - own[0]] for own in max(found, key=lambda clock: len(clock[0]))
    )
    return received, sent


def _paced(stamps: np.ndarray, pace: _Pace, origin: int) -> np.ndarray:
    since = np.interp(np.r_[origin, stamps] - origin, pace[0] - origin, pace[1] - pace[1][0])
    paced: np.ndarray = origin + (since[1:] - since[0]).astype(np.int64)
    return paced


def _on_clock(
    received: np.ndarray, columns: dict[str, np.ndarray], origin: int, pace: _Pace | None
) -> tuple[dict[str, Array], float]:
    """Convert stamps to s from an origin; also how far the sender's clock was shifted, s."""
    sent, offset = _sent(columns), 0
    drifts = pace is not None and _drifts(received, sent)
    if STAMP in sent:
        apart = int(np.median((_paced(received, pace, origin) if pace and drifts else received) - sent[STAMP]))
        offset = apart if abs(apart) > _SAME_CLOCK_S * _NANOSECOND else 0
    stamps = {STAMP: received} | {name: own + offset for name, own in sent.items()} | {f"{STAMP}_received": received}
    if pace is not None:
        stamps |= {name: _paced(own, pace, origin) for name, own in stamps.items() if not (drifts and name in sent)}
    numbers = {name: own.astype(float) for name, own in columns.items()}
    return numbers | {name: seconds(own, origin, _NANOSECOND) for name, own in stamps.items()}, offset / _NANOSECOND
