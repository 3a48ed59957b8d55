"""Rules that choose samples one by one, by the factor of the chosen rows, and exchanges that improve the choice."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
import scipy.linalg

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.reduction.settings import CriterionName
from cpfls_cli.reduction.survey import RowSpace, project
from cpfls_cli.rounding import at_most, less, levelled

# The six different elements of a symmetric 3 x 3 matrix, and the place of each in it.
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


class TriangularFactor:
    """``T`` with ``T^T T = G``, the Gram matrix of the chosen rows, kept by QR as samples are added.

    Singular values below the tolerance, a fraction of the largest, count as zero.
    """

    def __init__(self, columns: int, rank_tolerance: float) -> None:
        self._triangle: Array = np.zeros((columns, columns))
        self._tolerance = rank_tolerance

    def add(self, rows: Array) -> None:
        """Add the rows of one sample or of several, array of shape (rows, columns)."""
        stacked = np.vstack([self._triangle, rows])
        triangle = scipy.linalg.qr(stacked, mode="r", check_finite=False)[0]
        self._triangle = np.asarray(triangle[: self.columns], dtype=np.float64)
        for name in ("singular_values", "singular_vectors"):
            self.__dict__.pop(name, None)

    @cached_property
    def singular_values(self) -> Array:
        """Singular values of the chosen rows, descending."""
        return np.asarray(np.linalg.svd(self._triangle, compute_uv=False), dtype=np.float64)

    @cached_property
    def singular_vectors(self) -> Array:
        """Right singular vectors of the chosen rows, in columns."""
        return np.linalg.svd(self._triangle)[2].T

    def solve(self, rows: Array) -> Array:
        """Solve ``G X = rows^T``; the rank must be full.

        Parameters
        ----------
        rows : array, shape (rows, columns)

        Returns
        -------
        array, shape (columns, rows)
        """
        half = scipy.linalg.solve_triangular(self._triangle, rows.T, trans="T", check_finite=False)
        return np.asarray(scipy.linalg.solve_triangular(self._triangle, half, check_finite=False))

    @property
    def columns(self) -> int:
        """Length of a row."""
        return len(self._triangle)

    @property
    def rank(self) -> int:
        """Numerical rank of the chosen rows."""
        return int(np.count_nonzero(self.singular_values > self._tolerance * self.singular_values[0]))

    @property
    def full_rank(self) -> bool:
        """Whether the rows span all columns."""
        return self.rank == self.columns

    @property
    def singular_value_min(self) -> float:
        """Smallest singular value, zero below full rank."""
        return float(self.singular_values[-1]) if self.full_rank else 0.0

    @property
    def singular_value_max(self) -> float:
        """Largest singular value."""
        return float(self.singular_values[0])

    @property
    def condition_number(self) -> float:
        """Largest over smallest singular value, infinite below full rank."""
        return self.singular_value_max / self.singular_value_min if self.full_rank else float("inf")


# Equal samples get scores that differ by rounding, depending on where in the array they stand. A hundredth of what
# `rounding` allows: samples are chosen by what sets their scores apart, and machines agree on these within 3e-12.
TIE_TOLERANCE = 1e-10

Predicate = Callable[[Array, float], BoolArray]
# Samples evaluated first, to get a level that most others can be shown not to reach.
_SCOUTS = 16
# The level they reach need not be exact: this fraction of the gain over the floor is enough.
_SCOUT_TOLERANCE = 1e-2


def first_best(scores: Array, available: BoolArray) -> int:
    """Find the lowest available index whose score is the largest one up to rounding."""
    allowed = np.where(available, scores, -np.inf)
    best = allowed.max()
    return int(np.argmax(allowed >= best - TIE_TOLERANCE * abs(best)))


def eigenvalues_below(eigenvalues: Array, projections: Array, shift: float) -> IntArray:
    """Count the eigenvalues of ``diag(eigenvalues) + Z_i^T Z_i`` below a shift, for each sample.

    By Sylvester's law of inertia it is the count of ``eigenvalues`` below the shift less the count of negative
    eigenvalues of the 3x3 matrix ``I + Z_i (diag(eigenvalues) - shift)^-1 Z_i^T``, Z_i the rows of each sample in the
    eigenvectors' basis.
    """
    distance = eigenvalues - shift
    # A shift on an eigenvalue moves off it by no more than that eigenvalue's own rounding, so nothing overflows.
    rounding = np.finfo(float).eps * np.maximum(np.abs(eigenvalues), abs(shift)) + np.finfo(float).tiny
    distance = np.copysign(np.maximum(np.abs(distance), rounding), distance)
    schur = np.eye(3) + (projections / distance) @ projections.swapaxes(1, 2)
    negative = np.count_nonzero(np.linalg.eigvalsh(schur) < 0.0, axis=1)
    return np.asarray(np.count_nonzero(distance < 0.0) - negative, dtype=np.int64)


def lazy_best(
    rows: Array, vectors: Array, bounds: Array, floor: float, exceeds: Predicate, bound_vectors: tuple[int, ...] = ()
) -> int:
    """Find the sample with the largest score, the lowest index among equals.

    The best few by their upper bounds, minus infinity for samples that are excluded, are evaluated; the level they
    reach (`floor` is one that every score reaches) discards most other samples by their bounds, then by sharper bounds,
    of so many of the basis `vectors`; only the rest are compared exactly. `exceeds` says of projections, shape
    (samples, 3, vectors), which samples' scores exceed a level. Given the first few vectors only, it may err in favour
    of a sample, never against one.
    """
    highest = float(bounds.max())
    count = min(_SCOUTS, int(np.count_nonzero(np.isfinite(bounds))))
    scouts = np.argpartition(-bounds, count - 1)[:count]
    _, level = _raise_level(exceeds, project(rows[scouts], vectors), (floor, highest), _SCOUT_TOLERANCE)
    candidates = np.flatnonzero(bounds >= level)
    # At the floor itself nothing can be discarded, and it is an eigenvalue, where counting has no accuracy.
    for count in (*bound_vectors, vectors.shape[1]) if level > floor else ():
        reached = exceeds(project(rows[candidates], vectors[:, :count]), level)
        candidates = candidates[reached] if reached.any() else candidates
    best, _ = _raise_level(exceeds, project(rows[candidates], vectors), (level, highest), 0.0)
    return int(candidates[best].min())


def _raise_level(
    exceeds: Predicate, projections: Array, interval: tuple[float, float], gain_tolerance: float
) -> tuple[IntArray, float]:
    """Bisect for the highest level that a sample still exceeds; return the samples left and that level."""
    best, (low, high) = np.arange(len(projections)), interval
    while high - low > max(TIE_TOLERANCE * abs(high), gain_tolerance * (high - interval[0])):
        middle = 0.5 * (low + high)
        above = best[exceeds(projections[best], middle)]
        best, low, high = (above, middle, high) if len(above) else (best, low, middle)
    return best, low


# Lowest eigenvectors of the successive Rayleigh-Ritz bounds for the samples still in doubt.
_BOUND_VECTORS = (6, 24)
# Updates lose a little accuracy each; an exact refresh costs as much as some ten of them.
_REFRESH_STEPS = 100
_ROWS = 3
EXCHANGE_INFORMATION: dict[str, float] = {"K-exchange": 0.0, "KD-exchange": 2.0}
"""Weight of the information kept, for the criteria that choose by exchange. Without it models come out several times
worse than from random samples; with 2 no worse; with 3, the condition number of 80 samples of the paper's path is not
below half of the full set's any more."""


