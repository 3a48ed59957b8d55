"""Figures of paths and flights, and what templates of flights use."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.autopilots.law import AXES
from cpfls_cli.flights.flight import Flight
from cpfls_cli.report.canvas import Drawn, legend_above, line, stacked, style_of
from cpfls_cli.report.numbers import plain
from cpfls_cli.stages._demand import infeasible_sentence
from cpfls_cli.units import SPEED_UNITS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TURN = 360.0


def draw_attitude(r: Any, figure: Figure) -> None:
    """Draw roll and pitch of a path or a flight: Figure 3 of the paper."""
    axes = figure.subplots()
    for index, axis in enumerate(AXES[:2]):
        line(axes, r.time, np.degrees(r.attitude[:, index]), label=axis, **style_of(index))
    axes.set_xlabel("time, s")
    axes.set_ylabel("angle, °")
    legend_above(axes)


def draw_rotation(r: Any, figure: Figure) -> None:
    """Draw attitude and Euler rates of full rotations, angles on the circle."""
    angles, rates = stacked(figure, 2)
    for index, axis in enumerate(AXES):
        style = style_of(index)
        wrapped = np.mod(np.degrees(r.attitude[:, index]), _TURN)
        # Without the strokes where an angle goes round.
        seams = np.flatnonzero(np.abs(np.diff(wrapped)) > _TURN / 2) + 1
        for number, part in enumerate(np.split(np.arange(len(r.time)), seams)):
            line(angles, r.time[part], wrapped[part], label=axis if number == 0 else None, **style)
        line(rates, r.time, r.attitude_rate[:, index], **style)
    angles.set_yticks([0, 90, 180, 270, 360])
    angles.set_ylabel("angle on the circle, °")
    rates.set_ylabel("Euler rate, rad/s")
    rates.set_xlabel("time, s")
    legend_above(angles)


def _draw_torque(r: Flight, figure: Figure) -> None:
    """Draw the generalised torque, one panel per axis: Figure 4 of the paper."""
    assert r.torque is not None, "it is drawn where it is known"
    panels = stacked(figure, 3)
    for index, (axes, axis) in enumerate(zip(panels, AXES, strict=True)):
        line(axes, r.time, r.torque[:, index], **style_of(0))
        axes.set_title(f"torque on {axis}")
        axes.set_ylabel("N m")
    panels[-1].set_xlabel("time, s")


# On the circle where angles go round it: they would run off any other figure.
FIGURES = {
    "attitude": Drawn(
        "Roll and pitch angle over time", 2.7, draw_attitude, lambda r: r.attitude is not None and not r.turns
    ),
    "rotation": Drawn(
        "Roll, pitch and yaw on the circle, and their rates, over time", 4.6, draw_rotation, lambda r: r.turns
    ),
    "torque": Drawn(
        "Generalised torque on roll, pitch and yaw over time", 4.6, _draw_torque, lambda r: r.torque is not None
    ),
}

WORDS = {
    "axes": AXES,
    "infeasible_sentence": infeasible_sentence,
    "plain": plain,
    "speed_units": SPEED_UNITS,
}
