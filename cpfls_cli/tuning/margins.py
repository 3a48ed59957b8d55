"""Margins, bandwidth and step response of a law with a vehicle, as found and over all that flights leave possible."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, nan

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, Numbers
from cpfls_cli.autopilots.law import Controller, Law
from cpfls_cli.tuning.plant import AxisPlant, HoverPlant

_LOWEST_HZ, _POINTS, _OF_NYQUIST = 0.1, 300, 0.98
_STEP_S = 1.2
STEP_RAD = np.radians(10.0)
"""Size of the step of the asked attitude that is shown."""


@dataclass(frozen=True)
class Margins:
    """How far a loop is from instability.

    Attributes
    ----------
    gain_db, phase_deg : float
        Change of gain (up or down), and of phase, that it bears alone; infinite where none makes it unstable, and not
        finite as a number where it is unstable already.
    disk : float
        Of gain and phase together: alpha of Seiler, Packard and Gahinet, 2 at most.
    crossover_hz : float
        Frequency at which the loop's gain is 1.
    stable : bool
    """

    gain_db: float
    phase_deg: float
    disk: float
    crossover_hz: float
    stable: bool

    @property
    def disk_deg(self) -> float:
        """The phase alone that the disk holds, degrees."""
        return float(np.degrees(2 * np.arctan(self.disk / 2)))


@dataclass(frozen=True)
class AxisLoops:
    """Loops of one axis with one plant or several.

    Attributes
    ----------
    frequency : array, shape (frequency,), Hz
    rate : array, shape (..., frequency)
        Gain of the rate loop alone, as it flies where rates are asked for.
    command, angle : array, shape (..., frequency)
        With the angle loop around it, cut at the command, and at the measured angle.
    """

    frequency: Array
    rate: Numbers
    command: Numbers
    angle: Numbers

    @property
    def angle_closed(self) -> Numbers:
        """Angle by asked angle."""
        return np.asarray(self.angle / (1 + self.angle))


def frequencies(law: Law) -> Array:
    """Give the frequencies at which loops of a law are evaluated, shape (frequency,), Hz."""
    return np.geomspace(_LOWEST_HZ, _OF_NYQUIST * 0.5 * law.rate_hz, _POINTS)


def moved_by(law: Law, plant: AxisPlant, frequency: Array) -> Numbers:
    """Give body rate by command as the law meets it: sampled, a step late, held from step to step."""
    s, period = 2j * np.pi * frequency, law.period
    held = (1 - np.exp(-s * period)) / (s * period) * np.exp(-s * period)
    return np.asarray(held * plant.response(frequency))


def axis_loops(law: Law, axis: int, moved: Numbers, frequency: Array) -> AxisLoops:
    """Evaluate the loops of an axis.

    Parameters
    ----------
    moved : array, shape (..., frequency)
        Of one plant or several, as `moved_by` gives it.
    """
    s, control = 2j * np.pi * frequency, law.response(axis, frequency)
    own = law.axes[axis]
    rate = moved * (control.feedback + own.angle_slope * control.forward)
    # The angle follows the rate, of which the law asks.
    around = moved * (own.angle_response(frequency, law.period) * control.forward / s)
    return AxisLoops(frequency, rate, rate + around, around / (1 + rate))


def margins(frequency: Array, loop: Numbers) -> Margins:
    """Compute the margins of a loop from its gains, shape (frequency,); gain and phase by python-control.

    References
    ----------
    P. Seiler, A. Packard, P. Gahinet, An Introduction to Disk Margins, IEEE Control Systems 40(5), 2020.
    """
    from control import FRD, stability_margins

    stable, disk = bool(is_stable(frequency, loop)), float(disk_of(loop))
    system = FRD(loop, 2 * np.pi * frequency)
    gain, phase, _, _, crossover, _ = (float(each) for each in stability_margins(system))
    in_db = abs(20 * np.log10(gain)) if np.isfinite(gain) and gain > 0 else inf
    return Margins(
        gain_db=in_db if stable else nan,
        phase_deg=abs(phase) if stable else nan,
        disk=disk if stable else 0.0,
        crossover_hz=crossover / (2 * np.pi),
        stable=stable,
    )


def crossing_margins(frequency: Array, loop: Numbers) -> tuple[Array, Array, Array]:
    """Find the margins of stable loops, shape (..., frequency), where their gain is 1 and where they turn it round.

    Returns
    -------
    gain_db, phase_deg, crossover_hz : array, shape (...)
        The least change of gain and of phase that makes a loop unstable, infinite where none does, and the frequency at
        which its gain is 1 with that phase.
    """
    decibels, turns = 20 * np.log10(np.abs(loop)), np.unwrap(np.angle(loop), axis=-1) / (2 * np.pi) - 0.5

    def at_crossing(values: Array, level: Array, other: Array) -> Array:
        """Interpolate another value where one crosses a level between two frequencies; infinite where it does not."""
        before, after = values[..., :-1] - level, values[..., 1:] - level
        share = before / np.where(before == after, 1.0, before - after)
        crosses = (before > 0) != (after > 0)
        return np.where(crosses, other[..., :-1] + share * (other[..., 1:] - other[..., :-1]), np.inf)

    whole = np.maximum(np.floor(turns[..., :-1]), np.floor(turns[..., 1:]))
    gain = np.abs(at_crossing(turns, whole, decibels)).min(axis=-1)
    turned = at_crossing(decibels, np.zeros_like(whole), turns)
    phase = np.where(np.isfinite(turned), np.abs(turned - np.round(np.where(np.isfinite(turned), turned, 0))), np.inf)
    at = np.take_along_axis(frequency[:-1] * np.ones_like(phase), phase.argmin(axis=-1)[..., None], axis=-1)[..., 0]
    return gain, 360 * phase.min(axis=-1), at


def disk_of(loop: Numbers) -> Array:
    """Give the disk margins of stable loops, shape (..., frequency), balanced: 1 over the largest half of |S - T|."""
    return np.asarray(1 / np.abs(0.5 * (1 - loop) / (1 + loop)).max(axis=-1))


def is_stable(frequency: Array, loop: Numbers) -> BoolArray:
    """Tell whether closed loops are stable whose open ones are, but for integrators, by Nyquist.

    Seen from -1 the loop, from the last frequency back to the first, turns to the phase of as many integrators as it
    falls with there, and not round once more.

    Parameters
    ----------
    loop : array, shape (..., frequency)
    """
    turned = np.unwrap(np.angle(1 + loop[..., ::-1]), axis=-1)
    steep = np.log(np.abs(loop[..., 1] / loop[..., 0])) / np.log(frequency[1] / frequency[0])
    back = np.abs(turned[..., -1] - turned[..., 0] - 0.5 * np.pi * steep) < 0.75 * np.pi
    return np.asarray(back & (np.abs(turned[..., 0]) < 0.5 * np.pi))


@dataclass(frozen=True)
class StepAnswer:
    """Answer to a step of the asked angle about each axis, in parts of it.

    Attributes
    ----------
    time : array, shape (time,), s
    angle : array, shape (time, 3)
    """

    time: Array
    angle: Array

    @property
    def overshoot(self) -> Array:
        """By how much it is passed, shape (3,), in parts of the step."""
        return np.asarray(np.maximum(self.angle.max(axis=0) - 1.0, 0.0))

    @property
    def rise_s(self) -> Array:
        """From a tenth to nine tenths, shape (3,); not finite where it does not come there."""
        return np.array([_reached(self.time, row, 0.9) - _reached(self.time, row, 0.1) for row in self.angle.T])


def _reached(time: Array, values: Array, level: float) -> float:
    above = np.flatnonzero(values >= level)
    return float(time[above[0]]) if len(above) else nan


def step_answer(law: Law, plants: tuple[AxisPlant, ...]) -> StepAnswer:
    """Step a law and linear plants about x, y, z, no limits of the motors, to `STEP_RAD` about all axes at once."""
    count, period, controller = round(_STEP_S * law.rate_hz), law.period, Controller(law)
    columns = {name: np.array([getattr(each, name) for each in plants]) for name in AxisPlant.__dataclass_fields__}
    late = 1 + columns["delay"] / period
    sent = np.zeros((count + int(late.max()) + 3, 3))
    lagged, slow, rate, angle = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    decay = np.exp(-period / np.maximum(columns["lag"], 1e-9))
    shown = np.zeros((count, 3))
    whole = np.floor(late).astype(int)
    share = late - whole
    axes = np.arange(3)
    # At rest before the step.
    controller.command(np.zeros(3), np.zeros(3))
    for number in range(count):
        shown[number] = angle
        sent[number] = controller.command(controller.asked_rate(STEP_RAD - angle, rate), rate)
        first, second = number - whole, number - whole - 1
        arrived = np.where(first >= 0, sent[first, axes], 0.0) * (1 - share)
        arrived = arrived + np.where(second >= 0, sent[second, axes], 0.0) * share
        before = lagged
        lagged = arrived + (before - arrived) * decay
        # The mean over the step of what the lag lets through.
        mean = arrived + (before - arrived) * columns["lag"] / period * (1 - decay)
        slow = slow + (mean - slow) * period / (columns["slow_s"] + period)
        pushed = columns["gain"] * mean + columns["by_acceleration"] * (lagged - before) / period
        pushed = pushed + columns["slow"] * slow
        change = pushed - columns["damping"] * rate
        angle = angle + period * (rate + 0.5 * period * change)
        rate = rate + period * change
    return StepAnswer(np.arange(count, dtype=float) * period, shown / STEP_RAD)


@dataclass(frozen=True)
class Evaluation:
    """What a law does with a vehicle, by axis.

    Attributes
    ----------
    rate_hz : float
        Steps of the law in a second.
    command, angle : list of Margins
        Of the plant that was found, cut at the command and at the angle.
    command_worst, angle_worst : list of Margins
        The smallest of each margin over all plants that are possible.
    bandwidth_hz : array, shape (3,)
        Frequency at which the angle follows its setpoint at half power.
    loops : list of AxisLoops
    corners : list of list of AxisLoops
        Of all plants that are possible.
    steps : list of StepAnswer
        Of the plants that were found, then of the softest and the sharpest ones.
    """

    rate_hz: float
    command: list[Margins]
    angle: list[Margins]
    command_worst: list[Margins]
    angle_worst: list[Margins]
    bandwidth_hz: Array
    loops: list[AxisLoops]
    corners: list[list[AxisLoops]]
    steps: list[StepAnswer]


def evaluate(law: Law, hover: HoverPlant) -> Evaluation:
    """Evaluate a law with a vehicle in hover."""
    frequency = frequencies(law)
    corners = [
        [axis_loops(law, axis, moved_by(law, each, frequency), frequency) for each in hover.corners(axis)]
        for axis in range(3)
    ]
    commands = [[margins(frequency, each.command) for each in own] for own in corners]
    angles = [[margins(frequency, each.angle) for each in own] for own in corners]
    every = [hover.corners(axis) for axis in range(3)]
    ends = [hover.axes, tuple(own[min(1, len(own) - 1)] for own in every), tuple(own[-1] for own in every)]
    return Evaluation(
        rate_hz=law.rate_hz,
        command=[own[0] for own in commands],
        angle=[own[0] for own in angles],
        command_worst=[_worst(own) for own in commands],
        angle_worst=[_worst(own) for own in angles],
        bandwidth_hz=np.array([_bandwidth(own[0]) for own in corners]),
        loops=[own[0] for own in corners],
        corners=corners,
        steps=[step_answer(law, plants) for plants in ends],
    )


def _worst(found: list[Margins]) -> Margins:
    stable = all(each.stable for each in found)
    return Margins(
        gain_db=min(each.gain_db for each in found) if stable else nan,
        phase_deg=min(each.phase_deg for each in found) if stable else nan,
        disk=min(each.disk for each in found),
        crossover_hz=found[0].crossover_hz,
        stable=stable,
    )


def _bandwidth(loops: AxisLoops) -> float:
    below = np.flatnonzero(np.abs(loops.angle_closed) < 0.5**0.5)
    return float(loops.frequency[below[0]]) if len(below) else nan
