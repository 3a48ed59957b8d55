"""Gains by the margins that are asked for, in an autopilot's own parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import floor

import numpy as np

from cpfls_cli.autopilots.law import AXES, AxisLaw, Law
from cpfls_cli.autopilots.parameters import Autopilot, Parameter
from cpfls_cli.tuning.margins import axis_loops, disk_of, frequencies, is_stable
from cpfls_cli.tuning.plant import AxisPlant, HoverPlant

_BELOW_CROSSOVER = 5.0
"""The integral takes over so much below what the rate follows: it costs about 11 degrees of phase there."""
_ANGLE_BELOW = 3.0
"""While the rate is tuned the angle is as much slower; then it gets what is left."""
_LEADS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Derivative over proportional gain that is tried, in lags and delays of the loop."""
_WORTH = 1.03
"""A longer lead has to be worth this: it brings noise."""
_OVERSHOOT = 1.1
"""Largest gain from asked angle to angle: a step is passed by about as much less 1."""
_ROUNDS = 24


@dataclass(frozen=True)
class AskedMargins:
    """Margins that gains have to have, over all vehicles that flights leave possible.

    Attributes
    ----------
    gain_db, phase_deg, disk_deg : float
        Of gain alone, of phase alone, and the phase that the disk of both together holds.
    """

    gain_db: float = 6.0
    phase_deg: float = 45.0
    disk_deg: float = 35.0

    @property
    def disk(self) -> float:
        """The disk margin that holds all three."""
        factor = 10 ** (self.gain_db / 20)
        of_phase = 2 * np.tan(np.radians(max(self.phase_deg, self.disk_deg)) / 2)
        return float(max(2 * (factor - 1) / (factor + 1), of_phase))


@dataclass(frozen=True)
class Proposal:
    """A parameter with the value that is proposed.

    Attributes
    ----------
    parameter : Parameter
    value : float
        Inside its documented range, in multiples of its step.
    wanted : float
        Before it was brought inside the range.
    """

    parameter: Parameter
    value: float
    wanted: float

    @property
    def clipped(self) -> bool:
        """Whether the documented range does not hold what the margins allow."""
        slack = 1.01 * self.parameter.step
        return not self.parameter.low - slack <= self.wanted <= self.parameter.high + slack


def tuned(autopilot: Autopilot, values: Mapping[str, float], hover: HoverPlant, asked: AskedMargins) -> list[Proposal]:
    """Find the gains of all axes.

    For each axis: the rate that follows fastest with a disk margin as asked with every plant that is possible, the
    integral at a fifth of that speed, the derivative as long as it is worth it; then the highest gain from angle to
    rate with that margin and little overshoot.

    Parameters
    ----------
    values : mapping of str to float
        All parameters, by name: filters and limits as they will be.

    Returns
    -------
    list of Proposal
        Of the gains alone.
    """
    whole = dict(values) | {each.name: 1.0 for each in autopilot.parameters if each.role.endswith(".k")}
    law = autopilot.law(whole)
    wanted: dict[str, list[float]] = {}
    for axis in range(len(AXES)):
        plants = hover.corners(axis)
        # What no parameter sets stays as the law has it.
        has_angle = _parameter(autopilot, axis, "angle") is not None
        rate = _rate_gains(law, axis, plants, asked.disk, has_angle=has_angle)
        roles = {"p": rate.p, "i": rate.i, "d": rate.d, "k": 1.0, "d_raised": rate.d}
        # What the ranges leave of the rate control is what the angle is controlled through.
        p, i, d = (_kept(_parameter(autopilot, axis, each), roles[each]) for each in ("p", "i", "d"))
        kept = replace(rate, p=p, i=i, d=d)
        angle = _angle_gain(law, axis, kept, plants, asked.disk)
        roles |= {"angle": angle, "angle_i": angle * _ratio(law.axes[axis])}
        for role, value in roles.items():
            found = _parameter(autopilot, axis, role)
            if found is not None:
                wanted.setdefault(found.name, []).append(value / found.scale)
    # A parameter of several axes suits the one that bears the least.
    return [_proposal(autopilot.named(name), min(each)) for name, each in wanted.items()]


def _parameter(autopilot: Autopilot, axis: int, role: str) -> Parameter | None:
    """Find the parameter of an axis, or the one that several share."""
    groups = (AXES[axis], "tilt", "all") if axis < 2 else (AXES[axis], "all")
    return next((found for group in groups if (found := autopilot.by_role(f"{group}.{role}")) is not None), None)


