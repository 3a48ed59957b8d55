"""Actuation that comes late: filtered or shifted, with the change of wrench that follows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import exp, pi, tan

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Columns, stack
from cpfls_cli.effects.hooks import Link, RotorMotion
from cpfls_cli.effects.signals import Signals

_NODES = 8
"""Of the quadrature over a sample, exact for any lag that is not much shorter than one."""

_HIGHEST = 0.45
"""Frequency of a filter over that of the sampling, above which it is taken to be there."""


def lagged(values: Array, period: float, time_constant: float) -> Array:
    """Filter signals by a first-order lag, ``tau y' + y = u``, exactly for u cubic between samples.

    Straight lines between samples would weaken 3 Hz at 100 Hz by as much as half a millisecond of lag does.

    Parameters
    ----------
    values : array, shape (time, ...)
        u; y starts at its first value.
    period : float, s
    time_constant : float, s
        tau, greater than 0.

    Returns
    -------
    array, shape (time, ...)
        y.
    """
    # Slow to load, and who lists or shows effects filters nothing.
    from scipy.signal import lfilter

    decay = exp(-period / time_constant)
    nodes, lengths = np.polynomial.legendre.leggauss(_NODES)
    place = 0.5 * (nodes + 1)
    weight = 0.5 * lengths * period / time_constant * np.exp(-(1 - place) * period / time_constant)
    taps = weight @ _cubic(place)
    # A constant stays what it is, however short the lag is beside a sample.
    taps *= (1 - decay) / taps.sum()
    extended = _extended(values)
    driven = sum(tap * extended[first : len(values) - 1 + first] for first, tap in enumerate(taps))
    rest = lfilter([1.0], [1.0, -decay], driven, axis=0, zi=decay * values[:1])[0]
    return np.concatenate([values[:1], rest])


@dataclass(frozen=True)
class SecondOrder:
    """A filter ``(a s^2 + b w s + c w^2) / (s^2 + 2 zeta w s + w^2)``, by the bilinear transform with w kept.

    Attributes
    ----------
    over, under : array, shape (3,)
        Coefficients of the samples put in and given out, the newest first.
    """

    over: Array
    under: Array

    @classmethod
    def of(cls, frequency: float, damping: float, period: float, upper: tuple[float, float, float]) -> SecondOrder:
        """Make a filter of its natural frequency in Hz, zeta, the sampling period in s, and (a, b, c)."""
        # Time in units of 1 / w, so that s becomes (1 - 1/z) / (1 + 1/z) over this.
        half = tan(pi * min(frequency * period, _HIGHEST))
        square, line, one = np.array([1.0, -2.0, 1.0]), half * np.array([1.0, 0.0, -1.0]), np.array([1.0, 2.0, 1.0])
        over, under = (
            most * square + middle * line + least * half**2 * one
            for most, middle, least in (upper, (1.0, 2 * damping, 1.0))
        )
        return cls(over / under[0], under / under[0])

    def settled(self, value: Array) -> Array:
        """Give the state after a long time at a value, shape (2, ...)."""
        from scipy.signal import lfilter_zi

        return lfilter_zi(self.over, self.under).reshape(2, *[1] * np.ndim(value)) * value

    def step(self, value: Array, state: Array) -> tuple[Array, Array]:
        """Filter one sample; give it and the next state."""
        from scipy.signal import lfilter

        passed, later = lfilter(self.over, self.under, value[None], axis=0, zi=state)
        return passed[0], later

    def along(self, values: Array) -> Array:
        """Filter signals that were settled before, shape (time, ...)."""
        from scipy.signal import lfilter

        return np.asarray(lfilter(self.over, self.under, values, axis=0, zi=self.settled(values[0]))[0])


def delayed(values: Array, time: Array, delay: float) -> Array:
    """Shift signals in time by cubic interpolation; beyond the ends the last known value is held.

    Parameters
    ----------
    values : array, shape (time,) or (time, channel)
    time : array, shape (time,), s
        Evenly spaced.
    delay : float, s
        Below 0 brings them forward.

    Returns
    -------
    array, shape of `values`
    """
    if len(time) < 2:
        return values
    last, period = len(time) - 1, float(time[1] - time[0])
    place = np.arange(len(time)) - delay / period
    rows = np.clip(np.floor(place).astype(int), 0, last - 1)
    # All samples lie at the same place between two; those beyond the ends at an end.
    weights = _cubic(np.clip(place - rows, 0.0, 1.0))
    extended = _extended(values)
    across = (-1, *[1] * (values.ndim - 1))
    moved = (extended[rows + first] * weight.reshape(across) for first, weight in enumerate(weights.T))
    return np.asarray(sum(moved))


def _extended(values: Array) -> Array:
    """Continue signals by one sample at either end, in a straight line."""
    return np.concatenate([2 * values[:1] - values[1:2], values, 2 * values[-1:] - values[-2:-1]])


def _cubic(place: Array) -> Array:
    """Weigh the samples at -1, 0, 1 and 2 for places between 0 and 1 on a cubic, shape (place, 4)."""
    before, first, second, after = place + 1, place, place - 1, place - 2
    return np.stack(
        [
            -first * second * after / 6,
            before * second * after / 2,
            -before * first * after / 2,
            before * first * second / 6,
        ],
        axis=1,
    )


def with_actuation(signals: Signals, change: Callable[[Array], Array]) -> Signals:
    """Change the rotor speeds, or the stated torque and thrust of a flight without rotor speeds.

    Parameters
    ----------
    signals : Signals
    change : callable
        From a signal to the changed one, time first.
    """
    if signals.rotor_speed is not None:
        return signals.with_rotor_speed(change(signals.rotor_speed))
    torque = None if signals.stated_torque is None else change(signals.stated_torque)
    thrust = None if signals.stated_thrust is None else change(signals.stated_thrust)
    return replace(signals, stated_torque=torque, stated_thrust=thrust)


def wrench_change(before: Signals, after: Signals) -> Columns:
    """Compute the change of wrench by another actuation as a column.

    Returns
    -------
    Columns
        One column.
    """
    return Columns(stack(after.wrench - before.wrench))


@dataclass(frozen=True)
class CommandFilter:
    """A second-order filter between command and rotors, with the functions that an effect is made of.

    Attributes
    ----------
    damping : str
        Name of the shape that is zeta; the other one is ``frequency_hz``.
    upper : tuple of float
        (a, b, c) of `SecondOrder`.
    """

    damping: str
    upper: tuple[float, float, float]

    def _passing(self, shape: Mapping[str, float], period: float) -> SecondOrder:
        return SecondOrder.of(shape["frequency_hz"], shape[self.damping], period, self.upper)

    def apply(self, signals: Signals, shape: Mapping[str, float]) -> Signals:
        """Filter what drives the rotors of a flight."""
        return with_actuation(signals, self._passing(shape, signals.period).along)

    def columns(self, signals: Signals, shape: Mapping[str, float]) -> Columns:
        """Compute the change of wrench by the filter."""
        return wrench_change(signals, self.apply(signals, shape))

    def link(self, values: Mapping[str, float], step: float) -> Link:
        """Filter speeds and accelerations of the rotors, which were settled before the first step."""
        passing = self._passing(values, step)
        state: list[Array] = []

        def link(rotors: RotorMotion) -> RotorMotion:
            now = np.concatenate([rotors.speed, rotors.acceleration])
            if not state:
                state.append(passing.settled(np.concatenate([rotors.speed, np.zeros_like(rotors.acceleration)])))
            passed, state[0] = passing.step(now, state[0])
            return RotorMotion(*np.split(passed, 2))

        return link
