"""What a measurement and the models before and after look like, in every figure of the gap workflow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cpfls_cli.arrays import Array
from cpfls_cli.report.canvas import BASELINE, GREY, plain_ticks, style_of

MEASURED: dict[str, Any] = {"color": "black", "linestyle": "-", "linewidth": 2.6}
"""Wide, so that a thin line on top of it leaves an edge."""

BEFORE: dict[str, Any] = {**BASELINE, "linewidth": 1.4, "zorder": 3}
AFTER: dict[str, Any] = {"color": style_of(1)["color"], "linestyle": "-", "linewidth": 1.2, "zorder": 2.5}
HELD: dict[str, Any] = {"color": GREY, "linestyle": (0, (1, 1.6)), "linewidth": 1.2}

_MARKS = 12
_ROOM = 3.0
_AXES = 3


def marked(points: int) -> dict[str, Any]:
    """Put circles on the curve after, so that it is told from the others without colour.

    Parameters
    ----------
    points : int
        Of the curve.
    """
    every = max(1, points // _MARKS)
    return {**AFTER, "marker": "o", "markersize": 3.6, "markerfacecolor": "white", "markevery": every}


def keep_in_view(axes: Axes, shown: Sequence[Array], astray: Array) -> bool:
    """Stop a curve that runs away from flattening the others.

    Parameters
    ----------
    shown : sequence of array
        Curves that must be seen in full.
    astray : array
        The curve that may leave the picture.

    Returns
    -------
    bool
        Whether it does.
    """
    low, high = float(min(curve.min() for curve in shown)), float(max(curve.max() for curve in shown))
    room = _ROOM * max(high - low, 1e-12)
    leaves = bool(astray.min() < low - room or astray.max() > high + room)
    if leaves:
        axes.set_ylim(low - room, high + room)
    return leaves


def by_channel(figure: Figure, channels: Sequence[str], share_y: bool = False) -> list[Axes]:
    """Make a small plot for each channel, torques above forces, named."""
    rows = -(-len(channels) // _AXES)
    grid = figure.subplots(rows, _AXES, sharex=True, sharey=share_y, squeeze=False)
    for axes in grid.flat[len(channels) :]:
        axes.set_axis_off()
    for axes, channel in zip(grid.flat, channels, strict=False):
        axes.set_title(channel)
        plain_ticks(axes.yaxis)
    return list(grid.flat[: len(channels)])


def legend_over(figure: Figure, axes: Axes) -> None:
    """Put one legend above a whole figure.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        With the curves.
    """
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=4)
