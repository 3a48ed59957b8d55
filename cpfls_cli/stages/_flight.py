"""Figures of paths and flights, what they demand of rotors, and what templates of flights use."""

from __future__ import annotations

from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.autopilots.law import AXES
from cpfls_cli.flightlog.results import Flight
from cpfls_cli.report.canvas import Drawn, Figure, legend_above, line, stacked, style_of
from cpfls_cli.report.content import plain
from cpfls_cli.simulation.inverse import Flyability, TooMuch
from cpfls_cli.trajectory.planning import PlannedRotation, Trajectory
from cpfls_cli.units import SPEED_UNITS
from cpfls_cli.vehicle.rotors import Infeasible

_TURN = 360.0
STILL_AIR = "flown in still air; the model holds the gusts of its flights: --gusts plays them"
"""Of a flight in which the gusts that its model holds were not played."""


def demand_sentences(demand: Flyability, planned: PlannedRotation) -> tuple[str, ...]:
    """Say what a plan asks for beyond what the vehicle has, with its time and place; nothing where it can do it all."""
    return (
        *(_too_much(too_much, planned) for too_much in demand.too_much),
        *(
            infeasible_sentence(one) + _place(int(np.searchsorted(planned.time, one.first_s)), planned)
            for one in demand.rotors
        ),
    )


def infeasible_sentence(one: Infeasible) -> str:
    """Say what a rotor was asked for that it cannot do."""
    return (
        f"M{one.rotor}: {one.kind} asked for at {_samples(one.samples)} from {one.first_s:.2f} s to "
        f"{one.last_s:.2f} s (worst squared speed {one.worst:.6g} rad^2/s^2)"
    )


def _too_much(too_much: TooMuch, planned: PlannedRotation) -> str:
    name, unit = too_much.what.split(", ")
    worst = f"{too_much.worst:.4g} {unit} at {planned.time[too_much.at]:.2f} s{_place(too_much.at, planned)}"
    start = f"from {planned.time[too_much.first]:.2f} s, {_samples(too_much.count)}"
    return f"{name} of up to {worst} asked for; the limit is {too_much.limit:.4g} {unit} (beyond it {start})"


def _samples(count: int) -> str:
    return f"{count} sample{'' if count == 1 else 's'}"


def _place(sample: int, planned: PlannedRotation) -> str:
    if isinstance(planned, Trajectory):
        return f", at x y z = {_written(planned.position[sample])} m"
    return f", at roll pitch yaw = {_written(np.degrees(planned.attitude[sample]) % _TURN)} deg"


def _written(values: Array) -> str:
    return " ".join(f"{value:.2f}" for value in values)


def _draw_attitude(r: Any, figure: Figure) -> None:
    """Draw roll and pitch of a path or a flight: Figure 3 of the paper."""
    axes = figure.subplots()
    for index, axis in enumerate(AXES[:2]):
        line(axes, r.time, np.degrees(r.attitude[:, index]), label=axis, **style_of(index))
    axes.set(xlabel="time, s", ylabel="angle, °")
    legend_above(axes)


def _draw_rotation(r: Any, figure: Figure) -> None:
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
    angles.set(yticks=[0, 90, 180, 270, 360], ylabel="angle on the circle, °")
    rates.set(ylabel="Euler rate, rad/s", xlabel="time, s")
    legend_above(angles)


def _draw_torque(r: Flight, figure: Figure) -> None:
    """Draw the generalised torque, one panel per axis: Figure 4 of the paper."""
    assert r.torque is not None, "it is drawn where it is known"
    panels = stacked(figure, 3)
    for index, (axes, axis) in enumerate(zip(panels, AXES, strict=True)):
        line(axes, r.time, r.torque[:, index], **style_of(0))
        axes.set(title=f"torque on {axis}", ylabel="N m")
    panels[-1].set_xlabel("time, s")


# On the circle where angles go round it: they would run off any other figure.
FIGURES = {
    "attitude": Drawn(
        "Roll and pitch angle over time", 2.7, _draw_attitude, lambda r: r.attitude is not None and not r.turns
    ),
    "rotation": Drawn(
        "Roll, pitch and yaw on the circle, and their rates, over time", 4.6, _draw_rotation, lambda r: r.turns
    ),
    "torque": Drawn(
        "Generalised torque on roll, pitch and yaw over time", 4.6, _draw_torque, lambda r: r.torque is not None
    ),
}

WORDS = {"axes": AXES, "infeasible_sentence": infeasible_sentence, "plain": plain, "speed_units": SPEED_UNITS}
