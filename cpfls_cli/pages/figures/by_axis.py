"""Plots side by side, one for each axis of rotation."""

from __future__ import annotations

from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cpfls_cli.pages.judged import AXES
from cpfls_cli.report.canvas import plain_ticks


def by_axis(figure: Figure, rows: int = 1, share_y: Literal["row"] | bool = False) -> list[list[Axes]]:
    """Make plots in three columns: roll, pitch, yaw; each row with one x axis.

    Parameters
    ----------
    share_y : bool or "row"
        Whether all plots, or those of a row, have one y axis.

    Returns
    -------
    list of list of matplotlib.axes.Axes
        By row.
    """
    grid = figure.subplots(rows, len(AXES), sharex="row", sharey=share_y, squeeze=False)
    for axes, axis in zip(grid[0], AXES, strict=True):
        axes.set_title(axis)
    for axes in grid.flat:
        plain_ticks(axes.yaxis)
    return [list(row) for row in grid]