def _kept(parameter: Parameter | None, value: float) -> float:
    return value if parameter is None else parameter.scale * _proposal(parameter, value / parameter.scale).value


def _proposal(parameter: Parameter, wanted: float) -> Proposal:
    steps = floor(wanted / parameter.step + 1e-9)
    value = min(max(steps * parameter.step, parameter.low), parameter.high)
    return Proposal(parameter, float(f"{value:.9g}"), wanted)


def proposal_of(parameter: Parameter, wanted: float) -> Proposal:
    """Propose the nearest value to one that is wanted, inside the documented range."""
    nearest = min(max(round(wanted / parameter.step) * parameter.step, parameter.low), parameter.high)
    return Proposal(parameter, float(f"{nearest:.9g}"), wanted)


def _ratio(axis: AxisLaw) -> float:
    return axis.angle_integral / axis.angle if axis.angle else 0.0


def _with(law: Law, axis: int, own: AxisLaw) -> Law:
    axes = [*law.axes]
    axes[axis] = own
    return replace(law, axes=(axes[0], axes[1], axes[2]))


def _rate_gains(law: Law, axis: int, plants: list[AxisPlant], disk: float, *, has_angle: bool) -> AxisLaw:
    """Find the proportional, integral and derivative gains of one axis."""
    found = plants[0]
    late = found.lag + found.delay + 1.5 * law.period
    # Yaw by reaction torque is slow and noisy; its derivative stays 0, as all autopilots have it.
    leads = _LEADS if axis < 2 else _LEADS[:1]
    best: AxisLaw | None = None
    for lead in leads:

        def own(gain: float, lead: float = lead) -> AxisLaw:
            slope = gain * lead * late
            fast = _follows(gain, slope, found)
            angle = fast / _ANGLE_BELOW if has_angle else law.axes[axis].angle
            whole = replace(law.axes[axis], p=gain, i=gain * fast / _BELOW_CROSSOVER, d=slope)
            return replace(whole, angle=angle, angle_integral=angle * _ratio(law.axes[axis]))

        def held(gain: float, own: Callable[[float], AxisLaw] = own) -> float:
            return _held(_with(law, axis, own(gain)), axis, plants, disk)

        gain = _largest(held, disk, 1e-3 / (late * _torque(found)), 10.0 / (late * _torque(found)))
        tried = own(gain)
        if best is None or _follows(tried.p, tried.d, found) > _WORTH * _follows(best.p, best.d, found):
            best = tried
    assert best is not None, "some lead is tried"
    return best


def _follows(p: float, d: float, plant: AxisPlant) -> float:
    """Give about how fast the rate follows what is asked, rad/s: the derivative acts as more inertia."""
    return p * _torque(plant) / (1 + d * _torque(plant))


def _torque(plant: AxisPlant) -> float:
    """Give the angular acceleration of a full command in the end, rad/s^2."""
    return plant.gain + plant.slow


def _angle_gain(law: Law, axis: int, rate: AxisLaw, plants: list[AxisPlant], disk: float) -> float:
    ratio = _ratio(law.axes[axis])

    def held(gain: float) -> float:
        tried = _with(law, axis, replace(rate, angle=gain, angle_integral=ratio * gain))
        return _held(tried, axis, plants, disk)

    return _largest(held, disk, 0.05, 50.0)


def _held(law: Law, axis: int, plants: list[AxisPlant], disk: float) -> float:
    """Give the least disk margin of all loops of an axis with all plants, as far as `disk`; less at an overshoot."""
    frequency, least = frequencies(law), disk
    for plant in plants:
        loops = axis_loops(law, axis, plant, frequency)
        passed = float(np.abs(loops.angle_closed).max()) / _OVERSHOOT
        for cut in (loops.rate, loops.command, loops.angle):
            if not is_stable(frequency, cut):
                return 0.0
            least = min(least, disk_of(cut) / max(passed, 1.0), disk / max(passed, 1.0))
    return least


def _largest(held: Callable[[float], float], disk: float, low: float, high: float) -> float:
    """Find the largest gain that holds a margin, on a logarithmic scale; where none does the one that holds most."""
    steps = np.geomspace(low, high, _ROUNDS)
    margins = np.array([held(step) for step in steps])
    borne = np.flatnonzero(margins >= disk)
    if not len(borne):
        return float(steps[np.argmax(margins)])
    below = float(steps[borne[-1]])
    above = below * float(steps[1] / steps[0])
    for _ in range(8):
        middle = float(np.sqrt(below * above))
        below, above = (middle, above) if held(middle) >= disk else (below, middle)
    return below
