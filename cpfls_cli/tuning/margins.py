"""Margins, bandwidth and step response of a law with a vehicle, as found and over all that flights leave possible."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, ComplexArray, IntArray, Numbers
from cpfls_cli.autopilots.law import Controller, Law
from cpfls_cli.result import about, part, result
from cpfls_cli.tuning.plant import AxisPlant, HoverPlant, Noise

_LOWEST_HZ, _POINTS, _OF_NYQUIST = 0.1, 300, 0.98
_STEP_S = 1.2
STEP_RAD = np.radians(10.0)
"""Size of the step of the asked attitude that is shown."""


_MOST_DB, _MOST_DEG = 99.0, 180.0
"""Margins of a loop that no change of its gain, or of its phase, makes unstable."""
_SHOWN = 300
"""Samples of a step that are kept."""


@result
class Margins:
    """How far a loop is from instability."""

    gain_db: float = about("change of gain alone, up or down; not finite: unstable", unit="dB", gaps=True)
    phase_deg: float = about("change of phase alone; not finite: unstable", unit="deg", gaps=True)
    disk_deg: float = about("phase of the disk of gain and phase together; 0: unstable", unit="deg")
    crossover_hz: float = about("where the gain of the loop is 1", unit="Hz", gaps=True)

    @property
    def stable(self) -> bool:
        """Whether the closed loop is stable."""
        return bool(np.isfinite(self.gain_db))


@dataclass(frozen=True)
class AxisLoops:
    """Loops of one axis with one plant or several, by frequency.

    `rate`: gain of the rate loop alone, as it flies where rates are asked for; `command`, `angle`: with the angle loop
    around it, cut at the command, and at the measured angle.
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
    """Compute the margins of a loop from its gains, shape (frequency,).

    P. Seiler, A. Packard, P. Gahinet, An Introduction to Disk Margins, IEEE Control Systems 40(5), 2020.
    """
    stable = bool(is_stable(frequency, loop))
    if not loop.any():
        # Gains of 0 hold nothing.
        return Margins(gain_db=nan, phase_deg=nan, disk_deg=0.0, crossover_hz=nan)
    gain, phase, crossover = (float(each) for each in crossing_margins(frequency, loop))
    return Margins(
        gain_db=min(gain, _MOST_DB) if stable else nan,
        phase_deg=min(phase, _MOST_DEG) if stable else nan,
        disk_deg=float(np.degrees(2 * np.arctan(disk_of(loop) / 2))) if stable else 0.0,
        crossover_hz=crossover,
    )


