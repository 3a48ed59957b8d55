"""The gap over time: every flight, in noise floors, with the stretches in which it is largest."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cpfls_cli.arrays import Array
from cpfls_cli.pages.gap_words import channel_words, known_channels
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import line, plot, stacked
from cpfls_cli.report.content import Plot

STRETCHES = 5
_SHADE = "#f3d9b8"
_LABEL = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}


def residual_time_figure(name: str, disagreement: Source) -> Plot:
    """Draw the gap of each channel over all flights, one after another."""
    artifact = disagreement.artifact
    flight, clock = artifact.array("residual/flight"), artifact.array("residual/time")
    offset = flight_offsets(flight, clock)
    time = clock + offset[flight.astype(int)]
    channels = known_channels(disagreement, "gap/floors")
    value = artifact.array("residual/value") / artifact.array("gap/floor")

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(channels))
        for axes, (index, channel) in zip(panels, channels, strict=True):
            for number in np.unique(flight):
                own = flight == number
                line(axes, time[own], value[own, index], color="#1b4f8a", linewidth=0.9)
            axes.axhspan(-1.0, 1.0, color="#dddddd", zorder=0)
            _mark_stretches(axes, disagreement, channel, offset)
            for number in np.unique(flight)[1:]:
                axes.axvline(time[flight == number][0], color="black", linewidth=0.7, linestyle=(0, (4, 2)))
            axes.set_xlim(time.min(), time.max())
            axes.set_title(channel_words(channel))
        figure.supylabel("gap, noise floors", fontsize=9.5)
        panels[-1].set_xlabel("time, s; flights one after another")

    more = " Dashed lines part the flights, in the order given." if len(offset) > 1 else ""
    caption = (
        f"Gap over time, in noise floors; the grey band is one floor up and down. Shaded and numbered: the {STRETCHES} "
        f"stretches in which it is largest, as in the table below.{more}"
    )
    return plot(name, caption, "Gap of each channel over time in noise floors", 0.7 + 1.1 * len(channels), draw)


def flight_offsets(flight: Array, clock: Array) -> Array:
    """Put the clocks of flights one after another.

    Parameters
    ----------
    flight : array, shape (window,)
    clock : array, shape (window,), s

    Returns
    -------
    array, shape (flight,), s
        To be added to the clock of each flight.
    """
    offset, end = np.zeros(int(flight.max(initial=-1.0)) + 1), 0.0
    for number in range(len(offset)):
        own = clock[flight == number]
        if len(own):
            offset[number] = end - own[0]
            end += own[-1] - own[0] + (own[-1] - own[0]) / max(len(own) - 1, 1)
    return offset


def _mark_stretches(axes: Axes, disagreement: Source, channel: str, offset: Array) -> None:
    artifact = disagreement.artifact
    columns = (artifact.array(f"stretch/{key}")[:STRETCHES] for key in ("flight", "start", "end"))
    names = artifact.texts("stretch/channel")[:STRETCHES]
    for rank, (flight, start, end, name) in enumerate(zip(*columns, names, strict=True), start=1):
        if name != channel:
            continue
        first = start + offset[int(flight)]
        axes.axvspan(first, first + end - start, color=_SHADE, zorder=0)
        middle, above = first + (end - start) / 2, axes.get_xaxis_transform()
        axes.text(middle, 0.97, str(rank), transform=above, ha="center", va="top", fontsize=8.5, zorder=5, bbox=_LABEL)
