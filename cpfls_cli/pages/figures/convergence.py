"""Convergence of the search: the best of each objective by generation."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import plain_ticks, plot, stacked, style_of
from cpfls_cli.report.content import Plot


def convergence_figure(name: str, model: Source) -> Plot:
    """Draw the best of each objective found so far, by generation."""
    best = model.artifact.array("history/best")
    generation = np.arange(len(best))
    error, unit = first_objective(model)
    titles = (f"smallest {error}", "smallest largest error", "smallest condition number")
    units = (unit, "N m", "pure number")
    evaluations = int(model.artifact.array("history/evaluations")[-1])

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(titles))
        for index, (axes, title, unit) in enumerate(zip(panels, titles, units, strict=True)):
            finite = np.where(np.isfinite(best[:, index]), best[:, index], np.nan)
            axes.plot(generation, finite, marker="o", markersize=3, **style_of(0))
            axes.set_title(title)
            axes.set_ylabel(unit)
            plain_ticks(axes.yaxis)
        panels[-1].set_xlabel("generation")
        panels[-1].xaxis.set_major_locator(MaxNLocator(integer=True))

    caption = (
        f"Search of {model.label}: the best value of each objective found so far, each possibly by another chromosome; "
        f"{evaluations} chromosomes were evaluated."
    )
    return plot(name, caption, f"Best {error}, largest error and condition number by generation", 4.6, draw)


def first_objective(model: Source) -> tuple[str, str]:
    """Name the error that the search minimised, and its unit.

    Returns
    -------
    name, unit : str
        Over a rigid body it is the error on blocks left out in turn, every axis divided by its own scale.
    """
    if model.artifact.text("model/base") == "rigid-body":
        return "cross-validated error", "scaled torque²"
    return "mean squared error", "(N m)²"
