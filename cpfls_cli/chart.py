"""Small charts as SVG that follow the page: its colours in light and dark, its print, and a table of their numbers."""

from __future__ import annotations

import base64
import math
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from markupsafe import escape

from cpfls_cli.arrays import Array
from cpfls_cli.errors import visible
from cpfls_cli.report.canvas import evenly_spread, kept_samples
from cpfls_cli.report.numbers import number, plain

Style = int | Literal["g"]
"""Which of the eight colours of the page; ``g`` is grey, for what a result is compared with."""

COLOURS = 8
_TOP, _RIGHT, _BELOW = 22, 16, 40
_LETTER = 6.4
"""Width of a letter, px, on the large side."""
_MOST_DRAWN = 800
_TICKS = 6


@dataclass(frozen=True)
class Axis:
    """An axis from one end to the other.

    Attributes
    ----------
    names : mapping of float to str
        Words at positions, in place of numbers.
    """

    label: str
    low: float
    high: float
    log: bool = False
    names: Mapping[float, str] = field(default_factory=dict)

    def share(self, values: Any) -> Array:
        """Give positions along the axis, 0 to 1."""
        low, high, at = self.low, self.high, np.asarray(values, float)
        if self.log:
            low, high, at = math.log(low), math.log(high), np.log(np.maximum(at, 1e-300))
        return np.asarray((at - low) / ((high - low) or 1.0))

    def ticks(self) -> dict[float, str]:
        """List positions with their words."""
        if self.names:
            return dict(self.names)
        if self.log:
            steps = (1, 2, 5) if self.high < 1000 * self.low else (1,)
            powers = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
            found = [step * 10.0**power for power in powers for step in steps]
        else:
            rough = (self.high - self.low) / _TICKS or 1.0
            power = 10.0 ** math.floor(math.log10(rough))
            step = next(each * power for each in (1, 2, 5, 10) if each * power >= 0.999 * rough)
            first = math.ceil(self.low / step - 1e-9)
            found = [step * at for at in range(first, math.floor(self.high / step + 1e-9) + 1)]
        return {at: plain(at, 1e-4) for at in found if -1e-9 <= float(self.share(at)) <= 1 + 1e-9}


def span(*values: Any, zero: bool = False, room: float = 0.05) -> tuple[float, float]:
    """Give ends of an axis that hold all finite values, with some room."""
    every = np.concatenate([np.ravel(np.asarray(each, float)) for each in values if each is not None] or [np.empty(0)])
    every = every[np.isfinite(every)]
    low, high = (float(every.min()), float(every.max())) if len(every) else (0.0, 1.0)
    low, high = (min(low, 0.0), max(high, 0.0)) if zero else (low, high)
    more = room * (high - low or abs(high) or 1.0)
    return low - more * (not zero or low < 0), high + more * (not zero or high > 0)


