"""Best value of several searches against time: medians with bands, readable in black and white."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("svg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import ScalarFormatter

from cpfls_cli.arrays import Array

STYLES = ("-", "--", ":", "-.", (0, (8, 2)), (0, (3, 1, 1, 1, 1, 1)))
GREYS = ("0", "0.35", "0.1", "0.2", "0.45", "0.6")
# What the first chromosomes happen to be says nothing of a search.
FIRST_S = 0.5
Courses = Sequence[tuple[Array, Array]]


def draw(courses: Mapping[str, Courses], path: Path) -> None:
    """Draw CPU seconds and best mean squared errors of each search's runs, the first search strongest."""
    matplotlib.rcParams |= {"svg.hashsalt": "cpfls", "svg.fonttype": "none", "font.size": 9}
    figure, axes = plt.subplots(figsize=(7.2, 4.4), layout="constrained")
    for number, (name, runs) in enumerate(courses.items()):
        time, values = _on_common_times(runs)
        style = {"linestyle": STYLES[number], "color": GREYS[number], "linewidth": 2.2 if number == 0 else 1.3}
        axes.plot(time, 1e9 * np.median(values, axis=0), label=name, **style)
        low, high = 1e9 * values.min(axis=0), 1e9 * values.max(axis=0)
        axes.fill_between(time, low, high, color=GREYS[number], alpha=0.08, linewidth=0)
    axes.set(yscale="log", xscale="log", xlabel="CPU time / s", ylabel="best mean squared error / 1e-9 N²m²")
    axes.set_xticks([0.5, 1, 2, 5, 10, 15])
    axes.set_yticks([2, 3, 4, 5, 6, 8, 10])
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter("")
    axes.grid(color="0.9", linewidth=0.5)
    axes.legend(frameon=False, ncols=2)
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def _on_common_times(runs: Courses) -> tuple[Array, Array]:
    """Give the best values of all runs at common times, up to when the first ends."""
    time = np.geomspace(FIRST_S, min(seconds[-1] for seconds, _ in runs), 200)
    steps = [best[np.searchsorted(seconds, time, side="right") - 1] for seconds, best in runs]
    return time, np.array(steps)
