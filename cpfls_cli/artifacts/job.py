"""One run of a command: its study, its inputs, its output, and how it shows its progress."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Protocol

from cpfls_cli.artifacts.gate import InputFile, Origin, format_name, read_origin
from cpfls_cli.artifacts.output import check_output
from cpfls_cli.config.study import Study, resolved_yaml
from cpfls_cli.config.unknown import needs_numbers, require_known
from cpfls_cli.errors import InputError
from cpfls_cli.files import read_content


class Progress(Protocol):
    """Shows how far long work has come."""

    def __call__(self, done: float, total: int, note: str = "") -> None:
        """Take note that `done` of `total` steps are done."""
        ...


Interrupted = Callable[[], int | None]
"""Gives the number of the signal that asks to stop, or None."""


@dataclass
class Job:
    """One run of a stage.

    `reads` takes note of every input file; `deferred_interrupts` gives a context in which an interrupt does not end the
    program, but is said to whoever asks; `inputs`: the config, and every input that was taken so far, no output may
    replace them; `config`: file of the study, as the commands that go on name it; `open_numbers`: whether a command
    that needs numbers which the config leaves open refuses, takes the guesses that stand for them, or has those of a
    vehicle that was `found`; `cautions`: what speaks against the models and numbers that it rests on, in order, the
    output carries it.
    """

    study: Study
    output: Path
    force: bool
    dry_run: bool
    progress: Progress
    reads: Callable[[Path], None]
    deferred_interrupts: Callable[[], AbstractContextManager[Interrupted]] = lambda: nullcontext(lambda: None)
    inputs: list[Path] = field(default_factory=list)
    config: Path = Path("CONFIG")
    open_numbers: Literal["refused", "guessed", "found"] = "refused"
    found: Path | None = None
    cautions: dict[str, None] = field(default_factory=dict)

    def sibling(self, name: str) -> Path:
        """Name a file in the folder of the output."""
        return self.output.with_name(name)


def require_numbers(job: Job, command: str, *, whole: bool = True) -> None:
    """Refuse numbers that the config leaves open, as `require_known`; or say how far its output hangs on guesses."""
    if job.open_numbers != "found":
        said = require_known(job.study, command, whole=whole, accept=job.open_numbers == "guessed")
        job.cautions.update(dict.fromkeys(said))


def go_on(job: Job, command: str, *words: str | Path, output: Path) -> tuple[str | Path, ...]:
    """Give a command that goes on with the config of a job; what that leaves open it takes as the job did."""
    taken: Sequence[str | Path] = ()
    # A path asks for none of them, but what a flight is to identify depends on all.
    if needs_numbers(job.study.vehicle, command) or (job.study.vehicle.unknown and "--for" in words):
        if job.found is not None:
            taken = () if "--model" in words else ("--model", job.found)
        elif job.open_numbers == "guessed" or "--model" not in words:
            taken = ("--accept-guesses",)
    return "cpfls", command, job.config, *words, *taken, "-o", output


def check_outputs(job: Job, *paths: Path, replaceable: bool = False) -> None:
    """Refuse outputs that cannot or must not be written, such as an input; replaceable ones need no --force."""
    for path in paths:
        check_output(path, job.force or replaceable, job.inputs)


def take_inputs(job: Any, inputs: Mapping[str, Path]) -> dict[str, InputFile]:
    """Check inputs, and take note of what they hold."""
    for path in inputs.values():
        _check_input(path)
        job.reads(path)
        job.inputs.append(path)
    for path in inputs.values():
        # What an input rests on, the output rests on.
        job.cautions.update(dict.fromkeys(read_origin(path).cautions if format_name(path) else ()))
    return {role: input_file(path) for role, path in inputs.items()}


def _check_input(path: Path) -> None:
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if path.is_dir():
        bags = [own.name for kind in ("*.db3", "*.mcap") for own in sorted(path.glob(kind))]
        inside = f"of a ROS 2 bag name the file in it: {', '.join(bags)}" if bags else ""
        raise InputError(f"{path}: is a folder, not a file; {inside or f'give its files: {shlex.quote(str(path))}/*'}")
    if not path.is_file():
        raise InputError(f"{path}: is a device or a pipe, not a file")


def origin_before(study: Study, inputs: Mapping[str, InputFile], stage: str = "checkpoint") -> Origin:
    """Tell where what a stopped command leaves comes from, before anything is known that speaks against it."""
    return Origin(stage=stage, inputs=inputs, seed=study.seed, config=resolved_yaml(study))


def input_file(path: Path) -> InputFile:
    """Describe an input file by name, hash and format."""
    # A name of bytes that are no text is stored with a mark in their place.
    name = os.fsencode(path.name).decode("utf-8", "replace")
    return InputFile(name, read_content(path).sha256, format_name(path) or path.suffix.lstrip("."))
