"""What the gap follows: the signals that explain each channel best, and a map over the best two."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.pages.gap_words import channel_unit, channel_words, signal_words
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import plain_ticks, plot
from cpfls_cli.report.content import Plot
from cpfls_cli.report.numbers import plain

_SIGNALS = 4
_COLUMNS = 2
_SIGNIFICANT = 0.05
_LEVELS = 8


def dependence_figure(name: str, disagreement: Source, channels: list[str]) -> Plot:
    """Draw the share of each channel's gap that its best signals explain, each alone.

    Parameters
    ----------
    channels : list of str
        At least one.
    """
    rows = -(-len(channels) // _COLUMNS)

    def draw(figure: Figure) -> None:
        grid = figure.subplots(rows, _COLUMNS, sharex=True, squeeze=False)
        for axes, channel in zip(grid.flat, channels, strict=False):
            _draw_channel(axes, disagreement, channel)
        for axes in grid.flat[len(channels) :]:
            axes.set_axis_off()
        for column in range(min(_COLUMNS, len(channels))):
            last = grid[(len(channels) - 1 - column) // _COLUMNS, column]
            last.set_xlabel("share of variance explained")
            last.tick_params(labelbottom=True)

    caption = (
        "What the gap follows: share of its variance that a smooth curve over one signal explains on stretches that "
        "the curve was not fitted to. Filled: chance does as well in less than 5 % of trials; hollow: it may be chance."
    )
    return plot(name, caption, "Share of the gap explained by each signal, by channel", 0.6 + 1.25 * rows, draw)


def heat_map_figure(name: str, disagreement: Source) -> Plot:
    """Draw the mean gap over the two signals that explain it best.

    Parameters
    ----------
    disagreement : Source
        With a heat map.
    """
    artifact = disagreement.artifact
    channel, signals = artifact.text("heat_map/channel"), artifact.texts("heat_map/signal")
    mean = artifact.array("heat_map/mean").T
    edges = [artifact.array(f"heat_map/{key}_edge") for key in ("first", "second")]
    largest = float(np.nanmax(np.abs(mean), initial=1e-12))
    limits = MaxNLocator(_LEVELS, symmetric=True).tick_values(-largest, largest)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.set_facecolor("white")
        mesh = axes.pcolormesh(*edges, np.ma.masked_invalid(mean), cmap="PuOr", norm=BoundaryNorm(limits, 256))
        axes.add_collection(_hatched(edges[0], edges[1], mean < 0))
        bar = figure.colorbar(mesh, ax=axes, ticks=limits)
        bar.ax.set_yticklabels([plain(float(limit), smallest=1e-4) for limit in limits])
        bar.set_label(f"mean gap, {channel_unit(channel)}")
        axes.grid(visible=False)
        axes.set_xlabel(signal_words(signals[0]))
        axes.set_ylabel(signal_words(signals[1]))
        for axis in (axes.xaxis, axes.yaxis):
            plain_ticks(axis)

    caption = (
        f"Mean gap of the {channel_words(channel)}, the channel with the largest one in floors, over the two signals "
        "that explain it best. Hatched cells are negative; the flights never were where nothing is drawn."
    )
    return plot(name, caption, f"Mean gap over {signals[0]} and {signals[1]}", 3.9, draw)


def _hatched(first: Array, second: Array, marked: BoolArray) -> PatchCollection:
    """Hatch cells, so that a sign is seen without colour."""
    cells = [
        Rectangle((first[column], second[row]), first[column + 1] - first[column], second[row + 1] - second[row])
        for row, column in np.argwhere(marked)
    ]
    return PatchCollection(cells, facecolor="none", edgecolor="#6b6b6b", linewidth=0.0, hatch="////")


def _draw_channel(axes: Axes, disagreement: Source, channel: str) -> None:
    artifact = disagreement.artifact
    own = [index for index, name in enumerate(artifact.texts("dependence/channel")) if name == channel][:_SIGNALS]
    names = [artifact.texts("dependence/signal")[index] for index in own]
    shares = np.clip(artifact.array("dependence/r2")[own], 0.0, 1.0)
    sure = artifact.array("dependence/p_value")[own] < _SIGNIFICANT
    rows = np.arange(len(own))[::-1]
    colours = ["#1b4f8a" if certain else "white" for certain in sure]
    axes.barh(rows, shares, height=0.66, color=colours, edgecolor="#1b4f8a")
    axes.set_yticks(rows, names)
    axes.set_axisbelow(True)
    axes.set_xlim(0.0, 1.0)
    axes.grid(visible=False, axis="y")
    axes.set_title(channel_words(channel))
