"""Gains by the margins that are asked for, in an autopilot's own parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import floor

import numpy as np

from cpfls_cli.arrays import Numbers
from cpfls_cli.autopilots.law import AXES, AxisLaw, Law
from cpfls_cli.autopilots.parameters import Autopilot, Parameter
from cpfls_cli.result import about
from cpfls_cli.tuning.margins import axis_loops, disk_of, frequencies, is_stable, moved_by
from cpfls_cli.tuning.plant import AxisPlant, HoverPlant, Noise

_BELOW_CROSSOVER = 5.0
"""The integral takes over so much below what the rate follows: it costs about 11 degrees of phase there."""
_ANGLE_BELOW = 3.0
"""While the rate is tuned the angle is as much slower; then it gets what is left."""
_ANGLE_INTEGRAL_BELOW = 10.0
"""The integral of the angle takes over so much below what the angle follows at least: else each step is passed."""
_LEADS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
USUAL_LEADS = {0: _LEADS, 1: _LEADS, 2: _LEADS[:1]}
"""Derivative over proportional gain that is tried about each axis, in lags and delays of the loop.

Yaw by reaction torque is slow and noisy; its derivative stays 0, as all autopilots have it.
"""
_WORTH = 1.03
"""A longer lead has to be worth this: it brings noise."""
_OVERSHOOT = 1.1
"""Largest gain from asked angle to angle: a step is passed by about as much less 1."""
_ROUNDS = 24
_LOUDER = 2.0
"""Jitter of the commands over that of the gains before: those are known to fly, and what motors bear is not."""
_NEAR = 0.99
_NOISE_HZ, _NOISE_POINTS = 10.0, 100
_YAW_ALONE = ("yaw.error.first", "yaw.output.first")
_RAISED = 3


@dataclass(frozen=True)
class AskedMargins:
    """Margins that gains have to have, over all vehicles that flights leave possible."""

    gain_db: float = about("of gain alone", unit="dB", default=6.0)
    phase_deg: float = about("of phase alone", unit="deg", default=45.0)
    disk_deg: float = about("phase that the disk of both together holds", unit="deg", default=35.0)

    @property
    def disk(self) -> float:
        """The disk margin that holds all three."""
        factor = 10 ** (self.gain_db / 20)
        of_phase = 2 * np.tan(np.radians(max(self.phase_deg, self.disk_deg)) / 2)
        return float(max(2 * (factor - 1) / (factor + 1), of_phase))

    @property
    def required_deg(self) -> float:
        """The phase that this disk holds, degrees."""
        return float(np.degrees(2 * np.arctan(self.disk / 2)))


@dataclass(frozen=True)
class Proposal:
    """A parameter with the value proposed, in its range and multiples of its step, and the one wanted before."""

    parameter: Parameter
    value: float
    wanted: float

    @property
    def clipped(self) -> bool:
        """Whether the documented range does not hold what the margins allow."""
        slack = 1.01 * self.parameter.step
        return not self.parameter.low - slack <= self.wanted <= self.parameter.high + slack


@dataclass(frozen=True)
class Tuned:
    """Gains that were found.

    Attributes
    ----------
    proposals : list of Proposal
    disk : tuple of float
        The least disk margin about each axis with all plants, as far as it is asked for.
    quieter : tuple of bool
        Whether noise holds an axis back.
    """

    proposals: list[Proposal]
    disk: tuple[float, float, float]
    quieter: tuple[bool, bool, bool]


def tuned(
    autopilot: Autopilot,
    values: Mapping[str, float],
    hover: HoverPlant,
    asked: AskedMargins,
    noise: Noise | None = None,
    before: Mapping[str, float] | None = None,
    leads: Mapping[int, tuple[float, ...]] | None = None,
) -> Tuned:
    """Find the gains of all axes.

    For each axis: the rate that follows fastest with a disk margin as asked with every plant that is possible, the
    integral at a fifth of that speed, the derivative as long as it is worth it; then the highest gain from angle to
    rate with that margin and little overshoot. Commands jitter at most twice as much as with the gains before, by the
    noise of the gyroscope.

    Parameters
    ----------
    values : mapping of str to float
        All parameters, by name: filters and limits as they will be, gains as they are.
    noise : Noise or None
        None for white noise.
    before : mapping of str to float or None
        All parameters as they fly today, whose jitter counts; None: `values`.
    leads : mapping of int to tuple of float, or None
        Axes that are tuned, each with the derivatives over proportional gain that are tried, in lags and delays of the
        loop; None: all axes with the usual ones.
    """
    today = autopilot.law(values if before is None else before)
    whole = dict(values) | {each.name: 1.0 for each in autopilot.parameters if each.role.endswith(".k")}
    law = autopilot.law(whole)
    wanted: dict[str, list[float]] = {}
    least, quieter = [asked.disk] * len(AXES), [False] * len(AXES)
    for axis, tried in (USUAL_LEADS if leads is None else leads).items():
        loudest = _LOUDER * _jitter(today, axis, noise)
        search = _Search(law, axis, hover.corners(axis), asked.disk, noise, loudest, tried)
        found, least[axis] = search.found(autopilot)
        quieter[axis] = _jitter(_with(law, axis, found), axis, noise) > _NEAR * search.loudest
        roles = {"p": found.p, "i": found.i, "d": found.d, "k": 1.0, "d_raised": found.d}
        roles |= {"angle": found.angle, "angle_i": found.angle_integral}
        for role, value in roles.items():
            parameter = parameter_of(autopilot, axis, role)
            if parameter is not None:
                wanted.setdefault(parameter.name, []).append(value / parameter.scale)
    # A parameter of several axes suits the one that bears the least.
    proposals = [floored(autopilot.named(name), min(each)) for name, each in wanted.items()]
    return Tuned(proposals, (least[0], least[1], least[2]), (quieter[0], quieter[1], quieter[2]))


def with_filters(
    autopilot: Autopilot,
    values: Mapping[str, float],
    hover: HoverPlant,
    asked: AskedMargins,
    noise: Noise | None = None,
) -> Tuned:
    """Find gains as `tuned`, and raise the low-passes of yaw alone where it lacks margin or gets slower for them.

    Some come with cut-offs that suit heavy vehicles, and no gain makes up for what they are late.
    """
    raised: dict[str, Proposal] = {}
    found = tuned(autopilot, values, hover, asked, noise)
    for _ in range(_RAISED):
        late = [each for role in _YAW_ALONE if (each := autopilot.by_role(role)) is not None]
        slow = [each for each in late if 0 < _valued(values, raised, each) < each.high]
        holds, turns = found.disk[2] >= _NEAR * asked.disk, _yaw_angle(autopilot, found)
        if not slow or (holds and turns >= _yaw_angle(autopilot, values)):
            break
        more = raised | {
            each.name: proposal_of(each, min(2 * _valued(values, raised, each), each.high)) for each in slow
        }
        own = {**values, **{name: each.value for name, each in more.items()}}
        faster = tuned(autopilot, own, hover, asked, noise, values)
        if holds and _yaw_angle(autopilot, faster) <= turns:
            break
        found, raised = faster, more
    return replace(found, proposals=[*found.proposals, *raised.values()])


def _yaw_angle(autopilot: Autopilot, given: Tuned | Mapping[str, float]) -> float:
    """Give how much rate an error of the yaw angle asks for, in the parameter's unit."""
    angle = parameter_of(autopilot, 2, "angle")
    if angle is None:
        return 0.0
    values = {each.parameter.name: each.value for each in given.proposals} if isinstance(given, Tuned) else given
    return values[angle.name]


