"""The control law that autopilots share, by frequency and step by step; what differs stands in numbers."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Literal, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, Numbers
from cpfls_cli.autopilots.motors import MixerRule, ThrustCurve
from cpfls_cli.filters import SecondOrder

AXES = ("roll", "pitch", "yaw")
FilterKind = Literal["first", "second", "notch"]
Stage = Literal["measured", "target", "error", "slope", "output"]
STAGES: tuple[Stage, ...] = ("measured", "target", "error", "slope", "output")

_HIGHEST = 0.45
"""Frequency of a filter over that of the loop, above which it is taken to be there."""
_BUTTERWORTH = 0.5**0.5
PASSES = SecondOrder(np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]), 1.0)
"""A filter that changes nothing."""


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
    """Rate control by frequency, shape (frequency,) each, share of the full command per rad/s.

    Attributes
    ----------
    feedback : array
        From measured rate to minus the command.
    forward : array
        From asked rate to the command.
    """

    feedback: Numbers
    forward: Numbers


@dataclass(frozen=True, kw_only=True)
class AxisLaw:
    """Control about one body axis.

    Attributes
    ----------
    angle, angle_integral : float, 1/s and 1/s^2
        Asked rate by error of the angle, and by its integral.
    angle_slope : float
        Rate taken off by measured rate of the angle.
    angle_integral_limit : float, rad/s
        Most of the integral.
    p, i, d, ff : float
        Share of the full command by error of the rate (per rad/s), its integral (per rad), its derivative (per
        rad/s^2), and by asked rate (per rad/s).
    integral_limit, limit : float
        Most of the integral and of the command, shares.
    rate_limit : float, rad/s
        Most that the angle asks for.
    measured, target, error, slope, output : tuple of Filter
        Of the gyroscope, the asked rate, the error, the derivative, the command.
    slope_of_error : bool
        Whether the derivative is that of the error; else of the measured rate.
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

    def rate_response(self, frequency: Array, period: float, *, integrates_first: bool = True) -> RateResponse:
        """Evaluate the rate control at frequencies, shape (frequency,), Hz, below half the rate of the loop."""
        back = np.exp(-2j * np.pi * frequency * period)
        measured, target, error, slope, output = (chain(getattr(self, stage), back, period) for stage in STAGES)
        integral = self.i * period * (1.0 if integrates_first else back) / (1 - back)
        of_error = error * (self.p + integral)
        difference = self.d * slope * (1 - back) / period
        forward = of_error + self.ff + (error * difference if self.slope_of_error else 0.0)
        feedback = of_error + (error if self.slope_of_error else 1.0) * difference
        return RateResponse(output * measured * feedback, output * target * forward)

    def angle_response(self, frequency: Array, period: float) -> Numbers:
        """Evaluate asked rate by error of the angle, shape (frequency,), 1/s."""
        back = np.exp(-2j * np.pi * frequency * period)
        return np.asarray(self.angle + self.angle_integral * period / (1 - back))


def chain(filters: tuple[Filter, ...], back: Numbers, period: float) -> Numbers:
    """Multiply the responses of filters at ``back = 1 / z``, shape (frequency,)."""
    total = np.ones_like(back)
    powers = back ** np.arange(3)[:, None]
    for section in (each.section(period) for each in filters):
        total = total * (section.over @ powers) / (section.under @ powers)
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
        """Evaluate the rate control about an axis, shape (frequency,), Hz."""
        return self.axes[axis].rate_response(frequency, self.period, integrates_first=self.integrates_first)


class _Chain:
    """Filters of all three axes in series; the first value is where they have settled."""

    def __init__(self, by_axis: list[tuple[Filter, ...]], period: float) -> None:
        longest = max(len(each) for each in by_axis)
        self._sections = [
            _stacked([each[place].section(period) if place < len(each) else PASSES for each in by_axis])
            for place in range(longest)
        ]
        self._states: list[Numbers] | None = None

    def __call__(self, value: Array) -> Array:
        if self._states is None:
            # What stays the same passes unchanged, so all see this value.
            self._states = [section.settled(value) for section in self._sections]
        passed: Numbers = value
        for place, section in enumerate(self._sections):
            passed, self._states[place] = section.step(passed, self._states[place])
        return np.asarray(passed)


