"""What a reduction returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from cpfls_cli.arrays import Array, IntArray

StopReason = Literal["size", "condition-number", "all-samples", "pool"]


@dataclass(frozen=True)
class Subset:
    """Samples of a regressor and how well they determine its parameters.

    Attributes
    ----------
    criterion : str
        Rule that chose the samples.
    indices : array of int, shape (size,)
        Chosen samples, in the order in which they were chosen.
    condition_number : float
        Largest over smallest singular value of the chosen samples, over as many singular values as the full
        set's rank; infinite when the subset has a smaller rank.
    condition_number_full : float
        The same for all samples.
    rank : int
        Numerical rank of the chosen samples.
    rank_full : int
        Numerical rank of all samples.
    """

    criterion: str
    indices: IntArray
    condition_number: float
    condition_number_full: float
    rank: int
    rank_full: int

    @property
    def full_rank(self) -> bool:
        """Whether the chosen samples determine everything that all samples determine."""
        return self.rank == self.rank_full


@dataclass(frozen=True)
class Selection(Subset):
    """A subset with the history of its selection.

    Attributes
    ----------
    condition_number_trace : array, shape (size,)
        Condition number after each sample; infinite before full rank.
    singular_value_min_trace : array, shape (size,)
        Smallest singular value after each sample; zero before full rank.
    singular_value_max_trace : array, shape (size,)
        Largest singular value after each sample.
    rank_trace : array of int, shape (size,)
        Numerical rank after each sample.
    stop_reason : {"size", "condition-number", "all-samples", "pool"}
        Which limit ended the selection; the pool where it, and not all samples, was used up.
    exchanges : int
        Samples that were replaced by others on the way.
    """

    condition_number_trace: Array
    singular_value_min_trace: Array
    singular_value_max_trace: Array
    rank_trace: IntArray
    stop_reason: StopReason
    exchanges: int = 0

    @property
    def stalled(self) -> bool:
        """Whether the rule ended below full rank, so that the subset must not be trained on."""
        return not self.full_rank
