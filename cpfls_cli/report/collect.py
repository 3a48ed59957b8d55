"""Read from a finished figure what is drawn in it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter

from cpfls_cli.report.collect_artists import drawn_in
from cpfls_cli.report.drawn import Panel

_COLORBAR = "<colorbar>"


def panels_of(figure: Figure) -> list[Panel]:
    """Collect the panels of a figure with all that is drawn in them.

    Returns
    -------
    list of Panel
        Without panels that hold no data.
    """
    shown = [axes for axes in figure.axes if axes.get_label() != _COLORBAR]
    return [panel for axes in shown if (panel := _panel(axes, figure)).series]


def _panel(axes: Axes, figure: Figure) -> Panel:
    return Panel(
        title=next(iter(_titles(axes)), ""),
        x_label=_label(axes, "x") or figure.get_supxlabel(),
        y_label=_label(axes, "y") or figure.get_supylabel(),
        series=drawn_in(axes),
        x_names=_names(axes.xaxis),
        y_names=_names(axes.yaxis),
    )


def _titles(axes: Axes) -> Iterator[str]:
    places: Sequence[Literal["left", "center", "right"]] = ("left", "center", "right")
    yield from filter(None, (axes.get_title(place) for place in places))


def _label(axes: Axes, which: Literal["x", "y"]) -> str:
    """Find the label of an axis, which may stand at another panel that shares it."""
    shared: Any = axes.get_shared_x_axes() if which == "x" else axes.get_shared_y_axes()
    around = [axes, *(other for other in axes.figure.axes if other in shared.get_siblings(axes))]
    labels = (other.get_xlabel() if which == "x" else other.get_ylabel() for other in around)
    return next(filter(None, labels), "")


def _names(axis: Axis) -> dict[float, str]:
    """Find the words that a figure wrote at its ticks itself."""
    formatter = axis.get_major_formatter()
    # What `set_ticks` makes of labels that are given.
    given = isinstance(formatter, FuncFormatter) and isinstance(formatter.func, partial)
    if not given or not isinstance(axis.get_major_locator(), FixedLocator):
        return {}
    places = [float(place) for place in axis.get_majorticklocs()]
    return dict(zip(places, formatter.format_ticks(places), strict=True))
