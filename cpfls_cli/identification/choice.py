"""Choose the model among the non-dominated ones."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import SettingError
from cpfls_cli.identification.settings import Choice


def choose(objectives: Array, rule: Choice, held_out: Array | None = None) -> int:
    """Choose one member of a Pareto front.

    Parameters
    ----------
    objectives : array, shape (members, 3)
        Mean squared error, largest error, condition number.
    rule : {"mse-below-median-condition", "mse", "max-error", "held-out"}
        The first takes the smallest mean squared error among members whose condition number is at most the
        median of the front.
    held_out : array, shape (members,), optional
        Mean squared errors on flights kept for the choice, which `held-out` takes the smallest of.

    Returns
    -------
    int
        Index of the member.

    Raises
    ------
    SettingError
        If the rule and the flights kept for the choice do not go together.

    References
    ----------
    method.md section 7.
    """
    require_flights(rule, given=held_out is not None)
    if held_out is not None:
        return int(np.argmin(held_out))
    if rule == "max-error":
        return int(np.argmin(objectives[:, 1]))
    candidates = np.arange(len(objectives))
    if rule == "mse-below-median-condition":
        candidates = np.flatnonzero(objectives[:, 2] <= np.median(objectives[:, 2]))
    return int(candidates[np.argmin(objectives[candidates, 0])])


def require_flights(rule: Choice, *, given: bool) -> None:
    """Refuse a rule that needs flights kept for the choice without them, and flights that no rule needs.

    Parameters
    ----------
    rule : Choice
    given : bool
        Whether there are such flights.

    Raises
    ------
    SettingError
    """
    if rule == "held-out" and not given:
        raise SettingError("choice", "needs a flight that is kept for the choice; add --choose-on FLIGHT")
    if rule != "held-out" and given:
        raise SettingError("choice", "does not use the flights of --choose-on; set it to held-out, or leave them out")
