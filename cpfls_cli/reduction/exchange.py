"""Selection by exchange: chosen samples are replaced by others while a compound criterion falls."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
import scipy.linalg

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.reduction.survey import RowSpace
from cpfls_cli.rounding import at_most, less, levelled

# The six different elements of a symmetric 3 x 3 matrix, and where in it each of them stands.
_ELEMENTS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
_PLACES = (0, 1, 2, 1, 3, 4, 2, 4, 5)
# A sample may be all that holds a direction; I - K is then singular.
_SMALLEST_REST = 1e-9

# Powers of the smooth condition number. Beginning with a large one ends in a poor local minimum.
_POWERS = (1.0, 4.0, 16.0)
# Exchanges end when the criterion falls by less; 1e-3 is a thousandth of the condition number squared.
_SMALLEST_FALL = 1e-3
# Between two looks at all samples, exchanges are with the most promising of them, so many per chosen sample.
_PROMISING = 2
_FEWEST_PROMISING = 200
# Of so many samples each, one is exchanged for one, where several at once no longer help.
_PAIRED = 3
# Looks at all samples with the last power.
_LOOKS = 20
# A Gram matrix squares the condition number; above this one it has lost too many digits.
_GRAM_LIMIT = 1e6


@dataclass(frozen=True)
class Compound:
    """``log (trace G^p)^(1/p) + log (trace G^-p)^(1/p) - w log (det G)^(1/columns)``, to be made small.

    The first two terms lie above ``log(lambda_max / lambda_min)`` by at most ``(2/p) log(columns)`` (K-optimality):
    `power` p = 1 weighs all directions, more weighs the extreme ones. Alone they are also lowered by leaving out the
    samples that say most; the third (D-optimality), of weight w `information`, is the price of that. Ye, Zhou 2013:
    Minimizing the condition number to construct design points for polynomial regression models. Cook, Wong 1994: On the
    equivalence of constrained and compound optimal designs.
    """

    power: float
    information: float

    def value(self, eigenvalues: Array) -> float:
        """Compute the criterion from the positive eigenvalues of G, array of shape (columns,), ascending."""
        low, high = eigenvalues[0], eigenvalues[-1]
        sums = np.sum((eigenvalues / low) ** -self.power) * np.sum((eigenvalues / high) ** self.power)
        smooth = np.log(sums) / self.power + np.log(high / low)
        return float(smooth - self.information * np.mean(np.log(eigenvalues)))

    def merits(self, rows: Array, eigenvalues: Array, vectors: Array, *, chosen: bool) -> Array:
        """Estimate by how much each sample lowers the criterion, from eigenvalues (ascending) and vectors of G.

        With ``K = R G^-1 R^T`` the estimate is ``trace((I +- K)^-1 R G^-(p+1) R^T) / trace G^-p - trace(R G^(p-1) R^T)
        / trace G^p +- w/columns log det(I +- K)``: plus for a sample to add, minus for one that is in G (`chosen`). Its
        first order is the derivative. The last term is exact, the first at p = 1: its inverse keeps a sample from being
        credited with more than its three rows can do.
        """
        low = (eigenvalues / eigenvalues[0]) ** -self.power
        high = (eigenvalues / eigenvalues[-1]) ** self.power
        whitened = (rows.reshape(-1, rows.shape[2]) @ (vectors / np.sqrt(eigenvalues))).reshape(rows.shape)
        weights = np.stack([np.ones_like(low), low / low.sum(), high / high.sum()], axis=1)
        elements = np.stack([(whitened[:, i] * whitened[:, j]) @ weights for i, j in _ELEMENTS], axis=1)
        K, M, loss = (elements[:, _PLACES, k].reshape(-1, 3, 3) for k in range(3))
        sign = -1.0 if chosen else 1.0
        rest = (1.0 + _SMALLEST_REST) * np.eye(3) + sign * K
        gain = np.einsum("nij,nji->n", np.linalg.inv(rest), M) - np.einsum("nii->n", loss)
        return np.asarray(gain + sign * self.information / len(eigenvalues) * np.log(np.linalg.det(rest)))


def exchange_samples(
    space: RowSpace, start: IntArray, size: int, information: float, target: float | None = None
) -> tuple[IntArray, int]:
    """Choose samples of a small condition number: grow a start of full rank to the size, then exchange.

    Gives the samples, ascending, and how many were replaced.

    Growing at most doubles the set at a time, by the samples of largest merit, and stops at the first size that reaches
    the target condition number. An exchange replaces the samples of least merit by as many outside of largest merit: a
    quarter of all at first, half as many whenever that does not lower the criterion. The power of the criterion rises
    in steps, and with the last one no exchange that the merits propose helps any more. `information`: see `Compound`; 0
    for the condition number alone. Fedorov 1972: Theory of Optimal Experiments.
    """
    chosen = np.zeros(space.samples, dtype=bool)
    chosen[start] = True
    design, exchanges = _Design(space, chosen), 0
    while True:
        if design.size >= size or target is not None:
            design, exchanged = _exchange(design, information)
            exchanges += exchanged
        if design.size >= size or (target is not None and at_most(design.condition_number, target)):
            return np.flatnonzero(design.chosen), exchanges
        outside = design.ranked(np.flatnonzero(~design.chosen), Compound(_POWERS[0], information))
        design = design.swapped(outside[: min(design.size, size - design.size)], outside[:0]).refreshed()


class _Design:
    """A set of samples and the spectrum of its Gram matrix, which may be known from another set's."""

    def __init__(self, space: RowSpace, chosen: BoolArray, gram: Array | None = None) -> None:
        self._space, self.chosen = space, chosen
        self._precise = space.condition_number > _GRAM_LIMIT
        self._gram = _gram(space.rows[chosen]) if gram is None else gram

    @cached_property
    def _eigenvalues(self) -> Array:
        if self._precise:
            return np.asarray(self._decomposition[0])
        return np.asarray(scipy.linalg.eigvalsh(self._gram, driver="evd", check_finite=False))

    @cached_property
    def _decomposition(self) -> tuple[Array, Array]:
        if self._precise:
            rows = self._space.rows[self.chosen].reshape(-1, self._space.rank)
            triangle = scipy.linalg.qr(rows, mode="r", check_finite=False)[0][: self._space.rank]
            _, values, basis = scipy.linalg.svd(triangle, check_finite=False)
            return np.asarray(values[::-1] ** 2), np.asarray(basis[::-1].T)
        values, vectors = scipy.linalg.eigh(self._gram, driver="evd", check_finite=False)
        return values, vectors

    @property
    def size(self) -> int:
        return int(np.count_nonzero(self.chosen))

    @property
    def full_rank(self) -> bool:
        floor = np.finfo(float).eps if not self._precise else self._space.rank_tolerance**2
        return bool(self._eigenvalues[0] > floor * self._eigenvalues[-1])

    @property
    def condition_number(self) -> float:
        return float(np.sqrt(self._eigenvalues[-1] / self._eigenvalues[0])) if self.full_rank else np.inf

    def value(self, criterion: Compound) -> float:
        return criterion.value(self._eigenvalues) if self.full_rank else np.inf

    def ranked(self, indices: IntArray, criterion: Compound) -> IntArray:
        """Sort samples, all of them in the set or all outside, by falling merit."""
        chosen = bool(self.chosen[indices[:1]].any())
        merits = criterion.merits(self._space.rows[indices], *self._decomposition, chosen=chosen)
        return indices[np.argsort(levelled(-merits), kind="stable")]

    def swapped(self, entering: IntArray, leaving: IntArray) -> _Design:
        chosen, rows = self.chosen.copy(), self._space.rows
        chosen[entering], chosen[leaving] = True, False
        return _Design(self._space, chosen, self._gram + _gram(rows[entering]) - _gram(rows[leaving]))

    def refreshed(self) -> _Design:
        """Return the same set without the rounding of updates."""
        return _Design(self._space, self.chosen)


