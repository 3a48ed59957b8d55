"""What a command has to say, for people as blocks and for machines as a summary."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpfls_cli.report.content import Block, Text

if TYPE_CHECKING:
    from cpfls_cli.artifacts.job import Job

Command = Sequence[str | Path]
"""Words of a command line; a string is what a person does by hand."""


def command_line(command: Command) -> str:
    """Write a command so that it can be pasted, and what is done by hand as it is."""
    return command if isinstance(command, str) else shlex.join(map(str, command))


@dataclass(frozen=True)
class Outcome:
    """What a command has to say.

    Attributes
    ----------
    summary : mapping
        For machines (``--json``).
    blocks : tuple of Block
        For people, on standard output; texts of tone ``warning`` go to standard error.
    exit_code : int
        Not 0 where the work was stopped.
    next : tuple of Command
        To go on with, with the names of this run.
    written : Path or None
        File or folder that the command wrote.
    """

    summary: Mapping[str, Any]
    blocks: tuple[Block, ...] = ()
    exit_code: int = 0
    next: tuple[Command, ...] = ()
    written: Path | None = None


def cautioned(outcome: Outcome, job: Job) -> Outcome:
    """Say what speaks against the models and numbers that an answer rests on."""
    if not job.cautions:
        return outcome
    said = list(job.cautions)
    blocks = (*outcome.blocks, *caution_texts(said))
    return replace(outcome, summary={**outcome.summary, "cautions": said}, blocks=blocks)


def caution_texts(cautions: Iterable[str]) -> Iterator[Text]:
    """Write what speaks against a model: the first is seen however many notes there are."""
    return (Text(each, "warning", always=index == 0) for index, each in enumerate(cautions))


def nothing_written(job: Job) -> Outcome:
    """Say that all is good, where that is all that is asked for (``--dry-run``)."""
    line = Text(f"{job.output}: would be written; the config and all inputs are good")
    return Outcome({"dry_run": True, "output": str(job.output)}, (line,))


def as_json(value: Any) -> Any:
    """Write nested mappings, lists, numbers and text as JSON knows them: a number that is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(key): as_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return as_json(value.item()) if hasattr(value, "item") else value
