"""Prediction by horizon: errors of attitude and body rate when measured torques are replayed through a model."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from cpfls_cli.pages.figures.before_after import HELD, legend_over
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import BASELINE, plot, style_of
from cpfls_cli.report.content import Plot
from cpfls_cli.report.numbers import plain

_ROWS = (("attitude", "attitude, °", 180.0 / np.pi), ("body_rate", "body rate, rad/s", 1.0))
_AXES = ("about x", "about y", "about z")
_STYLES: dict[str, dict[str, Any]] = {
    "model": {**style_of(0), "linewidth": 1.8},
    "rigid-body": {**BASELINE, "linewidth": 1.6},
    "nothing-moves": HELD,
}
_WORDS = {"rigid-body": "rigid body", "nothing-moves": "nothing moves"}


def steps_figure(name: str, model: Source) -> Plot:
    """Draw errors over the horizon on logarithmic axes, beside the rigid body and beside nothing that moves.

    Parameters
    ----------
    model : Source
        With predictions by horizon.
    """
    artifact = model.artifact
    horizon, predictors = artifact.array("steps/horizon"), artifact.texts("steps/model")

    def draw(figure: Figure) -> None:
        grid = figure.subplots(len(_ROWS), len(_AXES), sharex=True, sharey="row")
        for panels, (key, label, scale) in zip(grid, _ROWS, strict=True):
            errors = scale * artifact.array(f"steps/{key}")
            for place, predictor in enumerate(predictors):
                style = _STYLES.get(predictor, style_of(place + 1))
                for axes, column in zip(panels, errors[place].T, strict=True):
                    positive = np.where(column > 0, column, np.nan)
                    axes.plot(horizon, positive, label=_WORDS.get(predictor, predictor), **style)
            for axes in panels:
                axes.set_xscale("log")
                axes.set_yscale("log")
                axes.minorticks_off()
                for axis in (axes.xaxis, axes.yaxis):
                    axis.set_major_formatter(FuncFormatter(lambda value, _: plain(value, smallest=1e-3)))
            panels[0].set_ylabel(label)
        for axes, axis in zip(grid[0], _AXES, strict=True):
            axes.set_title(axis)
        grid[-1][1].set_xlabel("horizon, s")
        legend_over(figure, grid[0][0])

    windows = int(artifact.number("steps/windows"))
    caption = (
        f"Root mean square error after so many seconds, with the measured torques of {artifact.text('steps/part')} "
        f"replayed through {model.label} from {windows} starts. Nothing moves: attitude and body rate stay what they "
        "were; a model above that line predicts nothing. Both axes are logarithmic."
    )
    return plot(name, caption, "Error of predicted attitude and body rate over the horizon, by axis", 4.4, draw)
