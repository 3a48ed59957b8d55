"""Attitude error over time under several controllers."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from cpfls_cli.arrays import Array
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import BASELINE, GREY, legend_above, line, plot, stacked, style_of
from cpfls_cli.report.content import Plot

AXES = ("roll", "pitch", "yaw")
CONTROLLERS = {
    "model": "identified model",
    "rigid-body": "rigid body",
    "pd": "PD alone",
    "vehicle": "exact vehicle",
}
"""What controllers are called on the page, by name in the artifact."""

_WINDOW_S = 1.0
_SHOWN = 1e-6
"""Share of the largest error below which none is worth a look."""


def tracking_figure(name: str, flight: Source) -> Plot:
    """Draw the size of the attitude error, averaged over a second, by axis and controller.

    Parameters
    ----------
    flight : Source
        With a comparison of controllers.
    """
    artifact = flight.artifact
    time, error = artifact.array("tracking/time"), np.degrees(artifact.array("tracking/error"))
    names = artifact.texts("tracking/controller")
    window = max(int(np.sum(time - time[0] < _WINDOW_S)), 1)

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(AXES))
        for index, (axes, axis) in enumerate(zip(panels, AXES, strict=True)):
            axes.set_yscale("log")
            for number, controller in enumerate(names):
                style = BASELINE if controller == "vehicle" else style_of(number)
                line(axes, *_averaged(time, error[number, :, index], window), label=CONTROLLERS[controller], **style)
            lowest, highest = axes.get_ylim()
            axes.set_ylim(bottom=max(lowest, _SHOWN * highest))
            axes.axvline(time[0] + artifact.number("tracking/settled_from"), color=GREY, linewidth=0.8, linestyle=":")
            axes.set_title(f"error in {axis}", loc="left" if index else "right")
            axes.set_ylabel("°")
        legend_above(panels[0])
        panels[-1].set_xlabel("time, s")

    caption = (
        f"Attitude error of {flight.label}, root mean square over {_WINDOW_S:g} s, on a logarithmic scale. From the "
        "dotted line on the initial error has died down."
    )
    return plot(name, caption, "Attitude error by controller in roll, pitch and yaw over time", 5.2, draw)


def _averaged(time: Array, error: Array, window: int) -> tuple[Array, Array]:
    """Take the root mean square over a window; what follows a loss is left out, and zero has no logarithm."""
    known = error[np.isfinite(error)]
    if len(known) < window:
        return time[:0], known[:0]
    mean = np.convolve(known**2, np.full(window, 1.0 / window), mode="valid")
    middle = time[window // 2 : window // 2 + len(mean)]
    size = np.sqrt(np.maximum(mean, 0.0))
    return middle[size > 0], size[size > 0]