@dataclass
class Chart:
    """One set of axes, filled by its methods; ``str`` of it is HTML.

    Attributes
    ----------
    name : str
        Unique on the page.
    title : str
        What it shows, for who does not see it.
    table : bool
        Whether its numbers stand below it, folded away.
    least_left : float
        Room for the words of the y axis, px; charts one above the other have the same.
    """

    name: str
    title: str
    x: Axis
    y: Axis
    width: int = 380
    height: int = 240
    table: bool = True
    least_left: float = 0.0
    _parts: list[str] = field(default_factory=list)
    _marks: list[tuple[float, str]] = field(default_factory=list)
    _legend: list[tuple[str, Style, str]] = field(default_factory=list)
    _columns: list[tuple[str, Array, Array]] = field(default_factory=list)

    @property
    def _left(self) -> float:
        return max(self.least_left, 14 + _LETTER * max((len(each) for each in self.y.ticks().values()), default=1))

    def _px(self, x: Any) -> Array:
        return np.asarray(self._left + self.x.share(x) * (self.width - self._left - _RIGHT))

    def _py(self, y: Any) -> Array:
        return np.asarray(self.height - _BELOW - self.y.share(y) * (self.height - _TOP - _BELOW))

    def line(
        self,
        label: str,
        x: Array,
        y: Array,
        style: Style = 0,
        *,
        low: Array | None = None,
        high: Array | None = None,
        kind: str = "",
        key: bool = True,
    ) -> None:
        """Draw a curve, with a band; gaps where it is not finite. The kind is ``dashed``, ``thin`` or both.

        Without `key` its label is in the table of numbers only.
        """
        if low is not None and high is not None:
            known = np.flatnonzero(np.isfinite(low) & np.isfinite(high))
            ends = [*zip(x[known], low[known], strict=True), *zip(x[known][::-1], high[known][::-1], strict=True)]
            self._parts.append(f'<polygon class="band f{style}" points="{self._points(ends)}"/>' if ends else "")
        self._parts.append(f'<path class="curve s{style} {kind}" d="{self._path(x, y)}"/>')
        self._note(label, style, kind, x, y, low, high, key=key)

    def points(
        self,
        label: str,
        x: Array,
        y: Array,
        style: Style = 0,
        *,
        low: Array | None = None,
        high: Array | None = None,
        key: bool = True,
    ) -> None:
        """Draw points with whiskers."""
        whole = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
        self._whiskers(x, low, high)
        at = zip(self._px(x[whole]), self._py(y[whole]), strict=True)
        self._parts += [f'<circle class="f{style}" cx="{a:.1f}" cy="{b:.1f}" r="3"/>' for a, b in at]
        self._note(label, style, "", x, y, low, high, key=key)

    def bars(
        self,
        label: str,
        x: Array,
        y: Array,
        style: Style = 0,
        *,
        low: Array | None = None,
        high: Array | None = None,
        breadth: float = 0.6,
    ) -> None:
        """Draw bars from zero with whiskers."""
        left, right, ends, zero = (
            self._px(x - breadth / 2),
            self._px(x + breadth / 2),
            self._py(y),
            float(self._py(0.0)),
        )
        for a, b, end in zip(left, right, ends, strict=True):
            box = f'x="{a:.1f}" width="{b - a:.1f}" y="{min(end, zero):.1f}" height="{abs(end - zero):.1f}"'
            self._parts.append(f'<rect class="f{style}" {box}/>' if math.isfinite(a + end) else "")
        self._whiskers(x, low, high)
        self._note(label, style, "", x, y, low, high)

    def map(self, values: Array, low: float, high: float, style: Style = 0) -> None:
        """Fill the axes with a picture, shape (y from below, x), from nothing at `low` to the full colour at `high`."""
        shade = np.nan_to_num(np.clip((values[::-1] - low) / ((high - low) or 1.0), 0, 1))
        picture = base64.b64encode(_png((255 * shade).round().astype(np.uint8))).decode()
        left, right = self._px([self.x.low, self.x.high])
        below, above = self._py([self.y.low, self.y.high])
        box = f'x="{left:.1f}" y="{above:.1f}" width="{right - left:.1f}" height="{below - above:.1f}"'
        self._parts.append(
            f'<mask id="{self.name}-map"><image {box} preserveAspectRatio="none" '
            f'href="data:image/png;base64,{picture}"/></mask>'
            f'<rect {box} class="f{style}" mask="url(#{self.name}-map)"/>'
        )
        self.table = False

    def mark(self, label: str = "", *, x: float | None = None, y: float | None = None) -> None:
        """Draw a level or a moment from edge to edge."""
        if x is not None and self.x.low <= x <= self.x.high:
            at = float(self._px(x))
            ends = f'x1="{at:.1f}" x2="{at:.1f}" y1="{_TOP}" y2="{self.height - _BELOW}"'
            self._parts.append(f'<line class="curve sg dashed thin" {ends}/>')
            self._marks.append((at, label))
        if y is not None and self.y.low <= y <= self.y.high:
            at = float(self._py(y))
            ends = f'x1="{self._left:.1f}" x2="{self.width - _RIGHT}" y1="{at:.1f}" y2="{at:.1f}"'
            self._parts.append(f'<line class="curve sg dashed thin" {ends}/>')
            self._note(label, "g", "dashed thin", np.empty(0), np.empty(0))

    def _whiskers(self, x: Array, low: Array | None, high: Array | None) -> None:
        if low is None or high is None:
            return
        for at, a, b in zip(self._px(x), self._py(low), self._py(high), strict=True):
            if math.isfinite(at + a + b):
                self._parts.append(f'<path class="whisker" d="M{at:.1f} {a:.1f}V{b:.1f}"/>')

    def _note(
        self, label: str, style: Style, kind: str, x: Array, y: Array, *ends: Array | None, key: bool = True
    ) -> None:
        if label and key:
            self._legend.append((label, style, kind))
        named = zip((label or self.y.label, f"{label}, low", f"{label}, high"), (y, *ends), strict=False)
        self._columns += [(name, x, values) for name, values in named if values is not None and len(values)]

    def _points(self, ends: Sequence[tuple[float, float]]) -> str:
        x, y = np.asarray(ends, float).T
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(self._px(x), self._py(y), strict=True))

    def _path(self, x: Array, y: Array) -> str:
        kept = kept_samples(y, _MOST_DRAWN) if np.isfinite(y).all() else np.arange(len(y))
        parts, pen = [], "M"
        for a, b in zip(self._px(x[kept]), self._py(y[kept]), strict=True):
            if math.isfinite(a + b):
                parts.append(f"{pen}{a:.1f} {b:.1f}")
                pen = "L"
            else:
                pen = "M"
        return "".join(parts)

    def __str__(self) -> str:
        """Write it as HTML: legend, picture, and its numbers folded away."""
        keys = "".join(
            f'<li><svg viewBox="0 0 22 10" class="chart" aria-hidden="true"><path class="curve s{style} {kind}" '
            f'd="M0 5H22"/></svg>{_text(label)}</li>'
            for label, style, kind in self._legend
        )
        legend = f'<ul class="legend">{keys}</ul>' if len(self._legend) > 1 else ""
        return (
            f'{legend}<div class="plot"><svg class="chart" viewBox="0 0 {self.width} {self.height}" role="img" '
            f'aria-labelledby="{self.name}-title" style="min-width:{0.72 * self.width:.0f}px">'
            f'<title id="{self.name}-title">{_text(self.title)}</title>'
            f'<clipPath id="{self.name}-clip"><rect x="{self._left:.1f}" y="{_TOP - 1}" '
            f'width="{self.width - self._left - _RIGHT:.1f}" height="{self.height - _TOP - _BELOW + 2}"/></clipPath>'
            f'{"".join(self._axes())}<g clip-path="url(#{self.name}-clip)">{"".join(self._parts)}</g>'
            f"{''.join(self._labels())}</svg></div>{self._numbers() if self.table else ''}"
        )

    def _axes(self) -> Iterator[str]:
        right, below = self.width - _RIGHT, self.height - _BELOW
        for at, word in self.y.ticks().items():
            y = float(self._py(at))
            yield f'<line class="grid" x1="{self._left:.1f}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>'
            yield f'<text x="{self._left - 6:.1f}" y="{y + 4:.1f}" text-anchor="end">{_text(word)}</text>'
        free = -math.inf
        for at, word in self.x.ticks().items():
            x, half = float(self._px(at)), _LETTER * len(word) / 2
            if x - half > free:
                yield f'<text x="{x:.1f}" y="{below + 16}" text-anchor="middle">{_text(word)}</text>'
                free = x + half + 4
        yield f'<line class="axis" x1="{self._left:.1f}" x2="{right}" y1="{below}" y2="{below}"/>'
        middle = (self._left + right) / 2
        yield f'<text x="{middle:.1f}" y="{self.height - 5}" text-anchor="middle">{_text(self.x.label)}</text>'
        yield f'<text x="2" y="12">{_text(self.y.label)}</text>'

    def _labels(self) -> Iterator[str]:
        """Write words at marks, none over another: what has no room is left to the table."""
        free = _LETTER * len(self.y.label) + 12
        for at, label in sorted(self._marks):
            half = _LETTER * len(label) / 2
            x = min(max(at, free + half), self.width - half)
            if label and abs(x - at) <= half and x - half >= free:
                yield f'<text x="{x:.1f}" y="{_TOP - 8}" text-anchor="middle">{_text(label)}</text>'
                free = x + half + 6

    def _numbers(self) -> str:
        sides: list[tuple[Array, list[tuple[str, Array]]]] = []
        for name, x, values in self._columns:
            side = next((own for own in sides if np.array_equal(own[0], x)), None)
            if side is None:
                sides.append((x, [(name, values)]))
            else:
                side[1].append((name, values))
        tables = "".join(_table(self.x, x, columns) for x, columns in sides)
        return f"<details><summary>Numbers</summary>{tables}</details>" if tables else ""


def _table(axis: Axis, x: Array, columns: Sequence[tuple[str, Array]]) -> str:
    head = "".join(f'<th scope="col">{_text(name)}</th>' for name in (axis.label, *(name for name, _ in columns)))
    rows = "".join(
        f'<tr><th scope="row">{_text(axis.names.get(float(x[row]), plain(float(x[row]), 1e-4)))}</th>'
        f"{''.join(f'<td>{number(float(values[row]))}</td>' for _, values in columns)}</tr>"
        for row in evenly_spread(len(x))
    )
    return f'<div class="table" tabindex="0"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'


def _text(words: str) -> str:
    return str(escape(visible(words)))


def _png(grey: np.ndarray[Any, Any]) -> bytes:
    """Write a picture of shades, shape (row, column)."""
    rows, columns = grey.shape
    lines = np.concatenate([np.zeros((rows, 1), np.uint8), grey], axis=1).tobytes()

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    header = struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0)
    ends = chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(lines, 9)), chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(ends)
