"""The control law that autopilots share, by frequency and step by step; what differs stands in numbers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf
from typing import Literal, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, Numbers
from cpfls_cli.autopilots.motors import MixerRule, ThrustCurve
from cpfls_cli.filters import SecondOrder
from cpfls_cli.vehicle.stepping import Flat, Machine, Memory
from cpfls_cli.vehicle.tracing import SYMBOLS
from cpfls_cli.vehicle.values import Functions, Value, Vector, dot, plus, times, transposed

AXES = ("roll", "pitch", "yaw")
FilterKind = Literal["first", "second", "notch"]
Stage = Literal["measured", "target", "error", "slope", "output"]
STAGES: tuple[Stage, ...] = ("measured", "target", "error", "slope", "output")

_HIGHEST = 0.45
"""Frequency of a filter over that of the loop, above which it is taken to be there."""
_BUTTERWORTH = 0.5**0.5


@dataclass(frozen=True)
class Filter:
    """A filter of a control law.

    Attributes
    ----------
    kind : {"first", "second", "notch"}
        A low-pass of one pole, a Butterworth low-pass of two, or a notch.
    hz : float
        Cut-off, or centre of the notch.
    width_hz : float
        Of the notch, between the frequencies that lose 3 dB.
    """

    kind: FilterKind
    hz: float
    width_hz: float = 0.0

    def section(self, period: float) -> SecondOrder:
        """Make it discrete, as the autopilots do: one pole by ``dt / (dt + RC)``, others by the bilinear transform.

        Parameters
        ----------
        period : float, s
            From step to step.
        """
        if self.kind == "first":
            share = period / (period + 1 / (2 * np.pi * self.hz))
            return SecondOrder(np.array([share, 0.0, 0.0]), np.array([1.0, share - 1.0, 0.0]), 1.0)
        cycles = min(self.hz * period, _HIGHEST)
        if self.kind == "second":
            return SecondOrder.of(cycles, _BUTTERWORTH, (0.0, 0.0, 1.0))
        return SecondOrder.of(cycles, self.width_hz / (2 * self.hz), (1.0, 0.0, 1.0))


class RateResponse(NamedTuple):
    """Rate control by frequency, share of the full command per rad/s.

    `feedback`: from measured rate to minus the command; `forward`: from asked rate to the command.
    """

    feedback: Numbers
    forward: Numbers


@dataclass(frozen=True, kw_only=True)
class AxisLaw:
    """Control about one body axis.

    `angle` and `angle_integral` give asked rate by error of the angle and by its integral (1/s, 1/s^2), at most
    `angle_integral_limit` and in all `rate_limit`, rad/s; `angle_slope`: rate taken off by measured rate of the angle;
    `p`, `i`, `d`, `ff`: share of the full command by error of the rate (per rad/s), its integral (per rad), its
    derivative (per rad/s^2), and by asked rate (per rad/s); `integral_limit`, `limit`: most of the integral and of the
    command, shares; filters of the gyroscope, the asked rate, the error, the derivative and the command;
    `slope_of_error`: whether the derivative is that of the error, else of the measured rate.
    """

    angle: float
    angle_integral: float = 0.0
    angle_slope: float = 0.0
    angle_integral_limit: float = inf
    p: float
    i: float
    d: float
    ff: float = 0.0
    integral_limit: float = inf
    limit: float = 1.0
    rate_limit: float = inf
    measured: tuple[Filter, ...] = ()
    target: tuple[Filter, ...] = ()
    error: tuple[Filter, ...] = ()
    slope: tuple[Filter, ...] = ()
    output: tuple[Filter, ...] = ()
    slope_of_error: bool = False

    def angle_response(self, frequency: Array, period: float) -> Numbers:
        """Evaluate asked rate by error of the angle, shape (frequency,), 1/s."""
        back = np.exp(-2j * np.pi * frequency * period)
        return np.asarray(self.angle + self.angle_integral * period / (1 - back))


def chain(filters: tuple[Filter, ...], back: Numbers, period: float) -> Numbers:
    """Multiply the responses of filters at ``back = 1 / z``, shape (frequency,)."""
    total = np.ones_like(back)
    for each in filters:
        total = total * each.section(period).gain(back)
    return total


@dataclass(frozen=True, kw_only=True)
class Law:
    """The control law of an autopilot with all its numbers.

    Attributes
    ----------
    autopilot : str
        Its name.
    rate_hz : float
        Steps in a second. A command acts one step after what it answers.
    axes : tuple of AxisLaw
        About x, y, z of the body.
    curve : ThrustCurve
        From asked thrust to the signal of a motor.
    mixer : MixerRule
    integrates_first : bool
        Whether a step adds to the integral before it uses it.
    holds_integral : bool
        Whether an integral stops growing where the motors cannot follow.
    """

    autopilot: str
    rate_hz: float
    axes: tuple[AxisLaw, AxisLaw, AxisLaw]
    curve: ThrustCurve
    mixer: MixerRule
    integrates_first: bool = True
    holds_integral: bool = True

    @property
    def period(self) -> float:
        """From step to step, s."""
        return 1.0 / self.rate_hz

    def response(self, axis: int, frequency: Array) -> RateResponse:
        """Evaluate the rate control about an axis at frequencies, shape (frequency,), Hz, below half the rate."""
        own, period, back = self.axes[axis], self.period, np.exp(-2j * np.pi * frequency * self.period)
        measured, target, error, slope, output = (chain(getattr(own, stage), back, period) for stage in STAGES)
        integral = own.i * period * (1.0 if self.integrates_first else back) / (1 - back)
        of_error = error * (own.p + integral)
        difference = own.d * slope * (1 - back) / period
        forward = of_error + own.ff + (error * difference if own.slope_of_error else 0.0)
        feedback = of_error + (error if own.slope_of_error else 1.0) * difference
        return RateResponse(output * measured * feedback, output * target * forward)


class Controller:
    """The law of an autopilot with its state, for all three axes at once, step by step.

    Parameters
    ----------
    law : Law
    period : float, s
        From step to step; that of the law unless a simulation takes another.
    """

    def __init__(self, law: Law, period: float | None = None) -> None:
        step = law.period if period is None else period
        self._asking = Machine.of(lambda memory, given: _asked_rate(law, memory, given[:3], given[3:]), 6, step)

        def command(memory: Memory, given: Vector) -> Vector:
            axes = zip(law.axes, given[:3], given[3:6], given[6:], strict=True)
            return tuple(_axis_command(law, axis, memory, *own) for axis, *own in axes)

        self._commanding = Machine.of(command, 9, step)

    def asked_rate(self, error: Iterable[float], body_rate: Iterable[float]) -> Flat:
        """Turn the error of the attitude into a rate, rad/s, body frame.

        Parameters
        ----------
        error : three floats, rad, body frame
            Rotation from the attitude to the asked one.
        body_rate : three floats, rad/s
        """
        return self._asking.advance((*map(float, error), *map(float, body_rate)))

    def command(
        self, asked: Iterable[float], gyroscope: Iterable[float], saturated: Iterable[bool] | None = None
    ) -> Flat:
        """Take one step of the rate control.

        Parameters
        ----------
        asked, gyroscope : three floats, rad/s, body frame
        saturated : three bools, or None
            Where the motors did not follow the last command.

        Returns
        -------
        three floats
            Commands about the body axes, shares of the full ones.
        """
        held = (0.0, 0.0, 0.0) if saturated is None else map(float, saturated)
        return self._commanding.advance((*map(float, asked), *map(float, gyroscope), *held))


def _asked_rate(law: Law, memory: Memory, error: Vector, body_rate: Vector) -> Vector:
    before = memory.recall([0.0] * 3)
    grown = tuple(
        _within(plus(had, times(axis.angle_integral * memory.step, off)), axis.angle_integral_limit)
        for axis, had, off in zip(law.axes, before.values, error, strict=True)
    )
    before.keep(grown)
    rates = (
        plus(times(axis.angle, off), integral, times(-axis.angle_slope, rate))
        for axis, off, integral, rate in zip(law.axes, error, grown, body_rate, strict=True)
    )
    return tuple(_within(rate, axis.rate_limit) for axis, rate in zip(law.axes, rates, strict=True))


def _axis_command(law: Law, axis: AxisLaw, memory: Memory, asked: Value, gyroscope: Value, saturated: Value) -> Value:
    def passed(stage: Stage, value: Value) -> Value:
        # What stays the same passes unchanged, so all see the first value as where they have settled.
        out = value
        for each in getattr(axis, stage):
            out = memory.passed(each.section(memory.step), out, value)
        return out

    measured, target = passed("measured", gyroscope), passed("target", asked)
    error = passed("error", target - measured)
    differed = error if axis.slope_of_error else 0.0 - measured
    before, integral = memory.recall((0.0,)), memory.recall((0.0,))
    last = memory.functions.where(memory.first, differed, before.values[0])
    before.keep((differed,))
    slope = passed("slope", (differed - last) * (1 / memory.step))
    (used,), step = integral.values, times(axis.i * memory.step, error)
    if law.holds_integral:
        grows = memory.functions.where(step * used > 0.0, 0.0, step)
        step = memory.functions.where(saturated > 0.5, grows, step)
    grown = _within(plus(used, step), axis.integral_limit)
    integral.keep((grown,))
    total = plus(
        times(axis.p, error), grown if law.integrates_first else used, times(axis.d, slope), times(axis.ff, target)
    )
    return _within(passed("output", total), axis.limit)


def _within(value: Value, limit: float) -> Value:
    return SYMBOLS.smallest(SYMBOLS.largest(value, -limit), limit) if limit < inf else value


def attitude_error(rotation: Sequence[Vector], target: Sequence[Vector], functions: Functions = SYMBOLS) -> Vector:
    """Rotate from an attitude to a target, twice the vector part of the quaternion, rad, body frame.

    Parameters
    ----------
    rotation, target : rows of a matrix
        Body to world.
    """
    back, columns = transposed(rotation), transposed(target)
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = (tuple(dot(row, column) for column in columns) for row in back)
    # 2 sin(angle / 2) of the axis, from sin(angle) of it.
    half = functions.sqrt(functions.largest(1.0 + (xx + yy + zz), 1e-6))
    return tuple(each / half for each in (zy - yz, xz - zx, yx - xy))
