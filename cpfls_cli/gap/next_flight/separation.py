"""How well flights tell rivals apart: what of an effect its rival cannot imitate, in squared noise floors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.effect import Effect
from cpfls_cli.gap.balance.balance_system import is_free, system
from cpfls_cli.gap.balance.weak_flight import Candidate, WeakFlight, nuisance
from cpfls_cli.gap.naming.ranking import least_gain, off_by
from cpfls_cli.gap.naming.scoring import candidates_of
from cpfls_cli.gap.settings import ERRORS
from cpfls_cli.weak_form.windows import Windows

SURE = 0.975
"""Probability from which a flight is said to settle a question."""


@dataclass(frozen=True)
class SizedEffect:
    """An effect with a value for each of its numbers.

    Attributes
    ----------
    linear : array, shape (coefficient,)
        1 where everything is in the shape.
    """

    candidate: Candidate
    linear: Array


@dataclass(frozen=True)
class Question:
    """Whether an effect would be told from a rival, if it is the true one.

    Attributes
    ----------
    rival : Effect or None
        None: whether the effect shows at all, beyond the vehicle's own numbers.
    besides : tuple of SizedEffect
        Effects that are there whichever is true; their coefficients are free.
    """

    true: SizedEffect
    rival: Effect | None
    besides: tuple[SizedEffect, ...] = ()


@dataclass(frozen=True)
class Evidence:
    """Products of all columns that a question takes, over the windows of flights; those of more flights add up.

    Attributes
    ----------
    gram : array, shape (column, column)
        In squared floors: the true effect, then base columns, then the rival at each point of its grid.
    rows : int
        Windows times known channels.
    """

    gram: Array
    windows: int
    rows: int

    def __add__(self, other: Evidence) -> Evidence:
        return Evidence(self.gram + other.gram, self.windows + other.windows, self.rows + other.rows)

    def taken(self, times: int) -> Evidence:
        """Take the same flights several times."""
        return Evidence(times * self.gram, times * self.windows, times * self.rows)


@dataclass(frozen=True)
class QuestionColumns:
    """Where the columns of a question stand.

    Attributes
    ----------
    rivals : tuple of array of int
        One for each point of the rival's grid; one empty array where there is no rival.
    unit : bool
        Whether the rival has the coefficient 1.
    """

    base: IntArray
    rivals: tuple[IntArray, ...]
    unit: bool


def gathered(question: Question, flights: Sequence[WeakFlight], floor: Array) -> tuple[Evidence, QuestionColumns]:
    """Gather what flights along known motions would say on a question.

    Parameters
    ----------
    flights : sequence of WeakFlight
        Their residuals are not used.
    floor : array, shape (6,), N m and N
    """
    balance = system(flights)
    free = [nuisance(), *(each.candidate for each in question.besides if is_free(each.candidate))]
    tried = [] if question.rival is None or question.rival.kind == "parameter" else candidates_of([question.rival])
    true = (balance.columns(question.true.candidate) @ question.true.linear)[..., None]
    parts = [true, *(balance.columns(each) for each in (*free, *tried))]
    ends = np.cumsum([part.shape[2] for part in parts])
    indices = [np.arange(end - part.shape[2], end) for part, end in zip(parts, ends, strict=True)]
    matrix = (np.concatenate(parts, axis=2) / floor[:, None]).reshape(-1, int(ends[-1]))
    rows = sum(len(flight) * int(flight.known.sum()) for flight in flights)
    rivals = tuple(indices[1 + len(free) :]) or (np.zeros(0, dtype=int),)
    unit = bool(tried) and tried[0].effect.unit_coefficient
    evidence = Evidence(matrix.T @ matrix, sum(len(flight) for flight in flights), rows)
    return evidence, QuestionColumns(np.concatenate(indices[1 : 1 + len(free)]), rivals, unit)


def apart(evidence: Evidence, columns: QuestionColumns) -> float:
    """Compute the part of the true effect that the rival leaves over, at its best.

    Returns
    -------
    float
        Sum of squares, in squared floors.
    """
    return min(_left(evidence.gram, columns, rival) for rival in columns.rivals)


def beyond_numbers(evidence: Evidence, columns: QuestionColumns) -> float:
    """Compute the part of the true effect that the free columns beside the rival leave over, in squared floors."""
    return _left(evidence.gram, columns, np.zeros(0, dtype=int))


def _left(gram: Array, columns: QuestionColumns, rival: IntArray) -> float:
    weight = np.zeros(len(gram))
    weight[0] = 1.0
    free = columns.base
    if columns.unit and len(rival):
        weight[rival] = -1.0
    else:
        free = np.concatenate([free, rival])
    scale = np.sqrt(np.diag(gram)[free])
    scale = np.where(scale > 0, scale, 1.0)
    right = (gram[free] @ weight) / scale
    values, vectors = np.linalg.eigh(gram[np.ix_(free, free)] / np.outer(scale, scale))
    kept = values > 1e-10 * max(values.max(initial=0.0), 1e-300)
    imitated = ((vectors.T @ right)[kept] ** 2 / values[kept]).sum()
    return float(max(weight @ gram @ weight - imitated, 0.0))


@dataclass(frozen=True)
class Answer:
    """What flights would say on a question.

    Attributes
    ----------
    apart : float
        See `apart`.
    least : float
        What the diagnosis needs of it.
    noise : float
        Standard deviation of one squared floor for each unit of `apart`: neighbouring windows share noise.
    """

    apart: float
    least: float
    noise: float

    @property
    def log_bayes(self) -> float:
        """Expected logarithm of the Bayes factor for the true effect."""
        return 0.5 * self.apart / self.noise

    @property
    def sure(self) -> float:
        """Probability that the diagnosis then names the true effect and not its rival."""
        return float(ndtr((self.apart - self._margin) / self._error))

    @property
    def wrong(self) -> float:
        """Probability that the diagnosis then names the rival."""
        return float(ndtr((-self.apart - self._margin) / self._error))

    @property
    def _error(self) -> float:
        """Standard deviation of the difference between what the two leave, in squared floors."""
        return 2 * float(np.sqrt(max(self.apart * self.noise, 1e-12)))

    @property
    def _margin(self) -> float:
        """Difference from which on the diagnosis decides."""
        return max(self.least, ERRORS * self._error)

    @property
    def enough(self) -> float:
        """What `apart` has to be for an answer of probability `SURE`."""
        by_noise = 4 * self.noise * (ERRORS + ndtri(SURE)) ** 2
        # The root of apart - least = quantile * error, for errors of 2 sqrt(apart noise).
        root = ndtri(SURE) * np.sqrt(self.noise)
        return float(max(by_noise, (root + np.sqrt(root**2 + self.least)) ** 2))

    @property
    def least_size(self) -> float:
        """Share of the effect's size from which on the answer is sure, for effects that are linear in it."""
        return float(np.sqrt(self.enough / max(self.apart, 1e-12)))


def judged(evidence: Evidence, columns: QuestionColumns, noise: float) -> Answer:
    """Judge what flights would say on a question."""
    seen = beyond_numbers(evidence, columns)
    # An effect without a rival has to be worth a name.
    alone = not len(columns.rivals[0])
    least = least_gain(seen, evidence.windows) if alone else off_by(seen, evidence.rows)
    return Answer(apart(evidence, columns), least, noise)


def shared_noise(windows: Windows) -> float:
    """Compute the variance of a sum over windows, over that of windows without common samples."""
    weight, total = windows.weight, 1.0
    for shift in range(windows.hop, len(weight), windows.hop):
        total += 2 * float(weight[shift:] @ weight[:-shift]) / float(weight @ weight)
    return total
