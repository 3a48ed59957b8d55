"""The Pareto front: the first objective against the condition number."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from cpfls_cli.pages.figures.convergence import first_objective
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import legend_above, plain_ticks, plot, style_of
from cpfls_cli.report.content import Plot


def front_figure(name: str, model: Source) -> Plot:
    """Draw the members of the Pareto front and mark the chosen one."""
    objectives = model.artifact.array("front/objectives")
    chosen = int(model.artifact.number("front/chosen"))
    error, unit = first_objective(model)
    others = np.arange(len(objectives)) != chosen

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.plot(
            objectives[others, 2], objectives[others, 0], "o", color="#1b4f8a", markersize=5, label="not dominated"
        )
        axes.plot(
            *objectives[chosen, [2, 0]],
            "D",
            color=style_of(1)["color"],
            markersize=9,
            markerfacecolor="none",
            markeredgewidth=2,
            label="chosen",
        )
        axes.set_xlabel("condition number")
        axes.set_ylabel(f"{error}, {unit}")
        plain_ticks(axes.yaxis)
        axes.set_xscale("log")
        legend_above(axes)

    members = f"{len(objectives)} member{'s' if len(objectives) > 1 else ''}"
    rule = model.config["identification"]["choice"]
    caption = (
        f"Pareto front of {model.label}, {members}: {error} against condition number, as the search saw "
        f"them. The third objective, the largest error, is not shown, so a member may look dominated "
        f"here. The chosen one follows the rule {rule}."
    )
    return plot(name, caption, f"Scatter of {error} against condition number, the chosen member marked", 3.0, draw)
