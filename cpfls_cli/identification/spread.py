"""How far replicates of one setting lie apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array


@dataclass(frozen=True)
class Spread:
    """A measure over replicates.

    Attributes
    ----------
    count : int
        Replicates that have a value.
    mean : float
        NaN without any.
    variance : float
        Unbiased; NaN for fewer than two.
    """

    count: int
    mean: float
    variance: float

    @property
    def deviation(self) -> float:
        """Standard deviation."""
        return float(np.sqrt(self.variance))


def spread(values: Array) -> Spread:
    """Measure how far replicates lie apart: ``s^2 = sum (x - mean x)^2 / (n - 1)``.

    Parameters
    ----------
    values : array, shape (replicates,)
        Not finite where a replicate found nothing.
    """
    known = values[np.isfinite(values)]
    mean = float(np.mean(known)) if len(known) else float("nan")
    variance = float(np.var(known, ddof=1)) if len(known) > 1 else float("nan")
    return Spread(len(known), mean, variance)
