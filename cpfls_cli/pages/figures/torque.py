"""Figure 4: generalised torque over time."""

from __future__ import annotations

from matplotlib.figure import Figure

from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import line, plot, stacked, style_of
from cpfls_cli.report.content import Plot

AXES = ("roll", "pitch", "yaw")


def torque_figure(name: str, flight: Source) -> Plot:
    """Draw the generalised torque of a flight, one panel per axis.

    References
    ----------
    Figure 4 of the paper.
    """
    time, torque = flight.artifact.array("time"), flight.artifact.array("torque")

    def draw(figure: Figure) -> None:
        panels = stacked(figure, 3)
        for index, (axes, axis) in enumerate(zip(panels, AXES, strict=True)):
            line(axes, time, torque[:, index], **style_of(0))
            axes.set_title(f"torque on {axis}")
            axes.set_ylabel("N m")
        panels[-1].set_xlabel("time, s")

    caption = f"Figure 4. Generalised torque on the Euler angles along {flight.label}."
    return plot(name, caption, "Generalised torque on roll, pitch and yaw over time", 4.6, draw)
