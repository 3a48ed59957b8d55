"""Distribution of the torque error beside the normal one: histogram and quantiles."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from cpfls_cli.arrays import Array
from cpfls_cli.pages.figures.before_after import legend_over
from cpfls_cli.pages.figures.by_axis import by_axis
from cpfls_cli.pages.judged import AXES
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import BASELINE, plain_ticks, plot, style_of
from cpfls_cli.report.content import Plot

_QUARTILE = 0.6745
_FILL: dict[str, Any] = {"color": "#9db8d6", "edgecolor": "#1b4f8a", "linewidth": 0.3}


def distribution_figure(name: str, model: Source) -> Plot:
    """Draw histogram and quantiles of the torque error by axis, each beside the normal distribution.

    Parameters
    ----------
    model : Source
        With residuals.
    """
    artifact = model.artifact
    edges, counts = (artifact.array(f"residuals/histogram_{key}") for key in ("edge", "count"))
    normal, quantiles = artifact.array("residuals/normal_quantile"), artifact.array("residuals/quantile")

    def draw(figure: Figure) -> None:
        upper, lower = by_axis(figure, rows=2)
        for index in range(len(AXES)):
            middle, deviation = _robust(normal, quantiles[:, index])
            _histogram(upper[index], edges[:, index], counts[:, index], middle, deviation)
            _quantiles(lower[index], normal, quantiles[:, index], middle, deviation)
        upper[0].set_ylabel("errors in a bin")
        upper[1].set_xlabel("error, N m")
        lower[0].set_ylabel("quantile of the error, N m")
        lower[1].set_xlabel("quantile of the standard normal distribution")
        legend_over(figure, upper[0])

    caption = (
        f"Distribution of the torque error of {model.label} on {artifact.text('residuals/part')}: histogram, and its "
        "quantiles over those of the normal distribution (dashed: the normal distribution through the quartiles). "
        "Points that leave the dashed line at the ends are errors larger than noise makes them."
    )
    return plot(name, caption, "Histogram and quantile plot of the torque error by axis", 4.6, draw)


def _robust(normal: Array, quantiles: Array) -> tuple[float, float]:
    """Fit a normal distribution to median and quartiles, which outliers do not move."""
    low, middle, high = np.interp([-_QUARTILE, 0.0, _QUARTILE], normal, quantiles)
    return float(middle), float(high - low) / (2 * _QUARTILE)


def _histogram(axes: Axes, edges: Array, counts: Array, middle: float, deviation: float) -> None:
    widths = np.diff(edges)
    axes.bar(edges[:-1], counts, widths, align="edge", label="errors", **_FILL)
    if deviation > 0 and (widths > 0).all():
        x = np.linspace(edges[0], edges[-1], 201)
        density = np.exp(-0.5 * ((x - middle) / deviation) ** 2) / (deviation * np.sqrt(2 * np.pi))
        axes.plot(
            x, counts.sum() * widths.mean() * density, label="normal distribution", **{**BASELINE, "color": "black"}
        )
    axes.grid(visible=False, axis="x")
    axes.xaxis.set_major_locator(MaxNLocator(3, symmetric=True))
    plain_ticks(axes.xaxis)


def _quantiles(axes: Axes, normal: Array, quantiles: Array, middle: float, deviation: float) -> None:
    axes.plot(normal, quantiles, "o", markersize=2.4, color=style_of(0)["color"])
    ends = np.array([normal[0], normal[-1]])
    axes.plot(ends, middle + deviation * ends, **{**BASELINE, "color": "black"})
