"""What all selection rules have in common."""

from __future__ import annotations

from typing import Protocol

from cpfls_cli.arrays import BoolArray
from cpfls_cli.reduction.factor import TriangularFactor


class Criterion(Protocol):
    """A rule that names the next sample; the caller then adds that sample to the factor."""

    def next_sample(self, factor: TriangularFactor, available: BoolArray) -> int:
        """Name the available sample that improves the criterion most; the lowest index where several do.

        Parameters
        ----------
        factor : TriangularFactor
            Factor of the samples chosen so far.
        available : array of bool, shape (samples,)
            Samples that are not chosen yet.
        """
        ...
