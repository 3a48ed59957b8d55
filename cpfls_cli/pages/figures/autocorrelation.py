"""Autocorrelation of the torque error, with the band that white noise keeps to."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from cpfls_cli.pages.figures.before_after import legend_over
from cpfls_cli.pages.figures.by_axis import by_axis
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import GREY, plot, style_of
from cpfls_cli.report.content import Plot


def autocorrelation_figure(name: str, model: Source) -> Plot:
    """Draw the correlation of the torque error with itself some time later, by axis.

    Parameters
    ----------
    model : Source
        With residuals.
    """
    artifact = model.artifact
    lag, values = artifact.array("residuals/lag"), artifact.array("residuals/autocorrelation")
    band = artifact.number("residuals/band")
    low = min(-0.2, float(np.nanmin(values, initial=0.0)) - 0.05)

    def draw(figure: Figure) -> None:
        (panels,) = by_axis(figure, share_y=True)
        for axes, column in zip(panels, values.T, strict=True):
            axes.axhspan(-band, band, color="#d9d9d9", label="95 % of the lags of white noise", zorder=0)
            axes.axhline(0.0, color=GREY, linewidth=0.7)
            axes.plot(lag, column, marker="o", markersize=2.6, label="error", **style_of(0))
            axes.set_ylim(low, 1.05)
        panels[0].set_ylabel("correlation")
        panels[1].set_xlabel("lag, s")
        legend_over(figure, panels[0])

    caption = (
        f"Correlation of the torque error of {model.label} with itself some time later, on "
        f"{artifact.text('residuals/part')}. Errors that noise alone makes stay within the grey band at 95 % of the "
        "lags; what stays outside is motion that the model does not explain."
    )
    return plot(name, caption, "Autocorrelation of the torque error by axis, with the band of white noise", 2.5, draw)
