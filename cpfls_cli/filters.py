"""Filters along signals and step by step: `scipy.signal` has them too, and loads all of `scipy.stats` first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, tan
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array, Numbers


def recursion(past: Sequence[complex] | Array, values: Numbers) -> Numbers:
    """Run ``y[n] = x[n] - past[0] y[n-1] - past[1] y[n-2] - ...`` from rest: a triangular system of equations in bands.

    Parameters
    ----------
    values : array, shape (time, ...)
        x.

    Returns
    -------
    array, shape of `values`
    """
    # Slow to load, and who lists or shows effects filters nothing.
    from scipy.linalg.lapack import dtbtrs, ztbtrs

    column = np.array([1.0, *past])
    kind = np.result_type(column, values)
    bands = np.repeat(column[:, None].astype(kind), len(values), axis=1)
    solve = ztbtrs if kind.kind == "c" else dtbtrs
    solved, _ = solve(bands, values.reshape(len(values), -1), uplo="L")
    return np.ascontiguousarray(solved).reshape(values.shape)


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
        change = values - values[0]
        driven = self.over[0] * change
        driven[1:] += self.over[1] * change[:-1]
        driven[2:] += self.over[2] * change[:-2]
        filtered: Numbers = self.level * values[0] + recursion(self.under[1:], driven)
        return filtered


def butterworth(cycles: float, order: int) -> list[SecondOrder]:
    """Make the sections of a Butterworth low-pass filter of a cut-off in cycles a sample, below 0.5."""
    sections = [
        SecondOrder.of(cycles, float(np.sin(pi * (2 * index + 1) / (2 * order))), (0.0, 0.0, 1.0))
        for index in range(order // 2)
    ]
    # Of an odd order: one pole alone, ``w / (s + w)``, over and under times ``s + w``.
    return [*sections, SecondOrder.of(cycles, 1.0, (0.0, 1.0, 1.0))] if order % 2 else sections


def parabolas(values: Array, half: int, derivative: Literal[0, 1]) -> Array:
    """Fit a parabola to the samples around each one, and give its value or its slope there (Savitzky and Golay).

    Parameters
    ----------
    values : array, shape (time, column)
        A stretch at least; near the ends of it the parabola is that of the first or the last whole one.
    half : int
        Samples on either side.
    derivative : {0, 1}
        Value, or slope per sample.
    """
    place = np.arange(-half, half + 1.0)
    terms = np.stack([place**0, place, place**2], axis=1)
    fit = np.linalg.pinv(terms)
    there = np.stack([0 * place, place**0, 2 * place], axis=1) if derivative else terms
    middle: list[Array] = [np.convolve(column, fit[derivative, ::-1], "valid") for column in values.T]
    first, last = there[:half] @ (fit @ values[: len(place)]), there[half + 1 :] @ (fit @ values[-len(place) :])
    whole: Array = np.concatenate([first, np.stack(middle, axis=1), last])
    return whole
