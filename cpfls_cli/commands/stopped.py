"""What is said of a search that was stopped before its end, and how to go on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from cpfls_cli.errors import ComputationError, CpflsError, StoppedError
from cpfls_cli.identification.search import StopReason, is_end
from cpfls_cli.report.content import Text
from cpfls_cli.report.outcome import Outcome

_STOPPED = {"interrupted": "the search was interrupted", "time-limit": "--time-limit ended the search"}
_REMEDY = "the same command with --resume goes on"
_FROM_SIGNAL = 128


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
    return _with_note(outcome, f"{output}: is incomplete, because {_STOPPED[reason]}; {_REMEDY}", signal)


def not_judged(outcome: Outcome, signal: int | None, output: Path) -> Outcome:
    """Add to what is said of a model that an interrupt left it without evidence.

    Parameters
    ----------
    signal : int or None
        Number of the signal; None where the evidence was gathered or not asked for.
    output : Path
        The model.
    """
    if signal is None:
        return outcome
    note = (
        f"{output}: is complete but was not judged, because of the interrupt; the same command with --force judges it"
    )
    return _with_note(outcome, note, signal)


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
    return ComputationError(message) if signal is None else StoppedError(message, _FROM_SIGNAL + signal)


def _with_note(outcome: Outcome, note: str, signal: int | None) -> Outcome:
    """Add a note, and the exit code that a shell gives a program that a signal ended."""
    code = 0 if signal is None else _FROM_SIGNAL + signal
    return replace(outcome, blocks=(*outcome.blocks, Text(note, "warning")), exit_code=code)