class SmallestSingularValue:
    """Maximise ``sigma_min`` of the chosen rows, shape (samples, 3, columns); their rank must be full."""

    def __init__(self, rows: Array) -> None:
        self._rows = rows

    def next_sample(self, factor: TriangularFactor, available: BoolArray) -> int:
        """Name the available sample with the largest ``lambda_min(G + R_i^T R_i)``.

        Upper bounds for all samples come from the two lowest eigenvectors. The best few by the bound are evaluated;
        better bounds then discard every sample that cannot reach the level found, and only the rest are compared
        exactly. The result is the same as if all had been evaluated. Paper, section 8, step 1; method.md, section 6.
        """
        eigenvalues = factor.singular_values[::-1] ** 2
        vectors = factor.singular_vectors[:, ::-1]
        bounds = smallest_eigenvalue_bound(eigenvalues, project(self._rows, vectors[:, :2]))

        def exceeds(projections: Array, level: float) -> BoolArray:
            kept = projections.shape[2]
            return np.asarray(eigenvalues_below(eigenvalues[:kept], projections, level) == 0)

        bounds = np.where(available, bounds, -np.inf)
        return lazy_best(self._rows, vectors, bounds, eigenvalues[0], exceeds, _BOUND_VECTORS)


def smallest_eigenvalue_bound(eigenvalues: Array, projections: Array) -> Array:
    """Bound ``lambda_min(G + R_i^T R_i)`` from above, by its Rayleigh-Ritz value on two eigenvectors of G.

    The eigenvalues ascend; `projections` are the rows of each sample along the two lowest eigenvectors, shape (samples,
    3, 2), or along the only one.
    """
    squares = np.einsum("nij,nij->nj", projections, projections)
    if projections.shape[2] == 1:
        return np.asarray(eigenvalues[0] + squares[:, 0])
    first, second = eigenvalues[0] + squares[:, 0], eigenvalues[1] + squares[:, 1]
    coupling = np.einsum("ni,ni->n", projections[:, :, 0], projections[:, :, 1])
    bound = 0.5 * (first + second) - np.hypot(0.5 * (first - second), coupling)
    rounding = 4.0 * np.finfo(float).eps * (first + second)
    return np.asarray(bound + rounding)


