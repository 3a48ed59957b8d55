"""Replicates of a search: a dot for each seed, setting by setting."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from cpfls_cli.arrays import Array
from cpfls_cli.identification.judge import spread
from cpfls_cli.pages.swept_setting import SweptSetting
from cpfls_cli.report.canvas import plain_ticks, plot, style_of
from cpfls_cli.report.content import Plot

_DECADE = 10.0
_TICKS = 4


def replicates_figure(name: str, label: str, settings: Sequence[SweptSetting]) -> Plot:
    """Draw mean squared error and condition number of every run, in a row for each setting.

    Parameters
    ----------
    name, label : str
        Of the figure, and of the sweep.
    """

    def draw(figure: Figure) -> None:
        errors, conditions = figure.subplots(1, 2, sharey=True)
        for row, setting in enumerate(reversed(settings)):
            _dots(errors, row, setting.mse[:, 0])
            _dots(conditions, row, setting.condition_number)
        errors.set_yticks(range(len(settings)), [setting.name for setting in reversed(settings)])
        errors.set_ylim(-0.6, len(settings) - 0.4)
        errors.set_xlabel("MSE, (N m)²")
        conditions.set_xlabel("condition number")
        for axes in (errors, conditions):
            axes.grid(visible=False, axis="y")
            axes.tick_params(axis="y", length=0)
            _scale(axes)

    caption = (
        f"Runs of {label}: each circle is the model of one seed, judged on the training part; the upright line is the "
        "mean of the setting."
    )
    description = "Mean squared error and condition number by setting, one circle for each seed"
    return plot(name, caption, description, 0.9 + 0.36 * len(settings), draw)


def _dots(axes: Axes, row: int, values: Array) -> None:
    """Draw runs side by side in their order, so that equal values do not hide each other."""
    offsets = np.linspace(0.22, -0.22, len(values)) if len(values) > 1 else np.zeros(len(values))
    axes.plot(values, row + offsets, "o", markersize=4.5, markerfacecolor="none", color=style_of(0)["color"])
    mean = spread(values).mean
    if np.isfinite(mean):
        axes.vlines(mean, row - 0.34, row + 0.34, color="black", linewidth=2.2, zorder=1)


def _scale(axes: Axes) -> None:
    """Take a logarithmic scale where values differ by more than a decade."""
    values = np.concatenate([line.get_xdata() for line in axes.lines]) if axes.lines else np.zeros(0)
    known = values[np.isfinite(values) & (values > 0)]
    if len(known) and known.max() > _DECADE * known.min():
        axes.set_xscale("log")
    else:
        axes.xaxis.set_major_locator(MaxNLocator(_TICKS))
        plain_ticks(axes.xaxis)
