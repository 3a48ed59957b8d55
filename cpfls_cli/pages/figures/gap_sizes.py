"""The gap of each channel before and after, in noise floors."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cpfls_cli.pages.figures.before_after import AFTER, legend_over
from cpfls_cli.pages.gap_words import channel_words, known_channels
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import GREY, plot
from cpfls_cli.report.content import Plot
from cpfls_cli.report.numbers import plain

_LEAST = 0.1
_GIVEN: dict[str, Any] = {
    "color": GREY,
    "marker": "s",
    "markerfacecolor": "white",
    "markersize": 7,
    "linestyle": "none",
}
_SHRUNK: dict[str, Any] = {"color": AFTER["color"], "marker": "o", "markersize": 7, "linestyle": "none"}


def gap_sizes_figure(name: str, source: Source) -> Plot:
    """Draw the gap of each channel on a logarithmic scale, with the noise floor.

    Parameters
    ----------
    source : Source
        A diagnosis or an extended model.
    """
    channels = known_channels(source, "gap/before_floors")
    index = [place for place, _ in channels]
    before, after = (source.artifact.array(f"gap/{key}_floors")[index] for key in ("before", "after"))
    hidden = bool((np.fmin(before, after) < _LEAST).any())

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        rows = np.arange(len(channels))[::-1]
        start, end = (np.maximum(values, _LEAST) for values in (before, after))
        axes.hlines(rows, np.fmin(start, end), np.fmax(start, end), color="#bbbbbb", linewidth=2, zorder=1)
        axes.plot(start, rows, label="before", zorder=2, **_GIVEN)
        axes.plot(end, rows, label="after", zorder=3, **_SHRUNK)
        axes.axvline(1.0, color="black", linewidth=1.1, linestyle=(0, (4, 2)), label="noise floor", zorder=1)
        axes.set_yticks(rows, [channel_words(channel) for _, channel in channels])
        _scale(axes, float(np.nanmax([*before, *after, 1.0])))
        legend_over(figure, axes)

    note = f" Marks at {plain(_LEAST)} stand for {plain(_LEAST)} or less." if hidden else ""
    caption = (
        f"Gap on held-out flights, in noise floors (logarithmic). A gap at the dashed line is as large as what noise "
        f"alone leaves.{note}"
    )
    return plot(name, caption, "Gap of each channel before and after, in noise floors", 1.0 + 0.34 * len(index), draw)


def _scale(axes: Axes, largest: float) -> None:
    axes.set_xscale("log")
    axes.set_xlim(0.8 * _LEAST, 1.6 * max(largest, 3.0))
    axes.set_ylim(-0.6, len(axes.get_yticks()) - 0.4)
    ticks = [0.1, 1.0, *(10.0**power for power in range(1, 9) if 10.0**power < 1.6 * largest)]
    axes.set_xticks(ticks, [plain(tick) for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("gap, noise floors")
