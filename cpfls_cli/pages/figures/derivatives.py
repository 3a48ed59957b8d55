"""Figure 2: the derivatives of a path along its first leg."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from cpfls_cli.pages.leg import DERIVATIVES, UNITS, first_leg
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import BASELINE, line, plot, stacked, style_of
from cpfls_cli.report.content import Plot


def derivatives_figure(name: str, trajectory: Source) -> Plot:
    """Draw pop to displacement over the first leg.

    References
    ----------
    Figure 2 of the paper.
    """
    leg, limits = first_leg(trajectory.artifact), _limits(trajectory)

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(DERIVATIVES))
        for axes, derivative, unit in zip(panels, DERIVATIVES, UNITS, strict=True):
            curve = leg.curves[derivative]
            line(axes, leg.time, curve, **style_of(0))
            axes.set_title(
                derivative if np.any(curve) else f"{derivative}: not limited, infinite where the one below jumps"
            )
            axes.set_ylabel(unit)
            axes.axhline(0.0, color="#999999", linewidth=0.6)
            for limit in limits.get(derivative, ()):
                axes.axhline(limit, **BASELINE)
        panels[-1].set_xlabel("time, s")

    caption = (
        f"Figure 2. Derivatives of the displacement along the first leg of {trajectory.label}, from the sixth (pop) "
        "down to the displacement itself."
    )
    if limits:
        caption += " Grey: the limits that it was planned under."
    return plot(name, caption, "Seven curves over time: " + ", ".join(DERIVATIVES), 8.6, draw)


def _limits(trajectory: Source) -> dict[str, tuple[float, float]]:
    """Limits along a straight leg, by derivative; those that are stated axis by axis are left out."""
    settings = trajectory.config.get("trajectory", {})
    stated = settings.get("limits", {})
    if settings.get("coordination") != "straight-line" or settings.get("displacement_measure") != "along-path":
        return {}
    return {key.split("_")[0]: (-value, value) for key, value in stated.items() if isinstance(value, float)}
