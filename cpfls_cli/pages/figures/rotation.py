"""Full rotations of a held vehicle: angles on the circle, and their rates."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from cpfls_cli.arrays import Array
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import legend_above, line, plot, stacked, style_of
from cpfls_cli.report.content import Plot

_AXES = ("roll", "pitch", "yaw")
_TURN = 360.0


def rotation_figure(name: str, trajectory: Source) -> Plot:
    """Draw attitude and Euler rates of a path of full rotations."""
    time, degrees = trajectory.artifact.array("time"), np.degrees(trajectory.artifact.array("attitude"))
    rate = trajectory.artifact.array("attitude_rate")

    def draw(figure: Figure) -> None:
        angles, rates = stacked(figure, 2)
        for index, axis in enumerate(_AXES):
            style = style_of(index)
            _on_circle(angles, time, degrees[:, index], axis, style)
            line(rates, time, rate[:, index], **style)
        angles.set_yticks([0, 90, 180, 270, 360])
        angles.set_ylabel("angle on the circle, °")
        rates.set_ylabel("Euler rate, rad/s")
        rates.set_xlabel("time, s")
        legend_above(angles)

    turns = ", ".join(f"{axis} {np.ptp(degrees[:, index]) / _TURN:.1f}" for index, axis in enumerate(_AXES))
    caption = f"Attitude and Euler rates of {trajectory.label}; range in turns: {turns}."
    return plot(name, caption, "Roll, pitch and yaw on the circle, and their rates, over time", 4.6, draw)


def _on_circle(axes: Any, time: Array, degrees: Array, label: str, style: dict[str, Any]) -> None:
    """Draw an angle modulo a turn, without the strokes where it goes round."""
    wrapped = np.mod(degrees, _TURN)
    seams = np.flatnonzero(np.abs(np.diff(wrapped)) > _TURN / 2) + 1
    for number, part in enumerate(np.split(np.arange(len(time)), seams)):
        line(axes, time[part], wrapped[part], label=label if number == 0 else None, **style)
