"""What a search that was stopped leaves next to its output, as `identify` keeps it, and what is said of it."""

from __future__ import annotations

from pathlib import Path

from cpfls_cli.errors import ComputationError, CpflsError, StoppedError
from cpfls_cli.identification.search import StopReason, is_end
from cpfls_cli.report.content import Text
from cpfls_cli.search import SearchState
from cpfls_cli.stage import Run, stage


@stage(SearchState, title="Unfinished search", study=True)
def checkpoint(run: Run) -> SearchState:
    """Leave it: that command does."""
    raise NotImplementedError(run.output)


_STOPPED = {"interrupted": "the search was interrupted", "time-limit": "--time-limit ended the search"}
_REMEDY = "the same command with --resume goes on"
_FROM_SIGNAL = 128


def stop_note(
    reason: StopReason, signal: int | None, output: Path, *, unjudged: str | None = None
) -> tuple[Text | None, int]:
    """Say that a signal or the time limit came before all was done, and what is kept; None where nothing came.

    After a signal the exit code is the one that a shell gives a program that it ended. `unjudged` is the option with
    which the command judges a whole model that the signal left without evidence.
    """
    if not is_end(reason):
        note = f"{output}: is incomplete, because {_STOPPED[reason]}; {_REMEDY}"
    elif signal is None:
        return None, 0
    elif unjudged is not None:
        note = (
            f"{output}: was found but not judged, because of the interrupt; the same command with {unjudged} judges it"
        )
    else:
        note = f"{output}: is complete; the interrupt came when there was nothing left to stop"
    return Text(note, "warning", always=True), 0 if signal is None else _FROM_SIGNAL + signal


def without_model(reason: StopReason, signal: int | None) -> CpflsError | None:
    """Say that a search was stopped before it had a model to write; None for a search that came to its end."""
    if is_end(reason):
        return None
    message = f"{_STOPPED[reason]} before a model was found, so none is written; {_REMEDY}"
    return ComputationError(message) if signal is None else StoppedError(message, _FROM_SIGNAL + signal)
