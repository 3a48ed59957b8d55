"""What an artifact holds over the clock of its log, and over anything else, for programs that only draw."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from cpfls_cli.arrays import Array

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

    title: str
    tracks: Sequence[Track] = ()
    curves: Sequence[Curve] = ()
    poses: Sequence[Pose] = ()
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
