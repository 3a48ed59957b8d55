"""Best value of several searches against time: medians with bands, readable in black and white."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("svg")

import matplotlib.pyplot as plt
import numpy as np

from cpfls_cli.arrays import Array

STYLES = ("-", "--", ":", "-.", (0, (8, 2)), (0, (1, 1)), (0, (4, 1, 1, 1, 1, 1)))
GREYS = ("0", "0.25", "0.1", "0.3", "0.4", "0.45", "0.55")
Courses = Sequence[tuple[Array, Array]]


def draw(courses: Mapping[str, Courses], path: Path) -> None:
    """Draw seconds and best values of each search's runs, in the order given; bands for the first two."""
    matplotlib.rcParams |= {"svg.hashsalt": "cpfls", "svg.fonttype": "none", "font.size": 9}
    figure, axes = plt.subplots(figsize=(7.0, 4.2), layout="constrained")
    for number, (name, runs) in enumerate(courses.items()):
        time, values = _on_common_times(runs)
        style = {"linestyle": STYLES[number], "color": GREYS[number]}
        axes.plot(time, np.median(values, axis=0), label=name, linewidth=2.2 if number == 0 else 1.2, **style)
        axes.fill_between(time, values.min(axis=0), values.max(axis=0), color=GREYS[number], alpha=0.08, linewidth=0)
    axes.set(yscale="log", xscale="log", xlabel="CPU time in s", ylabel="best mean squared error in N²m²")
    axes.grid(which="both", color="0.9", linewidth=0.5)
    axes.legend(frameon=False)
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def _on_common_times(runs: Courses) -> tuple[Array, Array]:
    """Give the best values of all runs at common times, from when each has one to when the first ends."""
    time = np.geomspace(max(seconds[0] for seconds, _ in runs), min(seconds[-1] for seconds, _ in runs), 200)
    steps = [best[np.searchsorted(seconds, time, side="right") - 1] for seconds, best in runs]
    return time, np.array(steps)
