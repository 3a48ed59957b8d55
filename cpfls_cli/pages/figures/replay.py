"""Prediction errors by horizon: how far a simulation on measured rotor speeds is off after some samples."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from cpfls_cli.pages.figures.before_after import BEFORE, HELD, legend_over, marked
from cpfls_cli.pages.gap_words import AXES
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import plain_ticks, plot
from cpfls_cli.report.content import Plot

_DEGREES = 180.0 / np.pi
_ROWS = (("rate", "rate, rad/s", 1.0), ("attitude", "attitude, °", _DEGREES))
_LABELS = {
    "before": "simulated before",
    "after": "simulated after",
    "model": "simulated",
    "held": "rates stay as they are",
}


def has_replay(source: Source) -> bool:
    """Tell whether rotor speeds were replayed."""
    data = source.artifact.data
    if "replay/rate_held" not in data or len(source.artifact.array("replay/horizon_s")) < 2:
        return False
    # Rates that never change are those of a log that has none.
    return bool(source.artifact.array("replay/rate_held").any())


def replay_figure(name: str, source: Source, where: str) -> Plot:
    """Draw errors of body rates and attitude over the horizon, by axis.

    Parameters
    ----------
    source : Source
        A disagreement, a diagnosis or an extended model.
    where : str
        On which flights, for the caption.
    """
    artifact = source.artifact
    horizon = artifact.array("replay/horizon_s")
    styles = _styles(len(horizon))
    curves = [key for key in styles if f"replay/rate_{key}" in artifact.data]
    rows = [row for row in _ROWS if np.isfinite(artifact.array(f"replay/{row[0]}_held")).any()]

    def draw(figure: Figure) -> None:
        grid = figure.subplots(len(rows), len(AXES), sharex=True, squeeze=False)
        for panels, (quantity, label, scale) in zip(grid, rows, strict=True):
            for key in curves:
                values = scale * artifact.array(f"replay/{quantity}_{key}")
                for axes, column in zip(panels, values.T, strict=True):
                    axes.plot(horizon, column, label=_LABELS[key], **styles[key])
            for axes in panels:
                axes.set_ylim(bottom=0.0)
                plain_ticks(axes.yaxis)
            panels[0].set_ylabel(label)
        for axes, axis in zip(grid[0], AXES, strict=True):
            axes.set_title(f"error about {axis}")
        grid[-1][1].set_xlabel("horizon, s")
        legend_over(figure, grid[0][0])

    caption = (
        f"Root mean square error after a simulation of so many seconds on the rotor speeds of the flight, from "
        f"measured rates, {where}. A model that is worse than rates that stay as they are predicts nothing."
    )
    return plot(name, caption, "Error of simulated rates and attitude over the horizon", 1.0 + 1.7 * len(rows), draw)


def _styles(points: int) -> Mapping[str, dict[str, Any]]:
    return {"held": HELD, "before": BEFORE, "model": {**BEFORE, "color": "black"}, "after": marked(points)}