def _valued(values: Mapping[str, float], raised: Mapping[str, Proposal], parameter: Parameter) -> float:
    return raised[parameter.name].value if parameter.name in raised else values[parameter.name]


def _jitter(law: Law, axis: int, noise: Noise | None) -> float:
    """Give how much noise makes the command jitter, by a spectrum or, in any unit, by white noise."""
    if noise is not None:
        return noise.of_command(law, axis)
    frequency = np.linspace(_NOISE_HZ, 0.49 * law.rate_hz, _NOISE_POINTS)
    return float(np.sqrt(np.mean(np.abs(law.response(axis, frequency).feedback) ** 2)))


def parameter_of(autopilot: Autopilot, axis: int, role: str) -> Parameter | None:
    """Find the parameter of an axis, or the one that several share."""
    groups = (AXES[axis], "tilt", "all") if axis < 2 else (AXES[axis], "all")
    return next((found for group in groups if (found := autopilot.by_role(f"{group}.{role}")) is not None), None)


def floored(parameter: Parameter, wanted: float) -> Proposal:
    """Propose the next value below one that is wanted, inside the documented range."""
    steps = floor(wanted / parameter.step + 1e-9)
    value = min(max(steps * parameter.step, parameter.low), parameter.high)
    return Proposal(parameter, float(f"{value:.9g}"), wanted)


def proposal_of(parameter: Parameter, wanted: float) -> Proposal:
    """Propose the nearest value to one that is wanted, inside the documented range."""
    nearest = min(max(round(wanted / parameter.step) * parameter.step, parameter.low), parameter.high)
    return Proposal(parameter, float(f"{nearest:.9g}"), wanted)


def _with(law: Law, axis: int, own: AxisLaw) -> Law:
    axes = [*law.axes]
    axes[axis] = own
    return replace(law, axes=(axes[0], axes[1], axes[2]))


def _follows(p: float, d: float, plant: AxisPlant) -> float:
    """Give about how fast the rate follows what is asked, rad/s: the derivative acts as more inertia."""
    return p * _torque(plant) / (1 + d * _torque(plant))


def total_delay(law: Law, plant: AxisPlant) -> float:
    """Give lags and delays between command and rate, s."""
    return plant.lag + plant.delay + 1.5 * law.period


def _torque(plant: AxisPlant) -> float:
    """Give the angular acceleration of a full command in the end, rad/s^2."""
    return plant.gain + plant.slow


