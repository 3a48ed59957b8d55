"""What a model lacks, as it comes again: a torque and a force with a memory, as large as shares of the model's parts.

A formula that is wrong is wrong in proportion to what it gives: little where little flows, much in a fast climb. So
what a model lacks about or along an axis is a Gauss-Markov process whose size at an instant is the root of the sum of
squares of a rest and of shares of what the flow does there to each part of the model, while the body does not turn and
all rotors turn alike: a size in proportion to rates and commands, which answer it, would excite itself. Other runs of a
path, or what was asked for, tell the parts, so that no gust is mistaken for them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.playback.gusts import GUST_AXES, Gusts
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.result import about
from cpfls_cli.vehicle.tracing import SYMBOLS
from cpfls_cli.vehicle.values import Functions, Vector, plus, times

_BEGIN_S = (0.15, 0.6)
"""Where the memory begins."""
_FAR, _MORE = 14.0, 4.0
"""Logarithms of factors by which powers may be off where they begin, down and up."""

_STEPS, _NOTHING = 500, 1e-12
"""Of the search; and the mean square of a part, over that of what is left, below which it is rounding."""


class Rest(NamedTuple):
    """Spectra that a process of unit size has, by its memory.

    Attributes
    ----------
    alike : array, shape (frequency, lag)
        Power by frequency that unit correlation at a lag has.
    lags : array, shape (lag,), s
    memory : tuple of float, s
        Shortest and longest.
    """

    alike: Array
    lags: Array
    memory: tuple[float, float]

    def power(self, memory: float) -> tuple[Array, Array]:
        """Give the power by frequency, and its derivative by the logarithm of the memory, shapes (frequency,)."""
        ages = self.lags / memory
        falls = np.exp(-ages)
        return self.alike @ falls, self.alike @ (falls * ages)


class AxisLack(NamedTuple):
    """What a model lacks about or along one axis.

    Attributes
    ----------
    share : array, shape (part,)
        Of each part of the model, that the size has.
    rest : float, N m or N
        Size where no part gives anything.
    memory : float, s
        Time in which it falls to 37 %.
    """

    share: Array
    rest: float
    memory: float


@dataclass(frozen=True, eq=False)
class Lack:
    """What a model lacks by body axis, torque then force; not finite where nothing is known. See `AxisLack`."""

    part: tuple[str, ...] = about("parts of the model", "formula")
    share: Array = about("share of each part that its size has", "gust", "formula", gaps=True, brief=False)
    rest: Array = about("size where no part gives anything, N m or N", "gust", unit="SI", gaps=True)
    memory: Array = about("time in which it falls to 37 %", "gust", unit="s", gaps=True)

    @classmethod
    def of(cls, part: Sequence[str], axes: Sequence[AxisLack]) -> Self:
        """Arrange axes."""
        share, rest, memory = zip(*axes, strict=True)
        return cls(tuple(part), np.array(share), np.array(rest), np.array(memory))

    def drawn(self, model: VehicleModel, rng: np.random.Generator, step: float, count: int) -> DrawnLack:
        """Draw it for a flight of the model, whose parts these are, at instants a step apart, s."""
        process = Gusts.known(np.where(np.isfinite(self.memory), 1.0, np.nan), self.memory)
        share, rest = np.zeros((len(self.part), len(GUST_AXES))), np.zeros(len(GUST_AXES))
        share[:, : len(self.rest)], rest[: len(self.rest)] = np.nan_to_num(self.share).T, np.nan_to_num(self.rest)
        return DrawnLack(model, process.drawn(rng, step, count), self.part, share, rest)


@dataclass(frozen=True)
class DrawnLack:
    """What a model lacks along one flight.

    Attributes
    ----------
    unit : array, shape (step, 6)
        Of unit size.
    part : tuple of str
        Of the model.
    share : array, shape (part, 6)
    rest : array, shape (6,), N m and N
    """

    model: VehicleModel
    unit: Array
    part: tuple[str, ...]
    share: Array
    rest: Array

    def at(self, unit: Vector, given: Mapping[str, tuple[Vector, Vector]], functions: Functions = SYMBOLS) -> Vector:
        """Give torque and force, N m and N, body frame.

        Parameters
        ----------
        unit : vector of 6
            Of unit size, at a step.
        given : mapping of str to tuple of vector
            Torque and force that each part of the model gives there.
        """
        squares = [square * square for square in self.rest.tolist()]
        for name, shares in zip(self.part, self.share.tolist(), strict=True):
            parts = (*given[name][0], *given[name][1])
            squares = [
                plus(square, times(share * share, own**2))
                for square, share, own in zip(squares, shares, parts, strict=True)
            ]
        return tuple(times(functions.sqrt(square), each) for square, each in zip(squares, unit, strict=True))


def lack_of(power: Array, squares: Array, known: Array, rest: Rest) -> AxisLack:
    """Find how large what a model lacks is, by Whittle's likelihood of what is left.

    The power of what is left on a piece is ``known(w) + (r^2 + sum_k s_k^2 q_k) G(w; m)``: gusts and noise, and a
    Gauss-Markov process of memory m with shares s_k of the parts, whose mean squares on the piece are q_k, and a rest.

    Parameters
    ----------
    power : array, shape (piece, frequency)
        Of what is left.
    squares : array, shape (piece, part)
        Mean square of each part as instruments foretell it.
    known : array, shape (frequency,)
        Power of gusts and noise, which do not come again.
    rest : Rest

    References
    ----------
    Whittle 1953; Kennedy and O'Hagan 2001 (discrepancy of a model).
    """
    from scipy.optimize import minimize

    largest = np.log(power.mean(axis=0).max() / rest.alike.sum(axis=1).max())
    active = np.flatnonzero(squares.mean(axis=0) > _NOTHING * np.exp(largest))
    unit = squares[:, active].mean(axis=0)
    columns = np.column_stack([np.ones(len(squares)), squares[:, active] / unit])

    def unlikely(numbers: Array) -> tuple[float, Array]:
        sizes, (shape, longer) = np.exp(numbers[:-1]), rest.power(float(np.exp(numbers[-1])))
        size = columns @ sizes
        expected = known + size[:, None] * shape
        ratio = power / expected
        slope = (1.0 - ratio) / expected
        slopes = np.append(sizes * (columns.T @ (slope @ shape)), size @ (slope @ longer))
        return float((ratio + np.log(expected)).sum()) / len(power), slopes / len(power)

    count = columns.shape[1]
    found = [
        minimize(
            unlikely,
            np.array([*[largest - 1.0 - np.log(count)] * count, np.log(memory)]),
            jac=True,
            method="L-BFGS-B",
            bounds=[*[(largest - _FAR, largest + _MORE)] * count, tuple(np.log(rest.memory))],
            options={"maxiter": _STEPS},
        )
        for memory in _BEGIN_S
    ]
    best = min(found, key=lambda each: float(each.fun)).x
    share = np.zeros(squares.shape[1])
    share[active] = np.sqrt(np.exp(best[1:-1]) / unit)
    return AxisLack(share, float(np.exp(0.5 * best[0])), float(np.exp(best[-1])))
