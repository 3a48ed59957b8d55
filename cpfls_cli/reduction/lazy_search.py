"""Exact search for the best of many samples that evaluates only the few that can be best; ties go to the first."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.reduction.survey import project

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
    rows: Array,
    vectors: Array,
    bounds: Array,
    floor: float,
    exceeds: Predicate,
    bound_vectors: tuple[int, ...] = (),
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
