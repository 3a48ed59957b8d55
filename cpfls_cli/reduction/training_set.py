"""Reduce a training set, held in memory or read in chunks: by a criterion from where it has to begin, or at random."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.reduction.criteria import (
    EXCHANGE_INFORMATION,
    TIE_TOLERANCE,
    Criterion,
    TriangularFactor,
    exchange_samples,
    first_best,
    make_criterion,
)
from cpfls_cli.reduction.settings import CriterionName, ReductionSettings
from cpfls_cli.reduction.survey import RowSpace, Survey, space_of
from cpfls_cli.result import about, result
from cpfls_cli.rounding import at_most

StopReason = Literal["size", "condition-number", "all-samples", "pool"]


@result
class Selection:
    """The samples of flights that are worth learning from, with the history of their selection."""

    FORMAT: ClassVar = "cpfls/selection"
    SHOWN: ClassVar = ("selected", "stalled", "condition_number_random")

    indices: IntArray = about("indices of the samples, in order of selection", "selected", least=0, brief=False)
    candidates: int = about("number of samples that could be selected", default=0)
    criterion: str = about("the rule, as in reduction.criterion")
    rank: int = about("numerical rank of the selection")
    rank_full: int = about("numerical rank of all candidates")
    condition_number: float = about(
        "largest over smallest singular value, over as many as the rank of all; infinite below that rank",
        gaps=True,
        least=1.0,
    )
    condition_number_full: float = about("of all candidates, over the kept rank", least=1.0)
    stop_reason: StopReason = about("which limit ended the selection; the pool where it, and not all, was used up")
    exchanges: int = about("samples that were replaced by others on the way", default=0)
    condition_number_trace: Array = about(
        "condition number after each sample; infinite while rank deficient",
        "selected",
        gaps=True,
        least=1.0,
        brief=False,
    )
    singular_value_min_trace: Array = about("smallest singular value after each", "selected", unit="SI", brief=False)
    singular_value_max_trace: Array = about("largest singular value after each", "selected", unit="SI", brief=False)
    rank_trace: IntArray = about("numerical rank after each", "selected", brief=False)
    random: Array | None = about(
        "condition numbers of random selections of equal size", "draw", gaps=True, least=1.0, brief=False, default=None
    )

    @property
    def selected(self) -> int:
        """Number of samples."""
        return len(self.indices)

    @property
    def full_rank(self) -> bool:
        """Whether the samples determine everything that all candidates determine."""
        return self.rank == self.rank_full

    @property
    def stalled(self) -> bool:
        """Whether the rule ended below full rank, so that the selection must not be trained on."""
        return not self.full_rank

    @property
    def condition_number_random(self) -> float:
        """Condition number of random selections of equal size, the median; NaN where none was drawn."""
        return float(np.median(self.random)) if self.random is not None and len(self.random) else float("nan")


class SelectionRun:
    """Samples chosen so far, from those before the criterion is asked on, their factor and the trace."""

    def __init__(self, space: RowSpace, criterion: Criterion, start: IntArray) -> None:
        self._space, self._criterion, self._start = space, criterion, start
        self._available = np.ones(space.samples, dtype=bool)
        self.factor = TriangularFactor(space.rank, space.rank_tolerance)
        self.indices: list[int] = []
        self._trace: list[tuple[float, float, float, int]] = []

    def step(self) -> None:
        """Choose one more sample."""
        taken = len(self.indices)
        at_start = taken < len(self._start)
        index = int(self._start[taken]) if at_start else self._criterion.next_sample(self.factor, self._available)
        self._available[index] = False
        self.indices.append(index)
        self.factor.add(self._space.rows[index])
        factor = self.factor
        self._trace.append((factor.condition_number, factor.singular_value_min, factor.singular_value_max, factor.rank))

    def selection(self, criterion: str, reason: StopReason) -> Selection:
        """Return the result under a criterion's name, with what ended the selection."""
        condition_number, smallest, largest, rank = (np.array(column) for column in zip(*self._trace, strict=True))
        return Selection(
            criterion=criterion,
            indices=np.array(self.indices, dtype=np.int64),
            condition_number=self.factor.condition_number,
            condition_number_full=self._space.condition_number,
            rank=self.factor.rank,
            rank_full=self._space.rank,
            condition_number_trace=condition_number,
            singular_value_min_trace=smallest,
            singular_value_max_trace=largest,
            rank_trace=rank.astype(np.int64),
            stop_reason=reason,
        )


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


Progress = Callable[[int, int], None]