def _stacked(sections: list[SecondOrder]) -> SecondOrder:
    over, under = (np.array([getattr(each, name) for each in sections]).T for name in ("over", "under"))
    return SecondOrder(over, under, 1.0)


@dataclass(frozen=True)
class _Gains:
    angle: Array
    angle_integral: Array
    angle_slope: Array
    angle_integral_limit: Array
    p: Array
    i: Array
    d: Array
    ff: Array
    integral_limit: Array
    limit: Array
    rate_limit: Array

    @classmethod
    def of(cls, axes: tuple[AxisLaw, ...]) -> _Gains:
        return cls(**{name: np.array([getattr(axis, name) for axis in axes]) for name in cls.__dataclass_fields__})


class Controller:
    """The law of an autopilot with its state, for all three axes at once.

    Parameters
    ----------
    law : Law
    period : float, s
        From step to step; that of the law unless a simulation takes another.
    """

    def __init__(self, law: Law, period: float | None = None) -> None:
        self._period = law.period if period is None else period
        self._law, self._gains = law, _Gains.of(law.axes)
        chains = {stage: [getattr(axis, stage) for axis in law.axes] for stage in STAGES}
        self._filters = {stage: _Chain(filters, self._period) for stage, filters in chains.items()}
        self._of_error = np.array([axis.slope_of_error for axis in law.axes])
        self._integral, self._angle_integral = np.zeros(3), np.zeros(3)
        self._before: Array | None = None

    def asked_rate(self, error: Array, body_rate: Array) -> Array:
        """Turn the error of the attitude into a rate.

        Parameters
        ----------
        error : array, shape (3,), rad, body frame
            Rotation from the attitude to the asked one.
        body_rate : array, shape (3,), rad/s

        Returns
        -------
        array, shape (3,), rad/s, body frame
        """
        gains = self._gains
        grown = self._angle_integral + gains.angle_integral * error * self._period
        self._angle_integral = _within(grown, gains.angle_integral_limit)
        rate = gains.angle * error + self._angle_integral - gains.angle_slope * body_rate
        return _within(rate, gains.rate_limit)

    def command(self, asked: Array, gyroscope: Array, saturated: BoolArray | None = None) -> Array:
        """Take one step of the rate control.

        Parameters
        ----------
        asked, gyroscope : array, shape (3,), rad/s, body frame
        saturated : array, shape (3,), or None
            Where the motors did not follow the last command.

        Returns
        -------
        array, shape (3,)
            Commands about the body axes, shares of the full ones.
        """
        gains, filters = self._gains, self._filters
        measured, target = filters["measured"](gyroscope), filters["target"](asked)
        error = filters["error"](target - measured)
        differed = np.where(self._of_error, error, -measured)
        before = differed if self._before is None else self._before
        slope = filters["slope"]((differed - before) / self._period)
        self._before = differed
        used = self._integral
        self._integral = self._grown(error, saturated)
        integral = self._integral if self._law.integrates_first else used
        total = gains.p * error + integral + gains.d * slope + gains.ff * target
        return _within(filters["output"](total), gains.limit)

    def _grown(self, error: Array, saturated: BoolArray | None) -> Array:
        gains = self._gains
        step = gains.i * error * self._period
        if saturated is not None and self._law.holds_integral:
            step = np.where(saturated & (step * self._integral > 0), 0.0, step)
        return _within(self._integral + step, gains.integral_limit)


def _within(values: Array, limit: Array) -> Array:
    # Of three numbers `np.clip` takes five times as long.
    return np.minimum(np.maximum(values, -limit), limit)


def attitude_error(rotation: Array, target: Array) -> Array:
    """Rotate from an attitude to a target, twice the vector part of the quaternion, shape (3,), rad, body frame.

    Parameters
    ----------
    rotation, target : array, shape (3, 3)
        Body to world.
    """
    turned = rotation.T @ target
    vector = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
    # 2 sin(angle / 2) of the axis, from sin(angle) of it.
    half = np.sqrt(max(1.0 + float(np.trace(turned)), 1e-6))
    return np.asarray(vector / half)
