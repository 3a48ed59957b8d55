"""One style for all figures, and the one way to draw them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.report.content import Plot
from cpfls_cli.report.decimation import evenly_spread, kept_samples
from cpfls_cli.report.numbers import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

# Matplotlib is loaded where something is drawn: the sentences of a page are also those of the terminal.
WIDTH = 7.6
# Both ends of a band are drawn at the samples that either of them keeps.
_BAND_POINTS = 400
GREY = "#767676"
STYLES: tuple[dict[str, Any], ...] = (
    {"color": "#1b4f8a", "linestyle": "-"},
    {"color": "#c4570a", "linestyle": (0, (5, 1.6))},
    {"color": "#12805c", "linestyle": (0, (6, 1.5, 1.2, 1.5))},
    {"color": "#8b2f7f", "linestyle": (0, (1.3, 1.3))},
    {"color": "#7a5c00", "linestyle": (0, (8, 2))},
    {"color": "#3d3d3d", "linestyle": (0, (4, 1.4, 1.2, 1.4, 1.2, 1.4))},
)
"""Colour and dashes together, so that a print in black and white can be read."""

BASELINE: dict[str, Any] = {"color": GREY, "linestyle": (0, (3, 2)), "linewidth": 1.2}
"""Whatever a result is compared with."""

_STYLE: dict[str, Any] = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9.5,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.labelsize": 9.5,
    "axes.edgecolor": "#555555",
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.unicode_minus": True,
    "axes.formatter.useoffset": False,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "legend.handlelength": 2.8,
    "xtick.color": "#333333",
    "ytick.color": "#333333",
}


def plot(name: str, caption: str, description: str, height: float, draw: Callable[[Figure], None]) -> Plot:
    """Draw a figure.

    Parameters
    ----------
    name : str
        Unique on the page.
    description : str
        What the figure shows, for those who do not see it.
    height : float
        Inches, at a width of 7.6.
    draw : callable
        Fills an empty figure.
    """
    import matplotlib
    from matplotlib.figure import Figure

    from cpfls_cli.report.collect import panels_of
    from cpfls_cli.report.svg import inline_svg

    style: Any = {**_STYLE, "svg.hashsalt": name}
    with matplotlib.rc_context():
        # A reader's own matplotlib settings must not change the page.
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(style)
        figure = Figure(figsize=(WIDTH, height), layout="constrained")
        draw(figure)
        return Plot(name, caption, inline_svg(figure, name, description), description, panels_of(figure))


def line(axes: Axes, x: Array, y: Array, **style: Any) -> None:
    """Draw a curve, thinned out so that no peak is lost.

    Parameters
    ----------
    x, y : array, shape (samples,)
    **style
        As `Axes.plot` takes it.
    """
    from cpfls_cli.report.collect_artists import SPREAD

    kept, shown = kept_samples(y), evenly_spread(len(y))
    for curve in axes.plot(x[kept], y[kept], **style):
        # A table of the curve shows samples of the whole one: extremes alone would make it look rough.
        setattr(curve, SPREAD, (x[shown], y[shown]))
    plain_ticks(axes.yaxis)


def band(axes: Axes, x: Array, low: Array, high: Array, **style: Any) -> None:
    """Shade the range of a curve, thinned out so that no peak is lost.

    Parameters
    ----------
    x, low, high : array, shape (samples,)
    **style
        As `Axes.fill_between` takes it.
    """
    kept = np.union1d(kept_samples(low, _BAND_POINTS), kept_samples(high, _BAND_POINTS))
    axes.fill_between(x[kept], low[kept], high[kept], **{"linewidth": 0.0, "zorder": 1.0, **style})


def stacked(figure: Figure, rows: int) -> list[Axes]:
    """Make plots one above the other with one x axis."""
    return list(figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0])


def legend_above(axes: Axes, columns: int = 4) -> None:
    """Put a legend above a plot, where it hides no curve."""
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=0.1)


def plain_ticks(axis: Axis) -> None:
    """Write every tick in full: a factor in the corner of a plot is easily overlooked.

    Parameters
    ----------
    axis : matplotlib.axis.Axis
        With a linear scale.
    """
    from matplotlib.ticker import FuncFormatter

    axis.set_major_formatter(FuncFormatter(lambda value, _: plain(value, smallest=1e-4)))


def style_of(index: int) -> dict[str, Any]:
    """Get the style of the curve with this number; styles repeat after six."""
    return STYLES[index % len(STYLES)]
