"""What is said of a search that was stopped before its end, and how to go on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from cpfls_cli.errors import ComputationError, CpflsError, StoppedError
from cpfls_cli.identification.search import StopReason, is_end
from cpfls_cli.report.outcome import Outcome

_STOPPED = {"interrupted": "the search was interrupted", "time-limit": "--time-limit ended the search"}
_REMEDY = "the same command with --resume goes on"
FROM_SIGNAL = 128
"""What the number of a signal is added to for an exit code."""


def stopped(outcome: Outcome, reason: StopReason, signal: int | None, output: Path) -> Outcome:
    """Add to what is said of a model that its search was stopped.

    Parameters
    ----------
    reason : str
        Why the search ended.
    signal : int or None
        Number of the signal that stopped it.
    output : Path
        The model.

    Returns
    -------
    Outcome
        The same for a search that came to its end.
    """
    if is_end(reason):
        return outcome
    note = f"{output}: is incomplete, because {_STOPPED[reason]}; {_REMEDY}"
    code = 0 if signal is None else FROM_SIGNAL + signal
    return replace(outcome, warnings=(*outcome.warnings, note), exit_code=code)


def without_model(reason: StopReason, signal: int | None) -> CpflsError | None:
    """Say that a search was stopped before it had a model to write.

    Parameters
    ----------
    reason : str
        Why the search ended.
    signal : int or None
        Number of the signal that stopped it.

    Returns
    -------
    CpflsError or None
        None for a search that came to its end.
    """
    if is_end(reason):
        return None
    message = f"{_STOPPED[reason]} before a model was found, so none is written; {_REMEDY}"
    return ComputationError(message) if signal is None else StoppedError(message, FROM_SIGNAL + signal)
