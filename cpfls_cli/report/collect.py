"""Read from a finished figure what is drawn in it: curves, points, bars, bands and marks, panel by panel."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import LineCollection, PathCollection, PolyCollection, QuadMesh
from matplotlib.container import BarContainer, ErrorbarContainer
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.ticker import FixedLocator, FuncFormatter

from cpfls_cli.arrays import Array
from cpfls_cli.report.canvas import NOT_FIRST
from cpfls_cli.report.content import Drawn, Panel, Series

SPREAD = "_evenly_spread"
"""Attribute of a thinned curve: samples of the whole one for tables."""

_COLORBAR = "<colorbar>"


def panels_of(figure: Figure) -> list[Panel]:
    """Collect the panels of a figure that hold data, with all that is drawn in them."""
    shown = [axes for axes in figure.axes if axes.get_label() != _COLORBAR]
    return [panel for axes in shown if (panel := _panel(axes, figure)).series]


def _panel(axes: Axes, figure: Figure) -> Panel:
    sides: Sequence[Literal["left", "center", "right"]] = ("left", "center", "right")
    return Panel(
        title=next(filter(None, (axes.get_title(side) for side in sides)), ""),
        x_label=_axis_label(axes, "x") or figure.get_supxlabel(),
        y_label=_axis_label(axes, "y") or figure.get_supylabel(),
        series=_drawn_in(axes),
        x_names=_names(axes.xaxis),
        y_names=_names(axes.yaxis),
    )


def _axis_label(axes: Axes, which: Literal["x", "y"]) -> str:
    """Find the label of an axis, which may stand at another panel that shares it."""
    shared: Any = axes.get_shared_x_axes() if which == "x" else axes.get_shared_y_axes()
    around = [axes, *(other for other in axes.figure.axes if other in shared.get_siblings(axes))]
    labels = (other.get_xlabel() if which == "x" else other.get_ylabel() for other in around)
    return next(filter(None, labels), "")


def _names(axis: Axis) -> dict[float, str]:
    """Find the words that a figure wrote at its ticks itself."""
    formatter = axis.get_major_formatter()
    # What `set_ticks` makes of labels that are given.
    given = isinstance(formatter, FuncFormatter) and isinstance(formatter.func, partial)
    if not given or not isinstance(axis.get_major_locator(), FixedLocator):
        return {}
    ticks = [float(tick) for tick in axis.get_majorticklocs()]
    return dict(zip(ticks, formatter.format_ticks(ticks), strict=True))


def _drawn_in(axes: Axes) -> list[Series]:
    """Collect what stands for data in a set of axes: bars and error bars, then curves, points and areas, then marks."""
    grouped, used = [], set()
    for container in axes.containers:
        for part in container:
            used |= {id(artist) for artist in (part if isinstance(part, tuple | list) else (part,))}
        if isinstance(container, BarContainer):
            grouped.append(_bars(container))
        elif isinstance(container, ErrorbarContainer):
            grouped.append(_error_bars(container))
    curves = [line for line in axes.lines if id(line) not in used]
    data = [line for line in curves if line.get_transform() == axes.transData]
    levels = [
        _mark(axes, line.get_transform(), _label(line), *(_numbers(ends) for ends in line.get_data()))
        for line in curves
        if line.get_transform() != axes.transData
    ]
    areas = [series for item in axes.collections if id(item) not in used for series in _collection(axes, item)]
    spans = [_span(axes, patch) for patch in axes.patches if id(patch) not in used and isinstance(patch, Rectangle)]
    everything = [*grouped, *_joined(data), *areas, *levels, *spans]
    return sorted((series for series in everything if series.x.size), key=lambda series: series.form == "mark")


def _bars(bars: BarContainer) -> Series:
    boxes = np.array([[bar.get_x(), bar.get_y(), bar.get_width(), bar.get_height()] for bar in bars]).reshape(-1, 4)
    middle = boxes[:, :2] + boxes[:, 2:] / 2
    if bars.orientation == "horizontal":
        return Series(_label(bars), "bars", boxes[:, 0] + boxes[:, 2], middle[:, 1])
    return Series(_label(bars), "bars", middle[:, 0], boxes[:, 1] + boxes[:, 3])


def _error_bars(container: ErrorbarContainer) -> Series:
    line, _, bars = container
    x, y = (_numbers(values) for values in line.get_data())
    ends = np.array(bars[0].get_segments())[..., 1] if bars else np.stack([y, y], axis=1)
    return Series(_label(container), "points", x, y, ends.min(axis=1), ends.max(axis=1))


def _joined(lines: list[Line2D]) -> list[Series]:
    """Join the pieces of a curve: of one style, one after the other, only the first with a label."""
    curves: list[tuple[object, Series]] = []
    for line in lines:
        look = (line.get_color(), str(line.get_linestyle()), line.get_marker(), line.get_linewidth())
        form: Drawn = "points" if line.get_linestyle() in ("None", "none", "", " ") else "line"
        x, y = (_numbers(values) for values in line.get_data())
        series = Series(_label(line), form, x, y, spread=getattr(line, SPREAD, None))
        continued = (i for i, (other, curve) in enumerate(curves) if other == look and _continues(curve, series))
        index = next(continued, None)
        if index is None:
            curves.append((look, series))
        else:
            curves[index] = (look, _longer(curves[index][1], series))
    return [series for _, series in curves]


def _continues(first: Series, second: Series) -> bool:
    return not second.label and first.x.size > 0 and second.x.size > 0 and bool(second.x[0] >= first.x[-1])


def _longer(first: Series, second: Series) -> Series:
    spread = None
    if first.spread is not None and second.spread is not None:
        spread = (np.append(first.spread[0], second.spread[0]), np.append(first.spread[1], second.spread[1]))
    return replace(first, x=np.append(first.x, second.x), y=np.append(first.y, second.y), spread=spread)


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
        corners = np.asarray(item.get_coordinates())
        centres = ((corners[1:, 1:] + corners[:-1, :-1]) / 2).reshape(-1, 2)
        value = _numbers(item.get_array()).ravel()
        known = np.isfinite(value)
        yield Series(_label(item), "map", centres[known, 0], centres[known, 1], value=value[known])
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


def _numbers(values: Any) -> Array:
    return np.ma.filled(np.ma.asarray(values, dtype=float), np.nan)


def _label(artist: Any) -> str:
    label = str(artist.get_label() or "")
    return "" if label.startswith("_") else label.removeprefix(NOT_FIRST)
