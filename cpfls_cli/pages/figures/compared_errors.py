"""Models beside each other: their errors on the same data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from cpfls_cli.pages.figures.before_after import legend_over
from cpfls_cli.pages.judged import AXES, MODEL, RIGID_BODY, judged
from cpfls_cli.pages.judged_on import JudgedOn
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import GREY, plot, style_of
from cpfls_cli.report.content import Plot
from cpfls_cli.report.numbers import plain

_MARKERS = ("o", "s", "D", "^", "v", "P")
_DECADE = 10.0
_FLOOR = 1e-9
_FLOOR_TICK = "< 10⁻⁷"


def compared_errors_figure(name: str, parts: Sequence[JudgedOn], models: Sequence[Source]) -> Plot:
    """Draw the error of every model and its rigid body on the data that several were judged on."""
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
