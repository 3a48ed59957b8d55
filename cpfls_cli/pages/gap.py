"""The gap on a page: channels in words, and its size before and after."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.gap.settings import CLEAR
from cpfls_cli.report.canvas import BASELINE, GREY, Drawn, legend_over, logarithmic, style_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from cpfls_cli.gap.naming.results import GapChange

AXES = ("x (roll)", "y (pitch)", "z (yaw)")

CHANNELS = {
    "torque x": "torque about x (roll)",
    "torque y": "torque about y (pitch)",
    "torque z": "torque about z (yaw)",
    "force x": "force along x (forward)",
    "force y": "force along y (left)",
    "force z": "force along z (up)",
}

MEASURED: dict[str, Any] = {"color": "black", "linestyle": "-", "linewidth": 2.6}
"""Wide, so that a thin line on top of it leaves an edge."""

BEFORE: dict[str, Any] = {**BASELINE, "linewidth": 1.4, "zorder": 3}
AFTER: dict[str, Any] = {"color": style_of(1)["color"], "linestyle": "-", "linewidth": 1.2, "zorder": 2.5}

_TURNS = {"x": "roll", "y": "pitch", "z": "yaw"}
_MARKS = 12
_ROOM = 3.0
_LEAST = 0.1
_SQUARE: dict[str, Any] = {"marker": "s", "markerfacecolor": "white", "markersize": 7, "linestyle": "none"}
_GIVEN: dict[str, Any] = {"color": GREY, **_SQUARE}
_SHRUNK: dict[str, Any] = {"color": AFTER["color"], "marker": "o", "markersize": 7, "linestyle": "none"}


def channel_words(channel: str) -> str:
    """Say what a channel is."""
    return CHANNELS.get(channel, channel)


def channel_name(channel: str) -> str:
    """Name a channel in a table: `pitch torque`, `force z`."""
    kind, _, axis = channel.partition(" ")
    return f"{_TURNS[axis]} torque" if kind == "torque" else channel


def channel_unit(channel: str) -> str:
    """Give the unit of a channel."""
    return "N\N{NO-BREAK SPACE}m" if channel.startswith("torque") else "N"


def marked(points: int) -> dict[str, Any]:
    """Put circles on the curve after, of so many points, so that it differs from the others without colour."""
    every = max(1, points // _MARKS)
    return {**AFTER, "marker": "o", "markersize": 3.6, "markerfacecolor": "white", "markevery": every}


def keep_in_view(axes: Axes, shown: Sequence[Array], astray: Array) -> None:
    """Let a curve that runs away leave the picture: it would flatten those that must be seen in full."""
    if leaves_view(shown, astray):
        axes.set_ylim(*_view(shown))


def leaves_view(shown: Sequence[Array], astray: Array) -> bool:
    """Tell whether a curve runs away from those that must be seen in full."""
    low, high = _view(shown)
    return bool(astray.min() < low or astray.max() > high)


def _view(shown: Sequence[Array]) -> tuple[float, float]:
    low, high = float(min(curve.min() for curve in shown)), float(max(curve.max() for curve in shown))
    room = _ROOM * max(high - low, 1e-12)
    return low - room, high + room


def hidden_gaps(gap: GapChange) -> bool:
    """Tell whether gaps are smaller than the figure of them shows."""
    return bool((np.fmin(gap.before_floors[gap.known], gap.after_floors[gap.known]) < _LEAST).any())


def sizes_drawn(gap: Callable[[Any], GapChange]) -> Drawn:
    """Make the figure of the gap of each channel on a logarithmic scale, with the noise floor."""
    return Drawn(
        "Gap of each channel before and after, in noise floors",
        lambda r: 1.0 + 0.34 * len(gap(r).known),
        lambda r, figure: _draw_sizes(gap(r), figure),
        lambda r: gap(r).known,
    )


def _draw_sizes(gap: GapChange, figure: Figure) -> None:
    channels = [channel_words(tuple(CHANNELS)[index]) for index in gap.known]
    before, after = gap.before_floors[gap.known], gap.after_floors[gap.known]
    axes = figure.subplots()
    rows = np.arange(len(channels))[::-1]
    start, end = (np.maximum(values, _LEAST) for values in (before, after))
    axes.hlines(rows, np.fmin(start, end), np.fmax(start, end), color="#bbbbbb", linewidth=2, zorder=1)
    axes.plot(start, rows, label="before", zorder=2, **_GIVEN)
    axes.plot(end, rows, label="after", zorder=3, **_SHRUNK)
    axes.axvspan(0.8 * _LEAST, CLEAR, color="#eeeeee", label="within noise", zorder=0)
    axes.axvline(1.0, color="black", linewidth=1.1, linestyle=(0, (4, 2)), label="noise floor", zorder=1)
    axes.set_yticks(rows, channels)
    axes.set_ylim(-0.6, len(channels) - 0.4)
    axes.grid(visible=False, axis="y")
    largest = float(np.nanmax([*before, *after, 1.0]))
    axes.set_xlim(0.8 * _LEAST, 1.6 * max(largest, 3.0))
    logarithmic(axes, _LEAST, 1.6 * largest)
    axes.set_xlabel("gap, noise floors")
    legend_over(figure, axes)
