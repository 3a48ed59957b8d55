"""Choose the model among the non-dominated ones."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.identification.settings import Choice


def choose(objectives: Array, rule: Choice) -> int:
    """Choose one member of a Pareto front.

    Parameters
    ----------
    objectives : array, shape (members, 3)
        Mean squared error, largest error, condition number.
    rule : {"mse-below-median-condition", "mse", "max-error"}
        The first takes the smallest mean squared error among members whose condition number is at most the
        median of the front.

    Returns
    -------
    int
        Index of the member.

    References
    ----------
    method.md section 7.
    """
    if rule == "max-error":
        return int(np.argmin(objectives[:, 1]))
    candidates = np.arange(len(objectives))
    if rule == "mse-below-median-condition":
        candidates = np.flatnonzero(objectives[:, 2] <= np.median(objectives[:, 2]))
    return int(candidates[np.argmin(objectives[candidates, 0])])
