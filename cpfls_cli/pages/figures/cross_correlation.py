"""Correlation of the torque error with the signals that it may follow."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cpfls_cli.arrays import Array
from cpfls_cli.pages.judged import AXES
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import plain_ticks, plot, stacked, style_of
from cpfls_cli.report.content import Plot

_NAMED = 3
_OTHERS = {"color": "#b5b5b5", "linewidth": 0.7, "zorder": 1.5}


def cross_correlation_figure(name: str, model: Source) -> Plot:
    """Draw the correlation of error and inputs over the lag; the strongest three of each axis are named.

    Parameters
    ----------
    model : Source
        With residuals.
    """
    artifact = model.artifact
    inputs, lag = artifact.texts("residuals/input"), artifact.array("residuals/input_lag")
    values, band = artifact.array("residuals/correlation"), artifact.number("residuals/band")

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(AXES))
        for index, (axes, axis) in enumerate(zip(panels, AXES, strict=True)):
            axes.axhspan(-band, band, color="#d9d9d9", zorder=0)
            _draw_axis(axes, lag, values[:, :, index], inputs)
            axes.set_title(f"error on {axis}", loc="right")
            plain_ticks(axes.yaxis)
        figure.supylabel("correlation", fontsize=9.5)
        panels[-1].set_xlabel("lag, s (positive: the error follows the input)")

    caption = (
        f"Correlation of the torque error of {model.label} with the signals that go into the model and the "
        f"torque that comes out of it, on {artifact.text('residuals/part')}; the three strongest of each axis are "
        "named, the others are grey lines. "
        "Far outside the grey band the error follows a signal, so that a better model could explain it; slow signals "
        "leave the band by chance too."
    )
    return plot(name, caption, "Correlation of the torque error with each input over the lag", 5.6, draw)


def strongest(values: Array) -> Array:
    """Find the largest size of the correlation over all lags.

    Parameters
    ----------
    values : array, shape (input, lag, ...)

    Returns
    -------
    array, shape (input, ...)
        NaN where it is not known at any lag.
    """
    known = np.where(np.isfinite(values), np.abs(values), -1.0).max(axis=1)
    return np.where(known < 0, np.nan, known)


def _draw_axis(axes: Axes, lag: Array, values: Array, inputs: list[str]) -> None:
    order = np.argsort(-np.nan_to_num(strongest(values), nan=-1.0), kind="stable")
    handles = []
    for rank, index in enumerate(order):
        if not np.isfinite(values[index]).any():
            continue
        style = style_of(rank) if rank < _NAMED else _OTHERS
        (curve,) = axes.plot(lag, values[index], label=inputs[index], **style)
        handles += [curve] if rank < _NAMED else []
    if handles:
        axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=_NAMED, borderaxespad=0.1)
