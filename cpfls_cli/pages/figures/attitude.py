"""Figure 3: roll and pitch over time."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import legend_above, line, plot, style_of
from cpfls_cli.report.content import Plot


def attitude_figure(name: str, source: Source) -> Plot:
    """Draw roll and pitch of a path or a flight.

    Parameters
    ----------
    source : Source
        A trajectory or a flight that holds attitude.

    References
    ----------
    Figure 3 of the paper.
    """
    time, attitude = source.artifact.array("time"), np.degrees(source.artifact.array("attitude"))

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for index, axis in enumerate(("roll", "pitch")):
            line(axes, time, attitude[:, index], label=axis, **style_of(index))
        axes.set_xlabel("time, s")
        axes.set_ylabel("angle, °")
        legend_above(axes)

    largest = np.abs(attitude[:, :2]).max(axis=0)
    caption = f"Figure 3. Roll and pitch of {source.label}; they stay within ±{largest[0]:.1f}° and ±{largest[1]:.1f}°."
    return plot(name, caption, "Roll and pitch angle over time", 2.7, draw)
