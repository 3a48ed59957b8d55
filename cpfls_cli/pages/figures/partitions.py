"""Figure 6: the membership functions of every partition."""

from __future__ import annotations

from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cpfls_cli.arrays import Array
from cpfls_cli.fuzzy.membership import join_ends, memberships
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import plot, style_of
from cpfls_cli.report.content import Plot

_POINTS = np.linspace(0.0, 1.0, 401)
_COLUMNS = 2
_CLOSE = 0.05


def partitions_figure(name: str, model: Source) -> Plot:
    """Draw the membership functions of all partitions, side by side.

    References
    ----------
    Figure 6 of the paper; equation (8).
    """
    partitions = partitions_of(model)
    joined = model.config["identification"]["structure"] == "cpfls"
    rows = -(-len(partitions) // _COLUMNS)

    def draw(figure: Figure) -> None:
        panels = figure.subplots(rows, _COLUMNS, sharex=True, sharey=True, squeeze=False)
        for axes, (title, peaks) in zip(panels.flat, partitions.items(), strict=False):
            _draw_partition(axes, peaks, joined)
            axes.set_title(title)
        for axes in panels.flat[len(partitions) :]:
            axes.set_axis_off()
        for axes in panels[:, 0]:
            axes.set_ylabel("membership")
        for axes in panels[-1]:
            axes.set_xlabel("input, scaled to 0 .. 1")

    circle = "; the first and the last are one function (1), which closes the circle" if joined else ""
    caption = f"Figure 6. Membership functions of the partitions of {model.label}, numbered at their peaks{circle}."
    return plot(name, caption, "Membership functions of each fuzzy partition on the interval 0 to 1", 1.75 * rows, draw)


def partitions_of(model: Source) -> dict[str, Array]:
    """Group the breakpoints of a model by partition."""
    names, peaks = model.artifact.texts("model/partition"), model.artifact.array("model/breakpoints")
    return {name: peaks[[other == name for other in names]] for name in dict.fromkeys(names)}


def _draw_partition(axes: Axes, peaks: Array, joined: bool) -> None:
    # The peaks themselves belong to the grid, or a narrow function would lose its top.
    points = np.union1d(_POINTS, peaks)
    values = memberships(points, peaks).value
    values = join_ends(values) if joined else values
    for function in range(values.shape[1]):
        axes.plot(points, values[:, function], **style_of(function))
    axes.set_ylim(0.0, 1.18)
    axes.set_yticks([0.0, 0.5, 1.0])
    for index, peak in enumerate(peaks):
        number = index % values.shape[1] + 1
        side = _side(peaks, index)
        axes.text(peak, 1.03, str(number), ha=side, fontsize=8, color=style_of(number - 1)["color"])


def _side(peaks: Array, index: int) -> Literal["left", "center", "right"]:
    """Keep the numbers of two close peaks apart."""
    if index + 1 < len(peaks) and peaks[index + 1] - peaks[index] < _CLOSE:
        return "right"
    return "left" if index > 0 and peaks[index] - peaks[index - 1] < _CLOSE else "center"
