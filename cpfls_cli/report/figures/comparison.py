"""Models beside each other: their inertia over attitude, and their errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from cpfls_cli.report.canvas import BASELINE, GREY, band, plain_ticks, plot, style_of
from cpfls_cli.report.content import Plot
from cpfls_cli.report.figures.before_after import legend_over
from cpfls_cli.report.figures.inertia_curves import ENTRIES, MISFIT_WORDS, OUTSIDE_WORDS, entry_of, keep_scale
from cpfls_cli.report.judged import AXES, MODEL, RIGID_BODY, judged
from cpfls_cli.report.judged_on import JudgedOn
from cpfls_cli.report.numbers import plain
from cpfls_cli.report.source import Source

_COLUMNS = 3
_MARKERS = ("o", "s", "D", "^", "v", "P")
_BAND = "95 % band of"
_DECADE = 10.0
_FLOOR = 1e-9
_FLOOR_TICK = "< 10⁻⁷"


def compared_curves_figure(name: str, models: Sequence[Source], word: str) -> Plot:
    """Draw the six entries of D(q) of several models along their curves of one name.

    Parameters
    ----------
    name : str
    models : sequence of Source
        With curves of that name.
    word : str
        "over roll" or "over pitch".

    Returns
    -------
    Plot
    """
    largest = max(float(np.abs(model.artifact.array("curves/inertia")).max(initial=1e-12)) for model in models)

    def draw(figure: Figure) -> None:
        grid = figure.subplots(len(ENTRIES) // _COLUMNS, _COLUMNS, sharex=True)
        for axes, entry in zip(grid.flat, ENTRIES, strict=True):
            shown = [_draw_model(axes, model, index, entry, word) for index, model in enumerate(models)]
            keep_scale(axes, shown, largest)
            axes.set_title(entry)
            plain_ticks(axes.yaxis)
        grid[-1, 1].set_xlabel(f"{word.removeprefix('over ')}, °")
        figure.supylabel("kg m²", fontsize=9.5)
        handles, labels = grid[0, 0].get_legend_handles_labels()
        shown_labels = [(handle, label) for handle, label in zip(handles, labels, strict=True) if _BAND not in label]
        figure.legend(*zip(*shown_labels, strict=True), loc="outside upper left", ncols=3)

    caption = (
        f"D(q) of {', '.join(model.label for model in models)} {word}, each with its 95 % band, along the attitudes "
        "that its own training visited; grey: the rigid body that fits best to the first. Where two bands part, the "
        f"flights tell the models apart. {OUTSIDE_WORDS} {MISFIT_WORDS}"
    )
    return plot(name, caption, f"Six entries of the inertia matrices of several models {word}", 4.6, draw)


def compared_errors_figure(name: str, parts: Sequence[JudgedOn], models: Sequence[Source]) -> Plot:
    """Draw the error of every model and its rigid body on the data that several were judged on.

    Parameters
    ----------
    name : str
    parts : sequence of JudgedOn
    models : sequence of Source

    Returns
    -------
    Plot
    """
    titles = [part.title for part in parts]
    shown = [model for model in models if any(model in part.models for part in parts)]

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, len(AXES), sharey=True)
        for axis, axes in enumerate(panels):
            for kind in (MODEL, RIGID_BODY):
                for index, model in enumerate(shown):
                    _draw_errors(axes, parts, model, kind, axis, index, len(shown))
            axes.set_title(AXES[axis])
            axes.set_yticks(range(len(parts)), titles[::-1])
            axes.set_ylim(-0.6, len(parts) - 0.4)
            axes.grid(visible=False, axis="y")
            axes.tick_params(axis="y", length=0)
            _scale(axes)
        panels[1].set_xlabel("root mean square error over the standard deviation of the torque, %")
        legend_over(figure, panels[0])

    caption = (
        "Errors on the data that two models or more were judged on, by axis. Filled: the models; hollow and grey: the "
        f"rigid body of each, at its height. {_FLOOR_TICK} %: below 1e-9 of the standard deviation of the torque."
    )
    height = 1.3 + 0.16 * len(parts) * (len(shown) + 1.5)
    return plot(name, caption, "Errors of the models and their rigid bodies, by part and axis", height, draw)


def _draw_model(axes: Axes, model: Source, index: int, entry: str, word: str) -> np.ndarray:
    """Draw one model; give the values that must be seen in full."""
    artifact = model.artifact
    curve = artifact.texts("curves/name").index(word)
    attitude = np.degrees(artifact.array("curves/attitude")[curve])
    angle = attitude[:, int(np.argmax(np.ptp(attitude, axis=0)))]
    keys = ("inertia", "low", "high", "rigid_body")
    values, low, high, rigid = (entry_of(artifact.array(f"curves/{key}")[curve], entry) for key in keys)
    visited = artifact.array("curves/outside")[curve] == 0
    style = style_of(index)
    band(axes, angle, low, high, color=style["color"], alpha=0.16, label=f"{_BAND} {model.label}")
    axes.plot(angle, values, label=model.label, **{**style, "linewidth": 1.6})
    if index == 0:
        axes.plot(angle, rigid, label="rigid body", **BASELINE)
    return np.concatenate([values, low[visited], high[visited]])


def _draw_errors(
    axes: Axes, parts: Sequence[JudgedOn], model: Source, kind: str, axis: int, index: int, models: int
) -> None:
    scores, offset = judged(model), (0.5 - (index + 0.5) / models) * 0.6
    rows, errors = [], []
    for row, part in enumerate(parts[::-1]):
        if model in part.models:
            share = float(scores.nrmse(kind, part.names[part.models.index(model)])[axis])
            rows.append(row + offset)
            errors.append(0.0 if share < _FLOOR else 100 * share)
    mark: dict[str, Any] = {"marker": _MARKERS[index % len(_MARKERS)], "linestyle": "none"}
    if kind == MODEL:
        axes.plot(errors, rows, label=model.label, color=style_of(index)["color"], markersize=5, **mark)
    else:
        hollow = {**mark, "markersize": 9, "color": GREY, "markerfacecolor": "none", "zorder": 1.9}
        axes.plot(errors, rows, label=f"rigid body of {model.label}", **hollow)


def _scale(axes: Axes) -> None:
    """Give the errors that can be told apart the whole width; those that are rounding stand at the left end."""
    values = np.concatenate([np.asarray(line.get_xdata(), dtype=float) for line in axes.lines])
    known, floored = values[np.isfinite(values) & (values > 0)], bool(np.any(values == 0))
    if not known.size:
        return
    low, high = float(known.min()), float(known.max())
    if high > _DECADE * low:
        axes.set_xscale("symlog", linthresh=0.7 * low, linscale=0.4) if floored else axes.set_xscale("log")
        axes.set_xlim(-0.3 * low if floored else None, 1.6 * high)
    else:
        axes.set_xlim(-0.06 * high if floored else 0.0, 1.1 * high)
    axes.minorticks_off()
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: _tick(value, floored)))


def _tick(value: float, floored: bool) -> str:
    if value < 0:
        return ""
    return _FLOOR_TICK if value == 0 and floored else plain(value, smallest=1e-4)
