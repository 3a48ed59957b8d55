"""Actuation that comes late: filtered or shifted, with the change of wrench that follows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import exp, pi, tan

import numpy as np
from scipy import signal

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Columns, stack
from cpfls_cli.effects.signals import Signals

_HIGHEST = 0.45
"""Frequency of a filter over that of the sampling, above which it is taken to be there."""


def lagged(values: Array, period: float, time_constant: float) -> Array:
    """Filter signals by a first-order lag, ``tau y' + y = u``, exactly for u linear between samples.

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
    decay = exp(-period / time_constant)
    held = (1 - decay) * time_constant / period
    new, old = 1 - held, held - decay
    return np.asarray(signal.lfilter([new, old], [1.0, -decay], values, axis=0, zi=(1 - new) * values[:1])[0])


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
        return signal.lfilter_zi(self.over, self.under).reshape(2, *[1] * np.ndim(value)) * value

    def step(self, value: Array, state: Array) -> tuple[Array, Array]:
        """Filter one sample; give it and the next state."""
        passed, later = signal.lfilter(self.over, self.under, value[None], axis=0, zi=state)
        return passed[0], later

    def along(self, values: Array) -> Array:
        """Filter signals that were settled before, shape (time, ...)."""
        return np.asarray(signal.lfilter(self.over, self.under, values, axis=0, zi=self.settled(values[0]))[0])


def delayed(values: Array, time: Array, delay: float) -> Array:
    """Shift signals in time by linear interpolation; beyond the ends the last known value is held.

    Parameters
    ----------
    values : array, shape (time,) or (time, channel)
    time : array, shape (time,), s
    delay : float, s
        Below 0 brings them forward.

    Returns
    -------
    array, shape of `values`
    """
    channels = values.reshape(len(time), -1).T
    moved = [np.interp(time - delay, time, channel) for channel in channels]
    return np.column_stack(moved).reshape(values.shape)


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