class OptimalDesign:
    """Keep ``K_i = R_i G^-1 R_i^T`` and ``M_i = R_i G^-2 R_i^T`` of every sample as the selection grows.

    A minimises ``trace G^-1``, the sum of the parameters' variances; D maximises ``det G``.
    """

    def __init__(self, rows: Array, optimality: str) -> None:
        self._rows = rows
        self._optimality = optimality
        self._steps = 0

    def next_sample(self, factor: TriangularFactor, available: BoolArray) -> int:
        """Name the available sample with the largest gain.

        The gain is ``trace((I + K_i)^-1 M_i)`` for A, the fall of ``trace G^-1``, and ``det(I + K_i)`` for D, the
        factor by which ``det G`` grows. The factor is of the samples chosen so far, of full rank; all but the first
        call must follow a call whose sample was added. method.md, section 6.
        """
        if self._steps % _REFRESH_STEPS == 0:
            self._refresh(factor)
        grown = np.eye(3) + self._K
        by_variance = self._optimality == "A"
        gain = np.einsum("nij,nij->n", np.linalg.inv(grown), self._M) if by_variance else np.linalg.det(grown)
        index = first_best(gain, available)
        self._update(factor, index)
        self._steps += 1
        return index

    def _refresh(self, factor: TriangularFactor) -> None:
        half = project(self._rows, factor.singular_vectors) / factor.singular_values
        self._K = half @ half.swapaxes(1, 2)
        if self._optimality == "A":
            half /= factor.singular_values
            self._M = half @ half.swapaxes(1, 2)

    def _update(self, factor: TriangularFactor, index: int) -> None:
        """Update by ``(G + R^T R)^-1 = G^-1 - B S B^T`` with ``B = G^-1 R^T`` and ``S = (I + R B)^-1``."""
        B = factor.solve(self._rows[index])
        S = np.linalg.inv(np.eye(3) + self._K[index])
        if self._optimality == "D":
            C = project(self._rows, B)
            self._K = self._K - project(C, S) @ C.swapaxes(1, 2)
            return
        both = project(self._rows, np.hstack([B, factor.solve(B.T)]))
        C, E = both[:, :, :3], both[:, :, 3:]
        CS = project(C, S)
        cross = CS @ E.swapaxes(1, 2)
        self._K = self._K - CS @ C.swapaxes(1, 2)
        self._M = self._M - cross - cross.swapaxes(1, 2) + project(CS, B.T @ B) @ CS.swapaxes(1, 2)


