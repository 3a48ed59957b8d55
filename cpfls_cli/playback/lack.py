"""What a model lacks, as it comes again: each of its formulas off by a share of itself, and a rest with a memory.

A formula that is wrong is wrong in proportion to what it gives: little where little flows, much in a fast climb. So
torque and force of each part of a model are taken to be off by a share, another one on each piece of flight, and the
shares of the parts go together: rotors that hold a body against the flow are off as much as the flow is. What no part
is like comes as a Gauss-Markov process. Other runs of a path, or what was asked for, tell the parts, so that no gust
that the rotors answer is mistaken for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from cpfls_cli.arrays import Array

_Complex = npt.NDArray[np.complex128]

ROTORS = "rotors"
"""The part of a model that is its rotors alone."""

_BEGIN, _BEGIN_S = 0.3, (0.15, 0.6)
"""Where shares and the memory of the rest begin."""
_FAR, _MORE = 14.0, 3.0
"""Logarithms of factors by which the power of the rest may be off where it begins, down and up."""
_STEPS = 500


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
    share : array, shape (part, part)
        Covariance of the shares by which parts are off.
    size, memory : float
        Standard deviation of the rest, N m or N, and the time in which it falls to 37 %, s.
    """

    share: Array
    size: float
    memory: float


@dataclass(frozen=True)
class Lack:
    """What a model lacks by body axis, torque then force.

    Attributes
    ----------
    part : tuple of str
        Parts of the model, see `VehicleModel.parts`.
    share : array, shape (axis, part, part)
        Covariance of the shares by which the parts are off; NaN where nothing is known.
    size : array, shape (axis,), N m and N
        Standard deviation of what no part is like; NaN where nothing is known.
    memory : array, shape (axis,), s
        Time in which that falls to 37 %.
    """

    part: tuple[str, ...]
    share: Array
    size: Array
    memory: Array

    @classmethod
    def of(cls, part: Sequence[str], axes: Sequence[AxisLack]) -> Self:
        """Arrange axes."""
        share, size, memory = zip(*axes, strict=True)
        return cls(tuple(part), np.array(share), np.array(size), np.array(memory))


def lack_of(power: Array, parts: _Complex, known: Array, rest: Rest) -> AxisLack:
    """Find by which shares the parts of a model are off, by Whittle's likelihood of what is left.

    The power of what is left on a piece is ``known(w) + sum_ij S_ij P_i(w)* P_j(w) + s^2 G(w; m)``: gusts and noise,
    parts that are off by shares of covariance S, and a Gauss-Markov process of size s and memory m.

    Parameters
    ----------
    power : array, shape (piece, frequency)
        Of what is left.
    parts : complex array, shape (piece, part, frequency)
        Each part as instruments foretell it.
    known : array, shape (frequency,)
        Power of gusts and noise, which do not come again.
    rest : Rest

    References
    ----------
    Whittle 1953; Kennedy and O'Hagan 2001 (discrepancy of a model); Laird and Ware 1982 (random coefficients).
    """
    from scipy.optimize import minimize

    sizes = np.sqrt((np.abs(parts) ** 2).mean(axis=(0, 2)))
    active = np.flatnonzero(sizes > 0)
    unit = np.sqrt(power.mean()) / sizes[active]
    likelihood = _Likelihood(power, parts[:, active] * unit[:, None], known, rest)
    found = [
        minimize(likelihood, begin, jac=True, method="L-BFGS-B", bounds=likelihood.bounds, options={"maxiter": _STEPS})
        for begin in likelihood.begins
    ]
    best = min(found, key=lambda each: float(each.fun)).x
    root = likelihood.root(best) * unit[:, None]
    share = np.zeros((parts.shape[1], parts.shape[1]))
    share[np.ix_(active, active)] = root @ root.T
    return AxisLack(share, float(np.exp(0.5 * best[-2])), float(np.exp(best[-1])))


class _Likelihood:
    """How unlikely what is left is, by a root of the covariance and logarithms of squared size and memory."""

    def __init__(self, power: Array, parts: _Complex, known: Array, rest: Rest) -> None:
        self._power, self._known, self._rest = power, known, rest
        self._parts = np.ascontiguousarray(parts.swapaxes(1, 2)).reshape(-1, parts.shape[1])
        self._places = np.tril_indices(parts.shape[1])

    @property
    def begins(self) -> list[Array]:
        """Where searches begin."""
        diagonal = np.where(self._places[0] == self._places[1], _BEGIN, 0.0)
        return [np.array([*diagonal, self._largest - 1.0, np.log(memory)]) for memory in _BEGIN_S]

    @property
    def bounds(self) -> list[tuple[float | None, float | None]]:
        """Ends of what is sought."""
        largest, (low, high) = self._largest, np.log(self._rest.memory)
        return [*[(None, None)] * len(self._places[0]), (largest - _FAR, largest + _MORE), (low, high)]

    @property
    def _largest(self) -> float:
        return float(np.log(self._power.mean(axis=0).max() / self._rest.alike.sum(axis=1).max()))

    def root(self, numbers: Array) -> Array:
        """Give the root of the covariance, shape (part, part)."""
        count = self._parts.shape[1]
        root = np.zeros((count, count))
        root[self._places] = numbers[:-2]
        return root

    def __call__(self, numbers: Array) -> tuple[float, Array]:
        size, memory = np.exp(numbers[-2:])
        root = self.root(numbers)
        off = self._parts @ root
        rest, longer = (size * each for each in self._rest.power(memory))
        expected = self._known + (np.abs(off) ** 2).sum(axis=1).reshape(self._power.shape) + rest
        ratio = self._power / expected
        slope = (1.0 - ratio) / expected
        moved = 2.0 * (np.conj(self._parts).T @ (slope.reshape(-1, 1) * off)).real
        slopes = np.array([*moved[self._places], (slope * rest).sum(), (slope * longer).sum()])
        return float((ratio + np.log(expected)).sum()) / len(ratio), slopes / len(ratio)
