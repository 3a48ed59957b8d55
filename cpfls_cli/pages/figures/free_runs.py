"""The picture of a diagnosis: body rates measured, simulated before and simulated after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.pages.figures.before_after import BEFORE, MEASURED, keep_in_view, legend_over, marked
from cpfls_cli.pages.gap_words import AXES
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import GREY, plain_ticks, plot, stacked
from cpfls_cli.report.content import Plot


def free_runs_figure(name: str, diagnosis: Source, after: str) -> Plot:
    """Draw measured and simulated body rates over the stretch in which they disagreed most.

    Parameters
    ----------
    diagnosis : Source
        With a stretch of free runs.
    after : str
        What the second model is, for the caption.
    """
    artifact = diagnosis.artifact
    time, restart = artifact.array("run/time"), artifact.array("run/restart")
    curves = {key: artifact.array(f"run/{key}") for key in ("measured", "before", "after")}
    runs = np.split(np.arange(len(time)), np.searchsorted(time, restart[1:] - 1e-9))
    worst = int(artifact.number("run/axis"))
    left: list[str] = []

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(AXES) + 1)
        for axes, start in product(panels, restart):
            axes.axvline(start, color=GREY, linewidth=1.2, linestyle=(0, (1, 1.5)), zorder=0.5)
        for index, (axes, axis) in enumerate(zip(panels, AXES, strict=False)):
            own = {key: values[:, index] for key, values in curves.items()}
            _draw_axis(axes, time, own, runs)
            axes.set_title(f"body rate about {axis}")
            axes.set_ylabel("rad/s")
            if keep_in_view(axes, (own["measured"], own["after"]), own["before"]):
                left.append(axis)
        errors = {key: curves[key][:, worst] - curves["measured"][:, worst] for key in ("before", "after")}
        _draw_axis(panels[-1], time, errors, runs)
        panels[-1].axhline(0.0, color="black", linewidth=0.8)
        panels[-1].set_title(f"simulated less measured about {AXES[worst]}")
        panels[-1].set_ylabel("rad/s")
        legend_over(figure, panels[0])
        panels[-1].set_xlabel("time, s")

    drawn = plot(name, "", "Body rates about three axes, measured and simulated before and after, over time", 6.4, draw)
    astray = f" About {' and '.join(left)} the model as given leaves the picture." if left else ""
    told = " Measured are the rates without the faults of the sensors; before starts from the log as it is."
    repaired = told if artifact.array("audit/named").any() else ""
    caption = (
        f"{artifact.text('run/flight')}, where the model as given went astray most (about "
        f"{AXES[worst]}). At each dotted line the simulation starts from the measured "
        f"rates and then runs freely on the rotor speeds of the flight. Before: the model as given; after: "
        f"{after}.{repaired}{astray}"
    )
    return replace(drawn, caption=caption)


def _draw_axis(axes: Axes, time: Array, curves: dict[str, Array], runs: Sequence[IntArray]) -> None:
    labels = {"measured": "measured", "before": "simulated before", "after": "simulated after"}
    styles = {"measured": MEASURED, "before": BEFORE, "after": marked(len(time) // len(runs))}
    for number, rows in enumerate(runs):
        for key, values in curves.items():
            axes.plot(time[rows], values[rows], label=labels[key] if number == 0 else None, **styles[key])
    plain_ticks(axes.yaxis)