def _gram(rows: Array) -> Array:
    flat = rows.reshape(-1, rows.shape[2])
    return np.asarray(flat.T @ flat)


def _exchange(design: _Design, information: float) -> tuple[_Design, int]:
    total = 0
    for power in (*_POWERS, *_POWERS[-1:] * (_LOOKS - 1)):
        design, count = _look(design, Compound(power, information))
        total += count
        if count == 0 and power == _POWERS[-1]:
            break
    return design, total


def _look(design: _Design, criterion: Compound) -> tuple[_Design, int]:
    """Look at all samples, then exchange with the most promising until none of them helps."""
    outside = design.ranked(np.flatnonzero(~design.chosen), criterion)
    promising = outside[: max(_FEWEST_PROMISING, _PROMISING * design.size)]
    candidates = np.concatenate([np.flatnonzero(design.chosen), promising])
    most = step = max(1, design.size // 4)
    total = 0
    while True:
        design, count = _swap(design, candidates, step, criterion)
        if count == 0:
            return design, total
        total, step = total + count, min(2 * count, most)


def _swap(design: _Design, candidates: IntArray, count: int, criterion: Compound) -> tuple[_Design, int]:
    """Exchange as many samples as help at once, at most a count; return how many."""
    inside = design.ranked(np.flatnonzero(design.chosen), criterion)[::-1]
    outside = design.ranked(candidates[~design.chosen[candidates]], criterion)
    level = design.value(criterion) - _SMALLEST_FALL
    for entering, leaving in _proposals(inside, outside, count, singles=criterion.power == _POWERS[-1]):
        swapped = design.swapped(entering, leaving)
        if less(swapped.value(criterion), level):
            return swapped.refreshed(), len(entering)
    return design, 0


def _proposals(
    inside: IntArray, outside: IntArray, count: int, *, singles: bool
) -> Iterator[tuple[IntArray, IntArray]]:
    """Propose ever fewer samples to enter and to leave, then if asked other pairs of samples."""
    count = min(count, len(outside))
    while count:
        yield outside[:count], inside[:count]
        count //= 2
    if singles:
        pairs = product(range(min(_PAIRED, len(outside))), range(min(_PAIRED, len(inside))))
        for i, j in sorted(pairs, key=sum)[1:]:
            yield outside[i : i + 1], inside[j : j + 1]
