"""Views of artifacts for other programs: tracks and curves as CSV, and as MCAP for Foxglove and PlotJuggler."""

from __future__ import annotations

import csv
import heapq
import io
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from itertools import repeat
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import InputError, install_command

TIME = "__time"
"""Column of the stamps, s, as PlotJuggler calls it in what it writes."""
MEASURED, MODEL, DIFFERENCE, SETPOINT = "measured", "model", "difference", "setpoint"
AXES, ANGLES = ("x", "y", "z"), ("roll", "pitch", "yaw")
WORLD_FRAME, BODY_FRAME = "world", "body"

_VALUE_DIGITS, _STAMP_DECIMALS = 9, 9


@dataclass(frozen=True, kw_only=True)
class Track:
    """A quantity over time, s, on the clock of the log, as it was measured and in other ways; NaN where not known.

    `flight`: which of several; `axes`: names of the columns. Both are empty where there is one. A difference is
    measured less model.
    """

    name: str
    time: Array
    values: Mapping[str, Array]
    unit: str
    frame: str
    description: str
    flight: str = ""
    axes: tuple[str, ...] = ()

    @property
    def path(self) -> str:
        """Flight and name."""
        return f"{self.flight}/{self.name}" if self.flight else self.name

    @property
    def columns(self) -> Iterator[tuple[str, str, Array]]:
        """List what, axis and values, shape (time,), of each column that is known somewhere."""
        for what, values in self.values.items():
            for axis, own in zip(self.axes or ("",), values.reshape(len(self.time), -1).T, strict=True):
                if np.isfinite(own).any():
                    yield what, axis, own


@dataclass(frozen=True, kw_only=True)
class Curve:
    """Quantities over something else than time, such as a horizon or a frequency; NaN where not known.

    `over`: name of the first column, with its unit.
    """

    name: str
    over: str
    x: Array
    values: Mapping[str, Array]
    description: str


@dataclass(frozen=True)
class Pose:
    """Where a vehicle is and how it is turned (roll, pitch, yaw, rad), measured or of a model; NaN where not known."""

    child: str
    time: Array
    position: Array
    attitude: Array


@dataclass(frozen=True)
class View:
    """All that is to be drawn of an artifact.

    Attributes
    ----------
    stamps : tuple of str and float, or None
        Name of the column of the log that holds its stamps, and how many s one of its units is, where they are no s.
    on_log_clock : bool
        Whether the stamps are those of the log; else time counts from the first sample.
    """

    tracks: Sequence[Track] = ()
    curves: Sequence[Curve] = ()
    poses: Sequence[Pose] = ()
    title: str = ""
    stamps: tuple[str, float] | None = None
    on_log_clock: bool = False
    about: Mapping[str, str] = field(default_factory=dict)


def csv_text(view: View) -> str:
    """Write the columns of a view, one row for each stamp of any of its quantities; empty where not known.

    Without any quantity over time the curves are written, over what they have in common.
    """
    if not view.tracks:
        return _curves_text(view.curves)
    times = [np.round(track.time, _STAMP_DECIMALS) for track in view.tracks]
    stamps = np.unique(np.concatenate(times))
    header, columns = [TIME], [[f"{stamp:.{_STAMP_DECIMALS}f}" for stamp in stamps.tolist()]]
    if view.on_log_clock and view.stamps is not None:
        name, factor = view.stamps
        header.append(name)
        columns.append([_number(stamp / factor, 16) for stamp in stamps.tolist()])
    for track, time in zip(view.tracks, times, strict=True):
        rows = np.searchsorted(stamps, time).tolist()
        for what, axis, values in track.columns:
            header.append("/".join(part for part in (track.path, axis, what) if part))
            columns.append(_cells(len(stamps), rows, values))
    return _table(header, zip(*columns, strict=True))


def _curves_text(curves: Sequence[Curve]) -> str:
    over = np.unique(np.concatenate([curve.x for curve in curves]))
    header, columns = [curves[0].over], [[_number(value, _VALUE_DIGITS) for value in over.tolist()]]
    for curve in curves:
        rows = np.searchsorted(over, curve.x).tolist()
        for name, values in curve.values.items():
            if np.isfinite(values).any():
                header.append(f"{curve.name}/{name}")
                columns.append(_cells(len(over), rows, values))
    return _table(header, zip(*columns, strict=True))


