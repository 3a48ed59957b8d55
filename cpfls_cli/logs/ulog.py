"""Reader of ULog, as PX4 writes it: topics, each with stamps in microseconds."""

import io
import re
import struct
from collections.abc import Collection, Mapping
from contextlib import redirect_stdout
from math import nan
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyulog

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.topics import STAMP, YAW_RESETS
from cpfls_cli.logs.formats import ULOG_MAGIC, LogContents
from cpfls_cli.logs.records import date, numbers, plain, seconds, stamps_while, undone_turns
from cpfls_cli.rotations import wrapped

_PER_SECOND = 10**6
_QUATERNION = tuple(f"q[{each}]" for each in range(4))
_ASKED_FOR = tuple(f"q_d[{each}]" for each in range(4))
_RECEIVERS = ("vehicle_gps_position", "sensor_gps")
_HEADER_BYTES, _LONGEST_MESSAGE, _MARK_BYTES = 16, 65535, 8
_FIELD = re.compile(r"([^;\s\[]+)(?:\[(\d+)\])? [^;]*")


def contents(path: Path, wanted: Collection[str] | None = None) -> LogContents:
    """Read all topics, ``topic`` or ``topic[instance]``; a part of them takes no less time."""
    del wanted
    log = _parsed(path)
    origin = int(log.start_timestamp)
    topics = {
        f"{data.name}[{data.multi_id}]" if data.multi_id else data.name: {
            name: seconds(own, origin, _PER_SECOND)
            if name.startswith(STAMP) and own.dtype.kind in "iu"
            else numbers(own)
            for name, own in data.data.items()
        }
        for data in log.data_list
    }
    if not topics:
        raise InputError(f"{path}: a ULog file without samples: was the logger stopped at once, or the file cut off?")
    _undo_yaw_resets(topics)
    begins = {"": origin / _PER_SECOND}
    # Of a version that is no release too; old logs do not state it as a number.
    version = log.get_version_info() if isinstance(log.msg_info_dict.get("ver_sw_release"), int) else None
    release = ".".join(map(str, version[:3])) if version else ""
    system = f"{log.msg_info_dict.get('sys_name', '')} {release}".strip()
    # As the log begins; in a broken one some parameters are no numbers.
    known = log.initial_parameters.items()
    parameters: dict[str, float | str] = {name: float(own) for name, own in known if isinstance(own, int | float)}
    stamps = np.array([each.timestamp for each in log.logged_messages], dtype=np.uint64)
    texts = ((each.log_level_str(), plain(each.message)) for each in log.logged_messages)
    said = tuple((at, *own) for at, own in zip(seconds(stamps, origin, _PER_SECOND).tolist(), texts, strict=True))
    return LogContents(topics, {}, parameters, system, _warn_of_file(log, origin), _flown_at(topics), begins, said)


class _Stream(io.BufferedReader):
    """A file for pyulog, which goes back for ever by all of a message that a damaged file is too short for."""

    def seek(self, offset: int, whence: int = 0, /) -> int:
        """Go to a place, from the end back by a mark of it at most: pyulog takes the error for damage."""
        if whence == io.SEEK_CUR and offset < -_MARK_BYTES and not self.peek(1):
            raise ValueError("a message is cut off")
        return super().seek(offset, whence)


def _parsed(path: Path) -> Any:
    try:
        # The reader prints what it finds wrong, which is asked for below, and leaves a file that it cannot read open.
        with _Stream(path.open("rb", buffering=0)) as stream, redirect_stdout(io.StringIO()):
            if stream.read(len(ULOG_MAGIC)) != ULOG_MAGIC:
                raise InputError(f"{path}: not a ULog file: it does not start like one")
            _refuse_endless(path, stream)
            stream.seek(0)
            return pyulog.ULog(stream)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    except RecursionError:
        raise InputError(f"{path}: a broken ULog file: one of its messages contains itself") from None
    except (pyulog.core.ULogException, struct.error, ValueError, KeyError, IndexError, TypeError) as error:
        raise InputError(f"{path}: a broken ULog file: {error}") from None