# Of a sample without leverage; places not yet taken have less.
_LOWEST_KEY = -np.finfo(float).max

# Rows wait until so many samples are together, because a QR factorisation of few rows costs as much as of many.
_WAITING_SAMPLES = 256


def choose(space: RowSpace, settings: ReductionSettings, progress: Progress | None = None) -> Selection:
    """Choose samples one by one, each the best next one by the criterion, or all of them by exchanges.

    All criteria but `even` and the printed rule begin with the fewest samples that reach the full rank. Samples chosen
    by exchanges are returned, and traced, in the order in which the criterion D takes them. `SettingError` where the
    size is larger than the number of samples or too small for the rank. Paper, section 8, eq. (19); method.md, section
    6.
    """
    limit = sample_limit(space, settings)
    start = starting_samples(space, settings.criterion, limit)
    if settings.criterion in EXCHANGE_INFORMATION:
        return _exchanged(space, start, limit, settings, progress)
    criterion = make_criterion(space, settings.criterion)
    return _one_by_one(SelectionRun(space, criterion, start), limit, settings, progress)


def check_space(space: RowSpace, settings: ReductionSettings) -> None:
    """Refuse what `choose` would refuse, without the work of choosing."""
    starting_samples(space, settings.criterion, sample_limit(space, settings))


def _exchanged(
    space: RowSpace, start: IntArray, limit: int, settings: ReductionSettings, progress: Progress | None
) -> Selection:
    """Exchange samples, then put those chosen in the D-optimal order, and stop there as for every criterion."""
    information = EXCHANGE_INFORMATION[settings.criterion]
    indices, exchanges = exchange_samples(space, start, limit, information, settings.condition_number)
    chosen = replace(space, rows=space.rows[indices])
    run = SelectionRun(chosen, make_criterion(chosen, "D"), starting_samples(chosen, "D", chosen.samples))
    selection = _one_by_one(run, chosen.samples, settings, progress)
    return replace(selection, indices=indices[selection.indices], exchanges=exchanges)


def _one_by_one(run: SelectionRun, limit: int, settings: ReductionSettings, progress: Progress | None) -> Selection:
    while not (reason := stop_reason(run, settings, limit)):
        run.step()
        if progress is not None:
            progress(len(run.indices), limit)
    return run.selection(settings.criterion, reason)


@dataclass(frozen=True)
class Pool:
    """Samples held in memory out of all those surveyed: which they are, ascending, and their rows."""

    indices: IntArray
    space: RowSpace


def draw_pool(surveyed: Survey, size: int, rng: np.random.Generator) -> Pool:
    """Hold all samples where they fit, else draw `size` without replacement by their leverage, in one pass.

    The leverage ``h_i = trace(R_i (Q^T Q)^-1 R_i^T)`` says how much of what all samples determine rests on sample i:
    one that alone determines a direction has 1 or more. Sample i gets the key ``log(u_i) / h_i`` with u_i uniform, one
    drawn for each in order, none where all fit, and the largest keys are kept. `ComputationError` where the samples
    drawn do not determine all that the whole regressor determines. Efraimidis, Spirakis 2006: Weighted random sampling
    with a reservoir.
    """
    if surveyed.samples <= size:
        rows = np.concatenate(list(surveyed.projected()))
        return Pool(np.arange(len(rows)), space_of(surveyed, rows))
    reservoir = _Reservoir(size, surveyed.rank)
    for rows in surveyed.projected():
        leverage = np.sum((rows / surveyed.singular_values) ** 2, axis=(1, 2))
        with np.errstate(divide="ignore"):
            keys = np.log(rng.random(len(rows))) / leverage
        reservoir.offer(np.maximum(keys, _LOWEST_KEY), rows)
    order = np.argsort(reservoir.indices)
    pool = Pool(reservoir.indices[order], space_of(surveyed, reservoir.rows[order]))
    _require_rank(pool.space, size)
    return pool


class _Reservoir:
    """The rows with the largest keys so far."""

    def __init__(self, size: int, columns: int) -> None:
        self._keys = np.full(size, -np.inf)
        self.indices: IntArray = np.full(size, -1, dtype=np.int64)
        self.rows: Array = np.zeros((size, 3, columns))
        self._offered = 0

    def offer(self, keys: Array, rows: Array) -> None:
        size = len(self._keys)
        kept = np.zeros(size + len(keys), dtype=bool)
        kept[np.argpartition(np.concatenate([self._keys, keys]), len(keys))[-size:]] = True
        entering = np.flatnonzero(kept[size:])
        leaving = np.flatnonzero(~kept[:size])
        self._keys[leaving], self.rows[leaving] = keys[entering], rows[entering]
        self.indices[leaving] = self._offered + entering
        self._offered += len(keys)


