"""Output of the program: results on standard output; progress, messages and narration on standard error."""

from __future__ import annotations

import io
import json
import os
import re
import shlex
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import typer

from cpfls_cli.cli.options import Common, what_it_is
from cpfls_cli.errors import CpflsError, InputError, NotAnArtifactError, visible
from cpfls_cli.words import broken

if TYPE_CHECKING:
    from cpfls_cli.report.content import Outcome, Text

_BAR_WIDTH = 20
_TELLING = ("diagnosis", "changed", "trend")
"""Results in a folder whose `info` shows the answer of its command again."""
# Unasked notes leave the answer on a small screen.
_NOTE_LINES, _NOTE_WIDTH = 5, 80
# A number that is no part of a name.
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?!\.?\w)")
# 128 plus the number of SIGPIPE: what a shell reports of the tools that this signal ends.
_CLOSED_PIPE = 141
# How often a log hears of long work, with -v and without.
_ASKED_S, _UNASKED_S = 1.0, 60.0


@contextmanager
def messages_for_errors() -> Iterator[None]:
    """Turn an error that a user can cause into one message and an exit code."""
    try:
        yield
    except CpflsError as error:
        instead = what_it_is(error.path) if isinstance(error, NotAnArtifactError) else None
        _complain(instead or str(error))
        for note in getattr(error, "__notes__", ()):
            _complain(note, "note")
        raise typer.Exit(error.exit_code) from None
    except KeyboardInterrupt as interrupt:
        for note in getattr(interrupt, "__notes__", ()):
            _complain(note, "note")
        raise
    except MemoryError:
        _complain("not enough memory for this flight and structure; reduce the flight or the number of functions")
        raise typer.Exit(1) from None
    except BrokenPipeError:
        # Whoever reads the output has seen enough, as in `cpfls config | head -1`.
        _mute_output()
        raise typer.Exit(_CLOSED_PIPE) from None
    except OSError as error:
        if error.filename is None:
            _mute_output()
        _complain(f"{error.filename or 'output'}: {error.strerror or error}")
        raise typer.Exit(InputError.exit_code if error.filename else CpflsError.exit_code) from None


def tell(outcome: Outcome, common: Common) -> None:
    """Print what a command has to say, and end with its exit code."""
    from cpfls_cli.result import plain

    if isinstance(sys.stdout, io.TextIOWrapper):
        # An encoding without a degree sign must not end a command that has done its work.
        sys.stdout.reconfigure(errors="replace")
    if common.as_json:
        print(json.dumps(plain(outcome.summary), allow_nan=False), flush=True)
    # On one terminal what is printed last is what stays on the screen.
    notes_first = not common.as_json and _columns() is not None and _columns(sys.stderr) is not None
    if notes_first:
        _show_notes(outcome, common)
    if not common.quiet and not common.as_json:
        print("\n".join(_lines(outcome, whole=common.verbose)), flush=True)
    if not notes_first:
        _show_notes(outcome, common)
    if outcome.exit_code:
        raise typer.Exit(outcome.exit_code)


def _show_notes(outcome: Outcome, common: Common) -> None:
    from cpfls_cli.report.terminal import terminal_lines, warnings_of

    if not common.quiet:
        # What the answer says is no note too.
        said = "" if common.as_json else "\n".join(terminal_lines(outcome.blocks, whole=common.verbose))
        warnings = [each for each in warnings_of(outcome.blocks) if each.text.rstrip(".") not in said]
        for note in _notes(warnings, whole=common.verbose):
            _complain(note, "note")


def _lines(outcome: Outcome, *, whole: bool) -> Iterator[str]:
    """Write an answer, the commands that go on with it, and what more of it there is."""
    from cpfls_cli.report.content import Text, command_line
    from cpfls_cli.report.terminal import folded_words, terminal_lines

    width = _columns()
    colour = width is not None and "NO_COLOR" not in os.environ
    yield from terminal_lines(outcome.blocks, width, colour=colour, whole=whole)
    if outcome.next:
        yield "next:"
        # No line break of ours in it, so that it can be pasted.
        yield from (f"  {visible(command_line(command))}" for command in outcome.next)
    more = () if whole else folded_words(outcome.blocks)
    if more:
        yield from terminal_lines([Text(f"more with -v: {'; '.join(more)}")], width)
    if more and outcome.written is not None:
        from cpfls_cli.store import stage_of

        # Nothing has to be computed again to read it.
        written = outcome.written
        results = [written / f"{name}.h5" for name in _TELLING] if written.is_dir() else [written]
        for path in [path for path in results if stage_of(path)][:1]:
            yield f"or with {visible(shlex.join(('cpfls', 'info', str(path), '-v')))}"


def _columns(stream: TextIO | None = None) -> int | None:
    """Give the columns of the terminal; None where the stream, standard output if none is given, is none."""
    return shutil.get_terminal_size().columns if (stream or sys.stdout).isatty() else None


