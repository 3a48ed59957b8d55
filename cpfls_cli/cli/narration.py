"""What ``-v`` says of a command: the files it reads, the file it wrote, its size and the time it took."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Narration:
    """Tell on standard error which files a command works on, where it is asked to.

    Attributes
    ----------
    title : str
        The command.
    wanted : bool
        Whether to say anything at all.
    started : float, s
        When the command started, by a clock that only goes forward.
    """

    title: str
    wanted: bool
    started: float = field(default_factory=time.perf_counter)

    def reads(self, path: Path) -> None:
        """Say that a file is read."""
        self._say(f"reads {path}{_size(path)}")

    def wrote(self, path: Path) -> None:
        """Say that a file was written, and how long it took since the command started."""
        self._say(f"wrote {path}{_size(path)} in {time.perf_counter() - self.started:.2f} s")

    def _say(self, text: str) -> None:
        if self.wanted:
            print(f"{self.title}: {text}", file=sys.stderr)


def _size(path: Path) -> str:
    from rich.filesize import decimal

    return f" ({decimal(path.stat().st_size)})" if path.is_file() else ""