def _require_rank(space: RowSpace, size: int) -> None:
    factor = TriangularFactor(space.rank, space.rank_tolerance)
    factor.add(space.rows.reshape(-1, space.rank))
    if not factor.full_rank:
        raise ComputationError(
            f"reduction.pool = {size}: samples drawn have rank {factor.rank}, all samples {space.rank}; raise it"
        )


def reduce_streamed(
    surveyed: Survey, settings: ReductionSettings, rng: np.random.Generator, progress: Progress | None = None
) -> Selection:
    """Choose samples of a surveyed regressor, in one more pass.

    Where all samples fit in the pool, the choice is that of `choose`. Else it is made from a pool drawn by leverage;
    rank and condition number of the full set are of all samples all the same.

    Parameters
    ----------
    surveyed : Survey
        Made with the settings' rank tolerance.
    rng : numpy.random.Generator
        Not used where all samples fit in the pool.
    progress : callable, optional
        Called with the samples chosen and the most there can be.

    Returns
    -------
    Selection
        With indices into all samples.

    Raises
    ------
    ComputationError
        If the samples of the pool do not determine all that the whole regressor determines.
    SettingError
        See `choose`.

    References
    ----------
    method.md, section 6.
    """
    pool = _pool(surveyed, settings, rng)
    selection = choose(pool.space, settings, progress)
    exhausted = selection.stop_reason == "all-samples" and len(pool.indices) < surveyed.samples
    reason = "pool" if exhausted else selection.stop_reason
    return replace(selection, indices=pool.indices[selection.indices], stop_reason=reason)


def check_streamed(surveyed: Survey, settings: ReductionSettings, rng: np.random.Generator) -> None:
    """Refuse what `reduce_streamed` would refuse, without the work of choosing.

    Raises
    ------
    ComputationError, SettingError
        See `reduce_streamed`.
    """
    check_space(_pool(surveyed, settings, rng).space, settings)


def _pool(surveyed: Survey, settings: ReductionSettings, rng: np.random.Generator) -> Pool:
    """Hold what there is to choose from; every n-th of all samples is no choice from a pool."""
    if settings.criterion != "even" or settings.size is None or settings.size > surveyed.samples:
        return draw_pool(surveyed, settings.pool, rng)
    return pool_of(surveyed, every_nth(surveyed.samples, settings.size))


def pool_of(surveyed: Survey, wanted: IntArray) -> Pool:
    """Hold the rows of some samples of all, by ascending indices."""
    blocks, first = [], 0
    for rows in surveyed.projected():
        begin, end = np.searchsorted(wanted, [first, first + len(rows)])
        blocks.append(rows[wanted[begin:end] - first])
        first += len(rows)
    return Pool(wanted, space_of(surveyed, np.concatenate(blocks)))


def random_streamed(
    surveyed: Survey, size: int, count: int, rng: np.random.Generator
) -> list[tuple[IntArray, TriangularFactor]]:
    """Choose samples at random, each with the same probability and none twice, several times over, in one pass.

    Parameters
    ----------
    size : int
        Samples to choose.
    count : int
        Choices, independent of each other.

    Returns
    -------
    list of (array of int, TriangularFactor)
        Of each choice its samples, and the factor of their rows, which has its rank and condition number.

    Raises
    ------
    ComputationError
        If the size is not between 1 and the number of samples.
    """
    if not 1 <= size <= surveyed.samples:
        raise ComputationError(f"size = {size}: expected 1 to {surveyed.samples}, the number of samples")
    chosen = [rng.choice(surveyed.samples, size, replace=False) for _ in range(count)]
    factors = [TriangularFactor(surveyed.rank, surveyed.rank_tolerance) for _ in chosen]
    ascending, waiting, first = [np.sort(own) for own in chosen], [list[Array]() for _ in chosen], 0
    for rows in surveyed.projected():
        last = first + len(rows) == surveyed.samples
        for own, factor, held in zip(ascending, factors, waiting, strict=True):
            begin, end = np.searchsorted(own, [first, first + len(rows)])
            held.append(rows[own[begin:end] - first])
            if last or sum(map(len, held)) >= _WAITING_SAMPLES:
                factor.add(np.concatenate(held).reshape(-1, surveyed.rank))
                held.clear()
        first += len(rows)
    return list(zip(chosen, factors, strict=True))