def _refuse_endless(path: Path, stream: BinaryIO) -> None:
    """Refuse a file whose messages hold each other, or arrays, beyond what a message may take: the reader lists all."""
    described: dict[str, list[tuple[str, int]]] = {}
    stream.seek(_HEADER_BYTES)
    while len(head := stream.read(3)) == 3:
        size, kind = struct.unpack("<Hc", head)
        content = stream.read(size)
        if kind == b"A":
            break
        if kind == b"F":
            name, _, own = content.decode("latin-1").partition(":")
            described[name] = [(part[1], int(part[2] or 1)) for part in _FIELD.finditer(own)]
    sizes: dict[str, int] = {}

    def size_of(name: str) -> int:
        if name not in sizes:
            sizes[name] = sum(count * size_of(kind) for kind, count in described[name]) if name in described else 1
        return sizes[name]

    for name in described:
        if size_of(name) > _LONGEST_MESSAGE:
            raise InputError(
                f"{path}: a broken ULog file: its message '{name}' would take more than {_LONGEST_MESSAGE} bytes"
            )


def _undo_yaw_resets(topics: dict[str, dict[str, Array]]) -> None:
    """Turn attitudes, and those asked for, to the yaw that the estimator holds in flight: PX4 states each reset."""
    attitude = topics.get("vehicle_attitude", {})
    needed = ("quat_reset_counter", "delta_q_reset[0]", "delta_q_reset[3]", STAMP)
    if not attitude.keys() >= {*needed, *_QUATERNION}:
        return
    counted, cosine, sine, stamps = (attitude[name] for name in needed)
    # The counter has eight bits; of two resets between two rows only the second is stated.
    rows = np.flatnonzero(np.diff(counted) % 256 == 1) + 1
    rows = rows[np.isfinite(cosine[rows]) & np.isfinite(sine[rows])]
    if not len(rows):
        return
    # A quaternion and its negative are one turn.
    turns = np.asarray(wrapped(2 * np.arctan2(sine[rows], cosine[rows])))
    resets = stamps[rows]
    topics[YAW_RESETS] = {STAMP: resets, "turn": turns}
    landed = topics.get("vehicle_land_detected", {})
    stated = landed.keys() >= {STAMP, "landed"}
    aloft = stamps_while(stamps, landed[STAMP], landed["landed"] == 0) if stated else stamps
    for topic, names in (("vehicle_attitude", _QUATERNION), ("vehicle_attitude_setpoint", _ASKED_FOR)):
        fields = topics.get(topic, {STAMP: np.empty(0)})
        half = 0.5 * undone_turns(fields[STAMP], resets, turns, aloft)
        if fields.keys() >= {*names}:
            w, x, y, z = (fields[name] for name in names)
            c, s = np.cos(half), np.sin(half)
            fields |= dict(zip(names, (c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w), strict=True))
        if "yaw_body" in fields:
            fields["yaw_body"] = np.asarray(wrapped(fields["yaw_body"] + 2 * half))


def _flown_at(topics: Mapping[str, Mapping[str, Array]]) -> float:
    """Look up what a receiver of GPS says of the time at which the log begins."""
    for topic in _RECEIVERS:
        fields = topics.get(topic, {})
        if "time_utc_usec" in fields and STAMP in fields:
            begins = fields["time_utc_usec"] / _PER_SECOND - fields[STAMP]
            # Before it receives anything it says 0.
            return next((at for at in map(date, begins) if np.isfinite(at)), nan)
    return nan


def _warn_of_file(log: Any, origin: int) -> tuple[str, ...]:
    warnings = []
    if log.file_corruption:
        warnings.append("the file is damaged in places; what could be read is used")
    if log.dropouts:
        longest = max(log.dropouts, key=lambda dropout: dropout.duration)
        total_s = 1e-3 * sum(dropout.duration for dropout in log.dropouts)
        at_s = (longest.timestamp - origin) / _PER_SECOND
        warnings.append(
            f"{len(log.dropouts)} dropouts of the logger, {total_s:.3g} s in all, the longest"
            f" {1e-3 * longest.duration:.3g} s at {at_s:.3f} s: samples are missing there"
        )
    return tuple(warnings)
