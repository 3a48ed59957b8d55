"""Read the curves, points, bars, bands and marks of one set of axes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection, PolyCollection, QuadMesh
from matplotlib.container import BarContainer, ErrorbarContainer
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from cpfls_cli.arrays import Array
from cpfls_cli.report.drawn import Series

SPREAD = "_evenly_spread"
"""Attribute of a thinned curve: samples of the whole one for tables."""


def drawn_in(axes: Axes) -> list[Series]:
    """Collect everything that stands for data in a set of axes.

    Returns
    -------
    list of Series
        Bars and error bars first, then curves, points, bands and maps, then marks.
    """
    grouped, used = _containers(axes)
    curves = [line for line in axes.lines if id(line) not in used]
    own = [line for line in curves if line.get_transform() == axes.transData]
    marks = [_level(axes, line) for line in curves if line.get_transform() != axes.transData]
    areas = [series for item in axes.collections if id(item) not in used for series in _collection(axes, item)]
    spans = [_span(axes, patch) for patch in axes.patches if id(patch) not in used and isinstance(patch, Rectangle)]
    found = [*grouped, *_joined(own), *areas, *marks, *spans]
    return sorted((series for series in found if series.x.size), key=lambda series: series.form == "mark")


def _containers(axes: Axes) -> tuple[list[Series], set[int]]:
    found, used = [], set()
    for container in axes.containers:
        used |= {id(part) for part in _parts(container)}
        if isinstance(container, BarContainer):
            found.append(_bars(container))
        elif isinstance(container, ErrorbarContainer):
            found.append(_error_bars(container))
    return found, used


def _parts(container: Any) -> Iterator[Any]:
    for part in container:
        yield from part if isinstance(part, tuple | list) else (part,)


def _bars(bars: BarContainer) -> Series:
    boxes = np.array([[bar.get_x(), bar.get_y(), bar.get_width(), bar.get_height()] for bar in bars]).reshape(-1, 4)
    middle = boxes[:, :2] + boxes[:, 2:] / 2
    if bars.orientation == "horizontal":
        return Series(_label(bars), "bars", boxes[:, 0] + boxes[:, 2], middle[:, 1])
    return Series(_label(bars), "bars", middle[:, 0], boxes[:, 1] + boxes[:, 3])


def _error_bars(container: ErrorbarContainer) -> Series:
    line, _, bars = container
    x, y = _numbers(line.get_xdata()), _numbers(line.get_ydata())
    ends = np.array(bars[0].get_segments())[..., 1] if bars else np.stack([y, y], axis=1)
    return Series(_label(container), "points", x, y, ends.min(axis=1), ends.max(axis=1))


def _joined(lines: list[Line2D]) -> list[Series]:
    """Join the pieces of a curve: of one style, one after the other, only the first with a label."""
    found: list[tuple[object, Series]] = []
    for line in lines:
        look = (line.get_color(), str(line.get_linestyle()), line.get_marker(), line.get_linewidth())
        series = _line(line)
        place = next((i for i, (other, own) in enumerate(found) if other == look and _continues(own, series)), None)
        if place is None:
            found.append((look, series))
        else:
            found[place] = (look, _longer(found[place][1], series))
    return [series for _, series in found]


def _line(line: Line2D) -> Series:
    form = "points" if line.get_linestyle() in ("None", "none", "", " ") else "line"
    x, y = _numbers(line.get_xdata()), _numbers(line.get_ydata())
    return Series(_label(line), form, x, y, spread=getattr(line, SPREAD, None))  # type: ignore[arg-type]


def _continues(first: Series, second: Series) -> bool:
    return not second.label and first.x.size > 0 and second.x.size > 0 and bool(second.x[0] >= first.x[-1])


def _longer(first: Series, second: Series) -> Series:
    spread = None
    if first.spread is not None and second.spread is not None:
        spread = (np.append(first.spread[0], second.spread[0]), np.append(first.spread[1], second.spread[1]))
    return replace(first, x=np.append(first.x, second.x), y=np.append(first.y, second.y), spread=spread)


def _level(axes: Axes, line: Line2D) -> Series:
    return _mark(axes, line.get_transform(), _label(line), _numbers(line.get_xdata()), _numbers(line.get_ydata()))


def _span(axes: Axes, patch: Rectangle) -> Series:
    (x, y), width, height = patch.get_xy(), patch.get_width(), patch.get_height()
    ends = np.array([x, x + width]), np.array([y, y + height])
    return _mark(axes, patch.get_data_transform(), _label(patch), *ends)


def _mark(axes: Axes, transform: Any, label: str, x: Array, y: Array) -> Series:
    """Read a level or a span: a coordinate that is no data goes from edge to edge."""
    edges = np.array([-np.inf, np.inf])
    in_x, in_y = transform.contains_branch_seperately(axes.transData)
    return Series(label, "mark", x if in_x else edges, y if in_y else edges)


def _collection(axes: Axes, item: Any) -> Iterator[Series]:
    if isinstance(item, QuadMesh):
        yield _map(item)
    elif isinstance(item, PathCollection):
        offsets = _numbers(item.get_offsets())
        yield Series(_label(item), "points", offsets[:, 0], offsets[:, 1])
    elif isinstance(item, LineCollection):
        for segment in item.get_segments():
            yield Series(_label(item), "mark", segment[[0, -1], 0], segment[[0, -1], 1])
    elif isinstance(item, PolyCollection):
        for path in item.get_paths():
            vertices = np.asarray(path.vertices)
            if item.get_transform() == axes.transData:
                yield _band(_label(item), vertices)
            else:
                ends = [np.array([column.min(), column.max()]) for column in vertices.T]
                yield _mark(axes, item.get_transform(), _label(item), *ends)


def _band(label: str, vertices: Array) -> Series:
    """Read a band between two curves: its outline goes along one and back along the other."""
    points = (len(vertices) - 2) // 2
    there, back = vertices[1 : points + 1], vertices[points + 2 : 2 * points + 2][::-1]
    low, high = np.fmin(there[:, 1], back[:, 1]), np.fmax(there[:, 1], back[:, 1])
    return Series(label, "band", there[:, 0], (low + high) / 2, low, high)


def _map(mesh: QuadMesh) -> Series:
    corners = np.asarray(mesh.get_coordinates())
    middle = (corners[1:, 1:] + corners[:-1, :-1]) / 2
    value = _numbers(mesh.get_array()).ravel()
    known = np.isfinite(value)
    places = middle.reshape(-1, 2)[known]
    return Series(_label(mesh), "map", places[:, 0], places[:, 1], value=value[known])


def _numbers(values: Any) -> Array:
    return np.ma.filled(np.ma.asarray(values, dtype=float), np.nan)


def _label(artist: Any) -> str:
    label = str(artist.get_label() or "")
    return "" if label.startswith("_") else label