@dataclass(frozen=True)
class _Search:
    """The search for the gains of one axis, by a law with filters, limits and gains as they are.

    As factor on all of these gains 1; `loudest`: most jitter of the command.
    """

    law: Law
    axis: int
    plants: list[AxisPlant]
    disk: float
    noise: Noise | None
    loudest: float
    leads: tuple[float, ...]

    def found(self, autopilot: Autopilot) -> tuple[AxisLaw, float]:
        """Find the gains, and the disk margin that they hold inside the documented ranges, as far as it is asked."""
        angle = parameter_of(autopilot, self.axis, "angle")
        # What no parameter sets stays as the law has it.
        rate = self._inside(autopilot, self._rate(None if angle is not None else self._own.angle))
        if angle is None:
            return rate, self._held(rate)
        wanted = self._angled(rate, self._angle(rate))
        proposal = floored(angle, wanted.angle / angle.scale)
        if proposal.value <= proposal.wanted:
            return wanted, self._held(wanted)
        # The range asks for more than the rate bears: then the rate has to suit it.
        least = angle.scale * proposal.value
        rate = self._inside(autopilot, self._rate(least))
        return replace(rate, angle=wanted.angle), self._held(self._angled(rate, least))

    @property
    def _own(self) -> AxisLaw:
        return self.law.axes[self.axis]

    def _inside(self, autopilot: Autopilot, rate: AxisLaw) -> AxisLaw:
        """Bring gains of the rate inside the documented ranges, through which the angle is controlled."""
        kept = {"p": rate.p, "i": rate.i, "d": rate.d}
        for role, value in kept.items():
            parameter = parameter_of(autopilot, self.axis, role)
            if parameter is not None:
                kept[role] = parameter.scale * floored(parameter, value / parameter.scale).value
        return replace(rate, p=kept["p"], i=kept["i"], d=kept["d"])

    def _rate(self, angle: float | None) -> AxisLaw:
        """Find the gains of the rate with a given gain of the angle, or with one that suits them."""
        found = self.plants[0]
        late = total_delay(self.law, found)
        best: AxisLaw | None = None
        for lead in self.leads:

            def own(gain: float, lead: float = lead) -> AxisLaw:
                slope = gain * lead * late
                fast = _follows(gain, slope, found)
                whole = replace(self._own, p=gain, i=gain * fast / _BELOW_CROSSOVER, d=slope)
                return self._angled(whole, fast / _ANGLE_BELOW if angle is None else angle)

            def held(gain: float, own: Callable[[float], AxisLaw] = own) -> float:
                return self._held(own(gain))

            scale = late * _torque(found)
            tried = own(_largest(held, self.disk, 1e-3 / scale, 10.0 / scale))
            if best is None or _follows(tried.p, tried.d, found) > _WORTH * _follows(best.p, best.d, found):
                best = tried
        assert best is not None, "some lead is tried"
        return best

    def _angle(self, rate: AxisLaw) -> float:
        return _largest(lambda gain: self._held(self._angled(rate, gain)), self.disk, 0.05, 50.0)

    def _angled(self, rate: AxisLaw, gain: float) -> AxisLaw:
        """Give the angle a gain, with its integral in the same proportion as before unless the angle is slow."""
        ratio = self._own.angle_integral / self._own.angle if self._own.angle else 0.0
        return replace(rate, angle=gain, angle_integral=min(ratio, gain / _ANGLE_INTEGRAL_BELOW) * gain)

    def _held(self, own: AxisLaw) -> float:
        """Give the least disk margin of all loops with all plants, as far as asked; less at overshoot and jitter."""
        law = _with(self.law, self.axis, own)
        loops = axis_loops(law, self.axis, self._moved, frequencies(law))
        passed = max(float(np.abs(loops.angle_closed).max()) / _OVERSHOOT, 1.0)
        cut = np.stack([loops.rate, loops.command, loops.angle])
        if not is_stable(loops.frequency, cut).all():
            return 0.0
        loud = _jitter(law, self.axis, self.noise) / self.loudest if self.loudest else 0.0
        return min(float(disk_of(cut).min()), self.disk) / max(passed, loud, 1.0)

    @cached_property
    def _moved(self) -> Numbers:
        frequency = frequencies(self.law)
        return np.stack([moved_by(self.law, each, frequency) for each in self.plants])


def _largest(held: Callable[[float], float], disk: float, low: float, high: float) -> float:
    """Find the largest gain that holds a margin, on a logarithmic scale; where none does the one that holds most."""
    steps = np.geomspace(low, high, _ROUNDS)
    margins: list[float] = []
    # From the largest down: what holds below the first that does is not asked for.
    for step in steps[::-1]:
        margins.append(held(step))
        if margins[-1] >= disk:
            break
    else:
        return float(steps[np.argmax(margins[::-1])])
    below = float(step)
    above = below * float(steps[1] / steps[0])
    for _ in range(8):
        middle = float(np.sqrt(below * above))
        below, above = (middle, above) if held(middle) >= disk else (below, middle)
    return below