class PrintedRule:
    """Take the largest smallest singular value; where no sample raises it, raise the largest one most.

    The smallest one is that of the thin decomposition: of as many values as there are rows, up to the columns. While
    rows are fewer, no sample can raise it, and the one that leaves it largest is taken, as long as that is not zero,
    which it is below the tolerance, a fraction of the largest.
    """

    def __init__(self, rows: Array, rank_tolerance: float) -> None:
        self._rows = rows
        self._tolerance = rank_tolerance
        self._smallest = SmallestSingularValue(rows)
        self._lengths = np.einsum("nij,nij->n", rows, rows)

    def next_sample(self, factor: TriangularFactor, available: BoolArray) -> int:
        """Name the sample with the largest thin ``sigma_min``, else the one that raises ``sigma_max`` most.

        Paper, section 8, step 1.
        """
        rows = _ROWS * (1 + int(np.count_nonzero(~available)))
        if factor.rank + _ROWS < min(rows, factor.columns):
            return self._largest(factor, available)
        if rows < factor.columns:
            index, least = self._thin(factor, available, rows), 0.0
        else:
            index, least = self._smallest.next_sample(factor, available), factor.singular_value_min
        return index if self._reaches(factor, index, rows, least) else self._largest(factor, available)

    def _reaches(self, factor: TriangularFactor, index: int, rows: int, least: float) -> bool:
        stacked = np.vstack([np.diag(factor.singular_values), self._rows[index] @ factor.singular_vectors])
        values = np.linalg.svd(stacked, compute_uv=False)[:rows]
        nonzero = values[-1] > self._tolerance * values[0]
        return bool(nonzero and values[-1] > least * (1.0 + TIE_TOLERANCE))

    def _thin(self, factor: TriangularFactor, available: BoolArray, rows: int) -> int:
        """Name the sample with the largest of the eigenvalues of ``G + R_i^T R_i`` that is the last of the rows'."""
        eigenvalues, beyond = factor.singular_values**2, factor.columns - rows
        # By interlacing a sample leaves no more than there was; the first has no more than its length.
        bounds = self._lengths if rows == _ROWS else np.full(len(self._rows), eigenvalues[rows - _ROWS - 1])

        def exceeds(projections: Array, level: float) -> BoolArray:
            return np.asarray(eigenvalues_below(eigenvalues, projections, level) <= beyond)

        bounds, zero = np.where(available, bounds, -np.inf), self._tolerance**2 * float(self._lengths.max())
        return lazy_best(self._rows, factor.singular_vectors, bounds, zero, exceeds)

    def _largest(self, factor: TriangularFactor, available: BoolArray) -> int:
        eigenvalues, vectors = factor.singular_values**2, factor.singular_vectors
        along = project(self._rows, vectors[:, :1])[:, :, 0]
        bounds = largest_eigenvalue_bound(eigenvalues, along, self._lengths)

        def exceeds(projections: Array, level: float) -> BoolArray:
            return np.asarray(eigenvalues_below(eigenvalues, projections, level) < len(eigenvalues))

        return lazy_best(self._rows, vectors, np.where(available, bounds, -np.inf), eigenvalues[0], exceeds)


def largest_eigenvalue_bound(eigenvalues: Array, along: Array, lengths: Array) -> Array:
    """Bound ``lambda_max(G + R_i^T R_i)`` from above, by the 2x2 matrix of the norms of its blocks.

    The blocks are the top eigenvector of G, whose eigenvalues descend, and everything orthogonal to it. `along`: rows
    of each sample along it; `lengths`: squared Frobenius norm of each sample's rows.
    """
    inside = np.einsum("ni,ni->n", along, along)
    outside = np.clip(lengths - inside, 0.0, None)
    first, second = eigenvalues[0] + inside, (eigenvalues[1] if len(eigenvalues) > 1 else 0.0) + outside
    bound = 0.5 * (first + second) + np.hypot(0.5 * (first - second), np.sqrt(inside * outside))
    return np.asarray(bound * (1.0 + 8.0 * np.finfo(float).eps))


Criterion = SmallestSingularValue | OptimalDesign | PrintedRule
"""A rule that names the next sample, the lowest index where several do; the caller then adds it to the factor."""


def make_criterion(space: RowSpace, name: CriterionName) -> Criterion:
    """Create the rule of a criterion that chooses samples one by one.

    That of `even` is never asked: the start is the whole choice.
    """
    if name == "paper-literal":
        return PrintedRule(space.rows, space.rank_tolerance)
    return SmallestSingularValue(space.rows) if name == "sigma_min" else OptimalDesign(space.rows, name)