def _cells(count: int, rows: Sequence[int], values: Array) -> list[str]:
    cells = [""] * count
    for row, value in zip(rows, values.tolist(), strict=True):
        cells[row] = _number(value, _VALUE_DIGITS)
    return cells


def _table(header: Sequence[str], rows: Iterator[tuple[str, ...]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}g}" if np.isfinite(value) else ""


_NUMBER, _TEXT = {"type": "number"}, {"type": "string"}
_DIGITS = 9


def _object(title: str, properties: Mapping[str, Any], description: str = "") -> dict[str, Any]:
    described = {"description": description} if description else {}
    return {"type": "object", "title": title, **described, "properties": dict(properties)}


def _whole(title: str, properties: Mapping[str, Any]) -> dict[str, Any]:
    """Describe an object that has all of its properties, as those do that Foxglove knows by their titles."""
    return {**_object(title, properties), "required": list(properties)}


_TIMESTAMP = {
    "type": "object",
    "title": "time",
    "properties": {"sec": {"type": "integer", "minimum": 0}, "nsec": {"type": "integer", "minimum": 0}},
}
_VECTOR = _whole("foxglove.Vector3", dict.fromkeys("xyz", _NUMBER))
_QUATERNION = _whole("foxglove.Quaternion", dict.fromkeys("xyzw", _NUMBER))
_POSE_IN_FRAME = _whole(
    "foxglove.PoseInFrame",
    {
        "timestamp": _TIMESTAMP,
        "frame_id": _TEXT,
        "pose": _whole("foxglove.Pose", {"position": _VECTOR, "orientation": _QUATERNION}),
    },
)
_FRAME_TRANSFORM = _whole(
    "foxglove.FrameTransform",
    {
        "timestamp": _TIMESTAMP,
        "parent_frame_id": _TEXT,
        "child_frame_id": _TEXT,
        "translation": _VECTOR,
        "rotation": _QUATERNION,
    },
)


def mcap_bytes(view: View) -> bytes:
    """Write a view as MCAP.

    InputError if the package is missing, or a stamp is before 0, which MCAP has no number for.
    """
    try:
        writer_of = import_module("mcap.writer").Writer
    except ImportError:
        raise InputError(f"--format mcap needs the package mcap; {install_command('mcap')}") from None
    _refuse_negative(view)
    stream = io.BytesIO()
    writer = writer_of(stream)
    writer.start(profile="", library="cpfls")
    writer.add_metadata("cpfls", {"title": view.title, **view.about})
    first = min((int(_nanoseconds(track.time[:1])[0]) for track in view.tracks), default=0)
    streams = []
    for topic, schema, about, messages in (
        *map(_of_track, view.tracks),
        *(_of_curve(curve, first) for curve in view.curves),
        *(channel for pose in view.poses for channel in _of_pose(pose)),
    ):
        described = json.dumps(schema, sort_keys=True).encode()
        kind = writer.register_schema(name=schema["title"], encoding="jsonschema", data=described)
        number = writer.register_channel(topic=topic, message_encoding="json", schema_id=kind, metadata=about)
        streams.append(zip(messages, repeat(number), strict=False))
    counts = Counter[int]()
    for (stamp, message), number in heapq.merge(*streams, key=lambda own: (own[0][0], own[1])):
        writer.add_message(
            channel_id=number,
            log_time=stamp,
            publish_time=stamp,
            sequence=counts[number],
            data=json.dumps(message, allow_nan=False, separators=(",", ":")).encode(),
        )
        counts[number] += 1
    writer.finish()
    return stream.getvalue()


_Channel = tuple[str, dict[str, Any], dict[str, str], Iterator[tuple[int, dict[str, Any]]]]
"""Topic, schema and what else is said of it, and its messages in time: stamp in ns, what it says."""