def crossing_margins(frequency: Array, loop: Numbers) -> tuple[Array, Array, Array]:
    """Find the margins of stable loops, shape (..., frequency), where their gain is 1 and where they turn it round.

    Between two frequencies decibels, phase and the logarithm of the frequency are interpolated.

    Returns
    -------
    gain_db, phase_deg, crossover_hz : array, shape (...)
        The least change of gain and of phase that makes a loop unstable, infinite where none does, and the frequency at
        which its gain is 1 with that phase, not a number where it never is.
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
    found = phase.argmin(axis=-1)[..., None]
    at = np.exp(at_crossing(decibels, np.zeros_like(whole), np.log(frequency)))
    at = np.take_along_axis(at, found, axis=-1)[..., 0]
    return gain, 360 * phase.min(axis=-1), np.where(np.isfinite(at), at, nan)


def disk_of(loop: Numbers) -> Array:
    """Give the disk margins of stable loops, shape (..., frequency), balanced: 1 over the largest half of |S - T|.

    That is alpha of Seiler, Packard and Gahinet, 2 at most; the phase alone that it holds is 2 arctan(alpha / 2).
    """
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
    with np.errstate(divide="ignore", invalid="ignore"):
        steep = np.log(np.abs(loop[..., 1] / loop[..., 0])) / np.log(frequency[1] / frequency[0])
    back = np.abs(turned[..., -1] - turned[..., 0] - 0.5 * np.pi * steep) < 0.75 * np.pi
    return np.asarray(back & (np.abs(turned[..., 0]) < 0.5 * np.pi))


@dataclass(frozen=True)
class StepAnswer:
    """Answer to a step of the asked angle about each axis, in parts of it, shape (time, 3)."""

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


@result
class AxisEvaluation:
    """What a law does with a vehicle about one axis, with the plant that was found and with all possible ones."""

    plants: int = about("possible plants: the best guess, and the corners of the intervals")
    command: Margins = part()
    command_worst: Margins = part()
    angle: Margins = part()
    angle_worst: Margins = part()
    bandwidth_hz: float = about("where the angle follows its setpoint at half power", unit="Hz", gaps=True)
    overshoot: float = about("of a step of the angle setpoint, share of it")
    overshoot_most: float = about("the largest with three possible plants")
    rise_s: float = about("of that step, from a tenth to nine tenths", unit="s", gaps=True)
    jitter: float | None = about(
        "root mean square of the command that the noise of the gyroscope makes, share of the full one", default=None
    )
    loop: ComplexArray = about("gain of the loop, cut at the command", "frequency", brief=False)
    loop_worst: ComplexArray = about("the same with the plant that comes nearest to -1", "frequency", brief=False)
    angle_closed: ComplexArray = about("angle over its setpoint", "frequency", brief=False)
    step: Array = about("angle after a step of its setpoint, share of it", "time", brief=False)
    step_low: Array = about("the least with three possible plants", "time", brief=False)
    step_high: Array = about("the largest", "time", brief=False)

    @property
    def disk_deg(self) -> float:
        """The least disk margin with all possible plants, cut at the command or at the angle."""
        return min(self.command_worst.disk_deg, self.angle_worst.disk_deg)


@result
class Evaluation:
    """What a law does with a vehicle: margins cut at the command and at the angle, and a step of the angle."""

    rate_hz: float = about("steps of the law in a second", unit="Hz")
    frequency: Array = about("of the loops", "frequency", unit="Hz", brief=False)
    time: Array = about("after the step", "time", unit="s", brief=False)
    roll: AxisEvaluation = part()
    pitch: AxisEvaluation = part()
    yaw: AxisEvaluation = part()

    @property
    def axes(self) -> tuple[AxisEvaluation, AxisEvaluation, AxisEvaluation]:
        """Those about x, y, z of the body."""
        return self.roll, self.pitch, self.yaw


def evaluate(law: Law, hover: HoverPlant, noise: Noise | None = None) -> Evaluation:
    """Evaluate a law with a vehicle in hover."""
    every = [hover.corners(axis) for axis in range(3)]
    # The plants that were found, then the softest and the sharpest ones.
    ends = [hover.axes, tuple(own[min(1, len(own) - 1)] for own in every), tuple(own[-1] for own in every)]
    steps = [step_answer(law, plants) for plants in ends]
    time = steps[0].time
    kept = np.unique(np.linspace(0, len(time) - 1, _SHOWN).astype(int))
    roll, pitch, yaw = (_about_axis(law, axis, own, steps, kept, noise) for axis, own in enumerate(every))
    return Evaluation(rate_hz=law.rate_hz, frequency=frequencies(law), time=time[kept], roll=roll, pitch=pitch, yaw=yaw)


def _about_axis(
    law: Law, axis: int, plants: Sequence[AxisPlant], steps: Sequence[StepAnswer], kept: IntArray, noise: Noise | None
) -> AxisEvaluation:
    frequency = frequencies(law)
    loops = [axis_loops(law, axis, moved_by(law, each, frequency), frequency) for each in plants]
    commands, angles = ([margins(frequency, getattr(each, cut)) for each in loops] for cut in ("command", "angle"))
    worst = min(loops, key=lambda each: float(np.abs(1 + each.command).min()))
    shown = np.array([each.angle[kept, axis] for each in steps])
    return AxisEvaluation(
        plants=len(plants),
        command=commands[0],
        command_worst=_worst(commands),
        angle=angles[0],
        angle_worst=_worst(angles),
        bandwidth_hz=_bandwidth(loops[0]),
        overshoot=float(steps[0].overshoot[axis]),
        overshoot_most=max(float(each.overshoot[axis]) for each in steps),
        rise_s=float(steps[0].rise_s[axis]),
        jitter=None if noise is None else noise.of_command(law, axis),
        loop=loops[0].command,
        loop_worst=worst.command,
        angle_closed=loops[0].angle_closed,
        step=shown[0],
        step_low=shown.min(axis=0),
        step_high=shown.max(axis=0),
    )


def _worst(found: Sequence[Margins]) -> Margins:
    """Give the least of each margin; a loop that is unstable with some plant has none."""
    stable = all(each.stable for each in found)
    return Margins(
        gain_db=min(each.gain_db for each in found) if stable else nan,
        phase_deg=min(each.phase_deg for each in found) if stable else nan,
        disk_deg=min(each.disk_deg for each in found),
        crossover_hz=found[0].crossover_hz,
    )


def _bandwidth(loops: AxisLoops) -> float:
    below = np.flatnonzero(np.abs(loops.angle_closed) < 0.5**0.5)
    return float(loops.frequency[below[0]]) if len(below) else nan
