"""Entries of the inertia matrix over roll or pitch, with their bands and what a second identification gave."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from cpfls_cli.arrays import Array
from cpfls_cli.pages.evidence import has
from cpfls_cli.pages.figures.before_after import legend_over
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import BASELINE, band, plain_ticks, plot, style_of
from cpfls_cli.report.content import Plot
from cpfls_cli.report.decimation import runs

ENTRIES = ("D22", "D33", "D23", "D11", "D12", "D13")
_COLUMNS = 3
_AGAIN = {**style_of(1), "linewidth": 1.2}
_VISITED = "#eef3e6"
_ROOM = 0.6
_LEAST = 0.02

OUTSIDE_WORDS = "Where training was not, a band says what the structure does, not what the vehicle does."
"""What a band is where training was not."""

MISFIT_WORDS = "Where the errors are misfit of the structure and not noise, a band need not hold the truth."
"""What a band leaves out."""

_SAME = 1e-9


def inertia_curves_figure(name: str, model: Source, curve: int) -> Plot:
    """Draw the six entries of D(q) along one curve of attitudes.

    Parameters
    ----------
    model : Source
        With curves.
    """
    artifact = model.artifact
    word = artifact.texts("curves/name")[curve]
    attitude = np.degrees(artifact.array("curves/attitude")[curve])
    moving = int(np.argmax(np.ptp(attitude, axis=0)))
    visited = artifact.array("curves/outside")[curve] == 0

    def draw(figure: Figure) -> None:
        grid = figure.subplots(len(ENTRIES) // _COLUMNS, _COLUMNS, sharex=True)
        for axes, entry in zip(grid.flat, ENTRIES, strict=True):
            _draw_entry(axes, model, curve, entry, attitude[:, moving], visited)
        grid[-1, 1].set_xlabel(f"{word.removeprefix('over ')}, °")
        figure.supylabel("kg m²", fontsize=9.5)
        legend_over(figure, grid[0, 0])

    again = " Dashed: identified again from a simulation of the model itself." if has(model, "round_trip") else ""
    caption = (
        f"D(q) of {model.label} {word}, with 95 % bands; grey: the rigid body that fits best. Shaded green: where "
        f"training was. {OUTSIDE_WORDS} {MISFIT_WORDS}{_same(model, curve)}{again}"
    )
    return plot(name, caption, f"Six entries of the inertia matrix {word}, with bands", 4.5, draw)


def entry_of(values: Array, entry: str) -> Array:
    """Take an entry such as D23 out of matrices.

    Parameters
    ----------
    values : array, shape (..., 3, 3)

    Returns
    -------
    array, shape (...)
    """
    return np.asarray(values[..., int(entry[1]) - 1, int(entry[2]) - 1])


def keep_scale(axes: Axes, shown: list[Array], largest: float) -> None:
    """Keep the scale of what training saw: a band that opens where it was not would flatten everything.

    Parameters
    ----------
    shown : list of array
        What must be seen in full.
    largest : float
        Entry of the whole matrix, so that rounding of an entry that is zero is not drawn large.
    """
    known = np.concatenate([curve[np.isfinite(curve)] for curve in shown])
    if known.size:
        low, high = float(known.min()), float(known.max())
        room = max(_ROOM * (high - low), _LEAST * largest) / 2
        axes.set_ylim(low - room, high + room)


def _same(model: Source, curve: int) -> str:
    values, rigid = (model.artifact.array(f"curves/{key}")[curve] for key in ("inertia", "rigid_body"))
    same = np.allclose(values, rigid, rtol=0.0, atol=_SAME * float(np.abs(rigid).max(initial=0.0)), equal_nan=True)
    return " This model is that rigid body, so the grey line lies under its own." if same else ""


def _draw_entry(axes: Axes, model: Source, curve: int, entry: str, angle: Array, visited: Array) -> None:
    keys = ["curves/inertia", "curves/low", "curves/high", "curves/rigid_body"]
    values, low, high, rigid = (entry_of(model.artifact.array(key)[curve], entry) for key in keys)
    for first, last in runs(visited):
        axes.axvspan(angle[first], angle[last], color=_VISITED, label="training was here", zorder=0)
    band(axes, angle, low, high, color="#9db8d6", alpha=0.7, label="95 % band")
    axes.plot(angle, rigid, label="rigid body", **{**BASELINE, "linewidth": 1.6})
    axes.plot(angle, values, label="model", **{**style_of(0), "linewidth": 1.6})
    if has(model, "round_trip"):
        again = entry_of(model.artifact.array("round_trip/inertia")[curve], entry)
        axes.plot(angle, again, label="identified again", **_AGAIN)
    axes.set_title(entry)
    axes.set_xlim(angle[0], angle[-1])
    axes.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 1.5, 2, 3, 4.5, 5, 6, 9, 10]))
    plain_ticks(axes.yaxis)
    largest = float(np.abs(model.artifact.array("curves/inertia")).max(initial=1e-12))
    keep_scale(axes, [rigid, values, low[visited], high[visited]], largest)