def _notes(warnings: Sequence[Text], *, whole: bool) -> Iterator[str]:
    """Give the notes that are shown, and how many more there are: the first few lines, and what must always be seen."""
    room, left, shown = _NOTE_LINES, 0, False
    for warning in warnings if whole else _merged(warnings):
        room -= -(-len(f"cpfls: note: {warning.text}") // _NOTE_WIDTH)
        if whole or warning.always or room >= 0 or not shown:
            shown = True
            yield warning.text
        else:
            left += 1
    if left:
        yield f"{left} more note{'s' if left > 1 else ''}: -v shows {'them' if left > 1 else 'it'}"


def _merged(warnings: Sequence[Text]) -> Iterator[Text]:
    """Join notes that say the same of several files, in the place of the first; numbers that differ become ranges."""
    alike: dict[tuple[bool, str], list[Text]] = {}
    for warning in warnings:
        name, colon, said = warning.text.partition(": ")
        alike.setdefault((bool(colon), _NUMBER.sub("#", said) if colon else name), []).append(warning)
    for (named, _), same in alike.items():
        if not named or len(same) == 1:
            yield same[0]
            continue
        names, saids = zip(*(each.text.split(": ", 1) for each in same), strict=True)
        ranges = map(_range_of, zip(*map(_NUMBER.findall, saids), strict=True))
        first, *between = _NUMBER.split(saids[0])
        said = first + "".join(number + words for number, words in zip(ranges, between, strict=True))
        others = len(set(names)) - 1
        if not others:
            text = f"{names[0]}: {said}"
        elif " " in (Path(names[0]).suffix or names[0]):
            # No file, but what was done to one: "the first 3.1 s are cut".
            text = f"{names[0]}: {said} ({others} more like it)"
        else:
            text = f"{names[0]} and {others} more: {said}"
        yield replace(same[0], text=text, always=any(each.always for each in same))


def _range_of(numbers: Sequence[str]) -> str:
    low, high = min(numbers, key=float), max(numbers, key=float)
    return low if float(low) == float(high) else f"{low} to {high}"


@contextmanager
def progress_bar(title: str, common: Common) -> Iterator[Callable[..., None]]:
    """Show the progress of long work on a terminal, with the time left.

    What it yields takes steps done, steps in all, and a note; where standard error is no terminal it writes a line now
    and then.
    """
    with _log_shown(title, common):
        if common.quiet:
            yield lambda *_, **__: None
        elif not sys.stderr.isatty():
            yield _log_progress(title, asked=common.verbose)
        else:
            with _bar(title) as show:
                yield show


@contextmanager
def _bar(title: str) -> Iterator[Callable[..., None]]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
    from rich.table import Column

    columns = (
        TextColumn(title),
        BarColumn(bar_width=_BAR_WIDTH, table_column=Column(width=_BAR_WIDTH)),
        TaskProgressColumn(),
        TimeRemainingColumn(table_column=Column(no_wrap=True)),
        # What is left of the line; a longer note is cut, so that bar and time stay whole.
        TextColumn(
            "{task.fields[note]}", markup=False, table_column=Column(no_wrap=True, overflow="ellipsis", ratio=1)
        ),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True, expand=True) as bar:
        task = bar.add_task(title, total=None, note="")

        def show(done: float, total: int, note: str = "") -> None:
            bar.update(task, completed=done, total=total, note=visible(note))

        yield show


@contextmanager
def _log_shown(title: str, common: Common) -> Iterator[None]:
    """Show what the program logs as lines on standard error, above a bar; warnings also where nobody watches."""
    import logging

    class Line(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            # What standard error is now: a bar takes its place while it is shown.
            print(visible(f"{title}: {record.getMessage()}"), file=sys.stderr, flush=True)

    log, lines = logging.getLogger("cpfls_cli"), Line()
    log.addHandler(lines)
    watched = common.verbose or sys.stderr.isatty()
    log.setLevel(logging.ERROR if common.quiet else logging.INFO if watched else logging.WARNING)
    try:
        yield
    finally:
        log.removeHandler(lines)


def _log_progress(title: str, *, asked: bool) -> Callable[..., None]:
    """Write a line at most once a second, for logs, and the last; unasked once a minute."""
    started, every = time.monotonic(), _ASKED_S if asked else _UNASKED_S
    last = [started]

    def show(done: float, total: int, note: str = "") -> None:
        now = time.monotonic()
        if now - last[0] >= every or (asked and done == total):
            last[0] = now
            # Of nothing, all is done.
            share = done / total if total else 1.0
            left = f"  {_duration((now - started) * (1 / share - 1))} left" if 0 < share < 1 else ""
            print(f"{title}: {share:4.0%}{left}  {visible(note)}", file=sys.stderr, flush=True)

    return show


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


def _mute_output() -> None:
    """Discard further output, on which the interpreter would otherwise fail when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _complain(text: str, kind: str = "error") -> None:
    width = _columns(sys.stderr)
    for line in _with_plain_names(text).rstrip("\n").split("\n"):
        said = f"cpfls: {kind}: {line}"
        print(said if width is None else "\n".join(broken(said, width)), file=sys.stderr)


def _with_plain_names(text: str) -> str:
    """Write control characters in names that were given as escapes: a line break in one would break a message."""
    for given in sys.argv[1:]:
        for name in (given, str(Path(given))):
            if not name.isprintable():
                text = text.replace(name, "".join(each if each.isprintable() else repr(each)[1:-1] for each in name))
    return visible(text)


@dataclass(frozen=True)
class Narration:
    """Report on standard error which files a command reads and writes, if wanted."""

    title: str
    wanted: bool
    started: float = field(default_factory=time.perf_counter)

    def reads(self, path: Path) -> None:
        """Report that a file is read."""
        self._say(f"reads {path}{_size(path)}")

    def wrote(self, path: Path) -> None:
        """Report that a file was written, and the time since the command started."""
        self._say(f"wrote {path}{_size(path)} in {time.perf_counter() - self.started:.2f} s")

    def _say(self, text: str) -> None:
        if self.wanted:
            print(f"{self.title}: {_with_plain_names(text)}", file=sys.stderr)


def _size(path: Path) -> str:
    from rich.filesize import decimal

    return f" ({decimal(path.stat().st_size)})" if path.is_file() else ""
