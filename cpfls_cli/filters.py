"""Filters of first and second order along signals by `scipy.signal`, which loads where it is used, and step by step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, tan

import numpy as np

from cpfls_cli.arrays import Array, Numbers


def recursion(past: Sequence[complex] | Array, values: Numbers) -> Numbers:
    """Run ``y[n] = x[n] - past[0] y[n-1] - past[1] y[n-2] - ...`` from rest along the first axis of values x."""
    from scipy.signal import lfilter

    filtered: Numbers = lfilter([1.0], [1.0, *past], values, axis=0)
    return filtered


@dataclass(frozen=True)
class SecondOrder:
    """A filter ``(a s^2 + b w s + c w^2) / (s^2 + 2 zeta w s + w^2)``, by the bilinear transform with w kept.

    Attributes
    ----------
    over, under : array, shape (3,)
        Coefficients of the samples put in and given out, the newest first.
    level : float
        c, the gain of what stays the same.
    """

    over: Array
    under: Array
    level: float

    @classmethod
    def of(cls, cycles: float, damping: float, upper: tuple[float, float, float]) -> SecondOrder:
        """Make a filter of its natural frequency in cycles a sample, below 0.5, zeta, and (a, b, c)."""
        # Time in units of 1 / w, so that s becomes (1 - 1/z) / (1 + 1/z) over this.
        half = tan(pi * cycles)
        square, line, one = np.array([1.0, -2.0, 1.0]), half * np.array([1.0, 0.0, -1.0]), np.array([1.0, 2.0, 1.0])
        over, under = (
            most * square + middle * line + least * half**2 * one
            for most, middle, least in (upper, (1.0, 2 * damping, 1.0))
        )
        return cls(over / under[0], under / under[0], upper[2])

    def gain(self, back: Numbers) -> Numbers:
        """Give its gain at ``back = 1 / z``, ``exp(-j w dt)`` of a frequency w and a sample dt."""
        return np.asarray(np.polyval(self.over[::-1], back) / np.polyval(self.under[::-1], back))

    def settled(self, value: Numbers) -> Numbers:
        """Give the state after a long time at a value, shape (2, ...): what older samples will add to the next two."""
        later = self.over[2] * value - self.under[2] * self.level * value
        return np.stack([self.over[1] * value - self.under[1] * self.level * value + later, later])

    def step(self, value: Numbers, state: Numbers) -> tuple[Numbers, Numbers]:
        """Filter one sample; give it and the next state."""
        passed = self.over[0] * value + state[0]
        later = self.over[2] * value - self.under[2] * passed
        return passed, np.stack([self.over[1] * value - self.under[1] * passed + state[1], later])

    def along(self, values: Numbers) -> Numbers:
        """Filter signals that were settled before, shape (time, ...)."""
        from scipy.signal import lfilter

        filtered: Numbers = lfilter(self.over, self.under, values, axis=0, zi=self.settled(values[0]))[0]
        return filtered
