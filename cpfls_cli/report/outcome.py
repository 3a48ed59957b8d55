"""What a command has to say, for people as blocks and for machines as a summary."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpfls_cli.report.content import Block, Text

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


def caution_texts(cautions: Iterable[str]) -> Iterator[Text]:
    """Write what speaks against a model: the first is seen however many notes there are."""
    return (Text(each, "warning", always=index == 0) for index, each in enumerate(cautions))
