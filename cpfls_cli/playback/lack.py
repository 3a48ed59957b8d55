"""What a model lacks that is repeatable: a torque and a force with a memory, as large as shares of the model's parts.

A formula that is wrong is wrong in proportion to what it gives: little where little flows, much in a fast climb. So
what a model lacks about or along an axis is a Gauss-Markov process whose size at an instant is the root of the sum of
squares of a rest and of shares of what the flow does there to each part of the model, while the body does not turn and
all rotors turn alike: a size in proportion to rates and commands, which answer it, would excite itself. Other runs of a
path, or what was asked for, predict the parts, so that no gust is mistaken for them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.estimation.spectra import GaussMarkov, most_likely
from cpfls_cli.playback.gusts import GUST_AXES, Gusts
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.result import about
from cpfls_cli.vehicle.tracing import SYMBOLS
from cpfls_cli.vehicle.values import Functions, Vector, plus, times

_BEGIN_S = (0.15, 0.6)
"""Where the memory begins."""
_FAR, _MORE = 14.0, 4.0
"""Logarithms of factors by which powers may be off where they begin, down and up."""
_NOTHING = 1e-12
"""Mean square of a part, over that of the residual, below which it is rounding."""


class AxisLack(NamedTuple):
    """What a model lacks about or along one axis.

    `share`: of each part of the model, that the size has; `rest`: size where no part gives anything, N m or N;
    `memory`: time in which it falls to 37 %, s.
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


def lack_of(
    power: Array, squares: Array, known: Array, process: GaussMarkov, memory_s: tuple[float, float]
) -> AxisLack:
    """Find how large what a model lacks is, in the power of the residual, shape (piece, frequency).

    On a piece it is ``known(w) + (r^2 + sum_k s_k^2 q_k) G(w; m)``: gusts and noise, which are not repeatable, and a
    Gauss-Markov process of memory m with shares s_k of the parts, whose mean squares on the piece are q_k as
    instruments predict them, shape (piece, part), and a rest. `memory_s`: shortest and longest. Kennedy and O'Hagan
    2001 (discrepancy of a model).
    """
    largest = np.log(power.mean(axis=0).max() / process.alike.sum(axis=1).max())
    active = np.flatnonzero(squares.mean(axis=0) > _NOTHING * np.exp(largest))
    unit = squares[:, active].mean(axis=0)
    columns = np.column_stack([np.ones(len(squares)), squares[:, active] / unit])
    count = columns.shape[1]

    def spectrum(numbers: Array) -> tuple[Array, Callable[[Array], Array]]:
        sizes, (shape, longer) = np.exp(numbers[:-1]), process.power(float(np.exp(numbers[-1])))
        size = columns @ sizes
        expected = known + size[:, None] * shape
        return expected, lambda slope: np.append(sizes * (columns.T @ (slope @ shape)), size @ (slope @ longer))

    best = most_likely(
        spectrum,
        power,
        [np.array([*[largest - 1.0 - np.log(count)] * count, np.log(memory)]) for memory in _BEGIN_S],
        [*[(largest - _FAR, largest + _MORE)] * count, (np.log(memory_s[0]), np.log(memory_s[1]))],
    )
    share = np.zeros(squares.shape[1])
    share[active] = np.sqrt(np.exp(best[1:-1]) / unit)
    return AxisLack(share, float(np.exp(0.5 * best[0])), float(np.exp(best[-1])))
