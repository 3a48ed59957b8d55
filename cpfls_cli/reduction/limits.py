"""Where a selection begins, with the fewest samples of full rank, and where it ends."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.errors import SettingError
from cpfls_cli.reduction.lazy_search import TIE_TOLERANCE, first_best
from cpfls_cli.reduction.selection import SelectionRun, StopReason
from cpfls_cli.reduction.settings import CriterionName, ReductionSettings
from cpfls_cli.reduction.survey import RowSpace
from cpfls_cli.rounding import at_most

# The Gram matrix of a residual squares its singular values, so below this fraction they are rounding.
_SMALLEST_RATIO = 1e-7
# Samples whose singular values are brought up to date at a time.
_BATCH = 64


def sample_limit(space: RowSpace, settings: ReductionSettings) -> int:
    """Return the most samples that may be chosen.

    `SettingError` where the size is larger than the number of samples or too small for the rank.
    """
    size = settings.size
    if size is None:
        return space.samples
    if size > space.samples:
        raise SettingError("size", f"the training set has only {space.samples} samples; keep fewer")
    if size < space.smallest_samples:
        raise _too_few(space, space.smallest_samples)
    return size


def starting_samples(space: RowSpace, criterion: CriterionName, limit: int) -> IntArray:
    """Choose the samples that a criterion begins with: of full rank, but for the printed rule and for `even`, all.

    `SettingError` where the most that may be chosen are too few for the rank.
    """
    if criterion == "even":
        return every_nth(space.samples, limit)
    if criterion == "paper-literal":
        return np.zeros(0, dtype=np.int64)
    start = rank_growing_start(space)
    if len(start) > limit:
        raise _too_few(space, len(start))
    return start


def stop_reason(run: SelectionRun, settings: ReductionSettings, limit: int) -> StopReason | None:
    """Return the limit that ends a selection, None while there is none."""
    target = settings.condition_number
    if target is not None and run.indices and at_most(run.factor.condition_number, target):
        return "condition-number"
    if len(run.indices) < limit:
        return None
    return "all-samples" if settings.size is None else "size"


def _too_few(space: RowSpace, needed: int) -> SettingError:
    return SettingError("size", f"the training set has rank {space.rank}, which takes {needed} samples or more")


def rank_growing_start(space: RowSpace) -> IntArray:
    """Choose samples by the part of their rows that the chosen ones do not span, until the full rank is spanned.

    The sample taken adds the most rank, three at best; among those, it is the one whose smallest added singular value
    ``sigma_k(R_i (I - U U^T))`` is largest, where U is a basis of the span so far. method.md, section 6.
    """
    basis = np.zeros((space.rank, 0))
    # At least one sample has this much left in any direction that is missing.
    threshold = 0.5 * space.rank_tolerance * space.singular_values[0] / np.sqrt(space.samples)
    residuals = _Residuals(space.rows, threshold)
    chosen: list[int] = []
    while basis.shape[1] < space.rank:
        remaining = space.rank - basis.shape[1]
        index = residuals.most_independent(basis, min(3, remaining))
        added = _new_directions(_residual(space.rows[index], basis), basis, threshold)[:, :remaining]
        basis = np.hstack([basis, added])
        residuals.remove(index)
        chosen.append(index)
    return np.array(chosen, dtype=np.int64)


def every_nth(samples: int, size: int) -> IntArray:
    """Choose samples as evenly as whole numbers allow, the first one among them; shape (size,)."""
    return np.asarray(np.arange(size, dtype=np.int64) * samples // size)


class _Residuals:
    """Singular values of what the samples add to a growing span; they only fall, so old ones are upper bounds."""

    def __init__(self, rows: Array, threshold: float) -> None:
        self._rows, self._threshold = rows, threshold
        self._values = _singular_values(rows)
        self._available = np.ones(len(rows), dtype=bool)

    def remove(self, index: int) -> None:
        self._available[index] = False

    def most_independent(self, basis: Array, gain: int) -> int:
        """Name the sample that adds most of a rank gain, the largest gain that any sample adds."""
        current = np.zeros(len(self._rows), dtype=bool)
        while True:
            self._update(basis, gain, current)
            scores = self._scores(gain)
            if gain == 1 or np.any(scores[current & self._available] > 0.0):
                return first_best(scores, current & self._available)
            gain -= 1

    def _update(self, basis: Array, gain: int, current: BoolArray) -> None:
        """Bring up to date all samples that can be the best."""
        while True:
            best = self._scores(gain)[current & self._available].max(initial=0.0)
            bounds = self._values[:, gain - 1]
            doubtful = np.flatnonzero(self._available & ~current & (bounds >= best * (1.0 - 2.0 * TIE_TOLERANCE)))
            if not len(doubtful):
                return
            first = doubtful[np.argsort(-bounds[doubtful])[:_BATCH]]
            self._values[first] = _singular_values(_residual(self._rows[first], basis))
            current[first] = True

    def _scores(self, gain: int) -> Array:
        values = self._values[:, gain - 1]
        if gain == 1:
            return values
        return np.where(values > np.maximum(self._threshold, _SMALLEST_RATIO * self._values[:, 0]), values, 0.0)


def _residual(rows: Array, basis: Array) -> Array:
    flat = rows.reshape(-1, rows.shape[-1])
    return np.asarray((flat - (flat @ basis) @ basis.T).reshape(rows.shape))


def _singular_values(rows: Array) -> Array:
    """Singular values of each sample's rows, descending."""
    squares = np.linalg.eigvalsh(rows @ rows.swapaxes(1, 2))[:, ::-1]
    return np.asarray(np.sqrt(np.clip(squares, 0.0, None)))


def _new_directions(residual: Array, basis: Array, threshold: float) -> Array:
    # A second projection, because a small residual of large rows has lost its orthogonality to the basis.
    clean = residual - (residual @ basis) @ basis.T
    _, values, directions = np.linalg.svd(clean, full_matrices=False)
    kept = np.count_nonzero(values > max(threshold, _SMALLEST_RATIO * values[0]))
    return np.asarray(directions[: max(1, kept)].T)