def _of_track(track: Track) -> _Channel:
    """Give a message for each sample, by axis and what it is."""
    about = {"unit": track.unit, "frame": track.frame, "description": track.description}
    described = ", ".join(part for part in (track.description, track.unit, track.frame) if part)
    columns = list(track.columns)
    by_axis: dict[str, dict[str, Any]] = {}
    for what, axis, _ in columns:
        by_axis.setdefault(axis, {})[what] = _NUMBER
    properties = by_axis[""] if set(by_axis) == {""} else {a: _object(a, own) for a, own in by_axis.items()}
    schema = _object(f"cpfls.{track.name.replace('/', '.')}", properties, described)
    return f"/{track.path}", schema, about, _of_samples(track, columns)


def _of_samples(track: Track, columns: list[tuple[str, str, Array]]) -> Iterator[tuple[int, dict[str, Any]]]:
    stamps = _nanoseconds(track.time).tolist()
    names = [(what, axis) for what, axis, _ in columns]
    for stamp, row in zip(stamps, zip(*(_rounded(values) for _, _, values in columns), strict=True), strict=True):
        message: dict[str, Any] = {}
        for (what, axis), value in zip(names, row, strict=True):
            if value is not None:
                (message.setdefault(axis, {}) if axis else message)[what] = value
        if message:
            yield stamp, message


def _of_curve(curve: Curve, stamp: int) -> _Channel:
    """Give one message with all points."""
    known = {name: values for name, values in curve.values.items() if np.isfinite(values).any()}
    whole = np.isfinite(np.column_stack([curve.x, *known.values()])).all(axis=1)
    points = {curve.over: curve.x[whole], **{name: values[whole] for name, values in known.items()}}
    listed = {"type": "array", "items": _NUMBER}
    schema = _object(f"cpfls.{curve.name}", dict.fromkeys(points, listed), curve.description)
    message = {name: _rounded(own) for name, own in points.items()}
    about = {"description": curve.description, "over": curve.over}
    return f"/curves/{curve.name}", schema, about, iter([(stamp, message)])


def _of_pose(pose: Pose) -> Iterator[_Channel]:
    """Give a pose, and the same as the way from one frame to the other, as panels in space want it."""
    from scipy.spatial.transform import Rotation

    about = {"unit": "m, quaternion", "frame": WORLD_FRAME}
    known = np.isfinite(pose.attitude).all(axis=1)
    stamps = _nanoseconds(pose.time[known]).tolist()
    turned = Rotation.from_euler("ZYX", pose.attitude[known, ::-1]).as_quat().tolist() if stamps else []
    samples = [
        (
            {"sec": stamp // 10**9, "nsec": stamp % 10**9},
            dict(zip("xyz", place, strict=True)),
            dict(zip("xyzw", turn, strict=True)),
        )
        for stamp, place, turn in zip(stamps, np.nan_to_num(pose.position[known]).tolist(), turned, strict=True)
    ]
    posed = (
        {"timestamp": time, "frame_id": WORLD_FRAME, "pose": {"position": place, "orientation": turn}}
        for time, place, turn in samples
    )
    moved = (
        {
            "timestamp": time,
            "parent_frame_id": WORLD_FRAME,
            "child_frame_id": pose.child,
            "translation": place,
            "rotation": turn,
        }
        for time, place, turn in samples
    )
    topic = "/pose" if pose.child == BODY_FRAME else f"/pose/{pose.child}"
    yield topic, _POSE_IN_FRAME, about, zip(stamps, posed, strict=True)
    yield f"/tf/{pose.child}", _FRAME_TRANSFORM, about, zip(stamps, moved, strict=True)


def _refuse_negative(view: View) -> None:
    first = min((float(track.time[0]) for track in view.tracks if len(track.time)), default=0.0)
    if first < 0:
        raise InputError(
            f"{view.title}: the clock of its log begins at {first:.6g} s, and MCAP has no stamps before 0; export it "
            "as .csv"
        )


def _nanoseconds(time: Array) -> IntArray:
    """Give stamps in ns; the whole seconds apart, so that none of their digits is lost."""
    whole = np.floor(time)
    return np.asarray(whole.astype(np.int64) * 10**9 + np.rint((time - whole) * 1e9).astype(np.int64))


def _rounded(values: Array) -> list[float | None]:
    return [float(f"{value:.{_DIGITS}g}") if np.isfinite(value) else None for value in values.tolist()]
