"""What is said of a search that was stopped before its end, and how to go on."""

from __future__ import annotations

from dataclasses import replace

from cpfls_cli.errors import ComputationError, CpflsError, StoppedError
from cpfls_cli.identification.search_run import StopReason, is_end
from cpfls_cli.stages.checkpoint import Checkpoint
from cpfls_cli.stages.job import Outcome

_STOPPED = {"interrupted": "the search was interrupted", "time-limit": "--time-limit ended the search"}
_FROM_SIGNAL = 128


def stopped(outcome: Outcome, reason: StopReason, signal: int | None, checkpoint: Checkpoint) -> Outcome:
    """Add to what is said of a model that its search was stopped.

    Parameters
    ----------
    outcome : Outcome
    reason : str
        Why the search ended.
    signal : int or None
        Number of the signal that stopped it.
    checkpoint : Checkpoint

    Returns
    -------
    Outcome
        The same for a search that came to its end.
    """
    if is_end(reason):
        return outcome
    note = f"{checkpoint.output}: is incomplete, because {_STOPPED[reason]}; {_remedy(checkpoint)}"
    code = 0 if signal is None else _FROM_SIGNAL + signal
    return replace(outcome, warnings=(*outcome.warnings, note), exit_code=code)


def without_model(reason: StopReason, signal: int | None, checkpoint: Checkpoint) -> CpflsError | None:
    """Say that a search was stopped before it had a model to write.

    Parameters
    ----------
    reason : str
        Why the search ended.
    signal : int or None
        Number of the signal that stopped it.
    checkpoint : Checkpoint

    Returns
    -------
    CpflsError or None
        None for a search that came to its end.
    """
    if is_end(reason):
        return None
    message = f"{_STOPPED[reason]} before a model was found, so none is written; {_remedy(checkpoint)}"
    return ComputationError(message) if signal is None else StoppedError(message, _FROM_SIGNAL + signal)


def _remedy(checkpoint: Checkpoint) -> str:
    if checkpoint.path.exists():
        return "the same command with --resume goes on"
    return "no generation was finished, so there is nothing to resume"
