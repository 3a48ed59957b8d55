"""Figure 2: the derivatives of a path along its first leg."""

from __future__ import annotations

from matplotlib.figure import Figure

from cpfls_cli.report.canvas import line, plot, stacked, style_of
from cpfls_cli.report.content import Plot
from cpfls_cli.report.leg import DERIVATIVES, UNITS, first_leg
from cpfls_cli.report.source import Source


def derivatives_figure(name: str, trajectory: Source) -> Plot:
    """Draw pop to displacement over the first leg.

    Parameters
    ----------
    name : str
    trajectory : Source

    Returns
    -------
    Plot

    References
    ----------
    Figure 2 of the paper.
    """
    leg = first_leg(trajectory.artifact)

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(DERIVATIVES))
        for axes, derivative, unit in zip(panels, DERIVATIVES, UNITS, strict=True):
            line(axes, leg.time, leg.curves[derivative], **style_of(0))
            axes.set_title(derivative)
            axes.set_ylabel(unit)
            axes.axhline(0.0, color="#999999", linewidth=0.6)
        panels[-1].set_xlabel("time, s")

    caption = (
        f"Figure 2. Derivatives of the displacement along the first leg of {trajectory.label}, from the sixth (pop) "
        "down to the displacement itself."
    )
    return plot(name, caption, "Seven curves over time: " + ", ".join(DERIVATIVES), 8.6, draw)
