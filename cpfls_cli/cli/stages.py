"""Commands of stages: listed without a look into their modules, which load when a command is typed."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import cached_property, partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from cpfls_cli.arguments import FolderOption
from cpfls_cli.cli.command_lines import CommandLine, command_line
from cpfls_cli.cli.interrupts import deferred_interrupts
from cpfls_cli.cli.options import (
    Common,
    ConfigArgument,
    OutputOption,
    check_order,
    common_options,
    is_argument,
    refuse_overrides,
    repeated,
)
from cpfls_cli.cli.terminal import Narration, messages_for_errors, progress_bar, tell
from cpfls_cli.errors import ComputationError

if TYPE_CHECKING:
    from cpfls_cli.artifacts.job import Job, Progress
    from cpfls_cli.stage import Run, Stage

STAGES = Path(__file__).parents[1] / "stages"
ORDER = (
    *("look", "trajectory", "simulate", "init", "import", "reduce", "identify", "vehicle"),
    *("replay", "response", "tune", "report", "compare", "diagnose", "extend", "gap", "changed", "trend", "export"),
    *("spread", "info", "check", "config", "effects"),
)
"""Of the list of commands; what it does not name stands behind."""
PARTS = ("twin",)
"""Stages that are a part of another command: of `simulate`, along a flight."""
_DOCSTRING = re.compile(r'^"""(.*?)"""', re.DOTALL)
FilledOption = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Folder to fill.", show_default=False)
]


class StageCommand(TyperCommand):
    """A command whose module loads when more is asked of it than its name and its help."""

    def __init__(self, file: Path) -> None:
        self._file = file
        described = _DOCSTRING.match(file.read_text(encoding="utf-8"))
        assert described is not None, "a stage says in its docstring what it does"
        super().__init__(_named(file), help=inspect.cleandoc(described[1]), rich_markup_mode=None)

    @cached_property
    def _line(self) -> CommandLine:
        return command_line(self._file)

    def _stage(self) -> Stage:
        own: Stage = import_module("cpfls_cli.stage").loaded(self._file.stem)
        return own

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Repeat options that take all values that follow."""
        return super().parse_args(ctx, repeated(self.params, args) if self._line.several else args)

    @cached_property
    def _loaded(self) -> TyperCommand:
        app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
        assert self.name is not None, "a command has a name"
        app.command(self.name)(command_of(self.name, self._line, self._stage))
        made = typer.main.get_command(app)
        assert isinstance(made, TyperCommand), "it is one command"
        return made

    # The library sets both when a command is made, to nothing, and reads them when it is typed.
    @property
    def params(self) -> Any:
        """Arguments and options."""
        return self._loaded.params

    @params.setter
    def params(self, _: Any) -> None:
        """Take note of nothing."""

    @property
    def callback(self) -> Any:
        """Run it."""
        return self._loaded.callback

    @callback.setter
    def callback(self, _: Any) -> None:
        """Take note of nothing."""


def _named(file: Path) -> str:
    return file.stem.strip("_").replace("_", "-")


def stage_commands(folder: Path = STAGES) -> dict[str, TyperCommand]:
    """List the commands of the stages in a folder, in the order of the way through them.

    Some stages are a part of another command, which calls them.
    """
    every = (file for file in sorted(folder.glob("[a-z]*.py")) if file.stem not in PARTS)
    files = {_named(file): file for file in every}
    return {name: StageCommand(files[name]) for name in (*(own for own in ORDER if own in files), *files)}


def run_of(
    own: Stage,
    common: Common,
    output: Path | None,
    config: Path | None,
    reads: Callable[[Path], None],
    progress: Progress,
) -> Run:
    """Make the run of a stage, with the study of its config and what that leaves open."""
    from cpfls_cli.artifacts.job import require_numbers
    from cpfls_cli.config.load import validate
    from cpfls_cli.stage import Run

    study = common.study(config) if config else validate({}, "default")
    run = Run(study, output or Path(own.name), common.force, common.dry_run, progress, reads, deferred_interrupts)
    run.writes, run.with_config = output is not None, config is not None
    run.open_numbers = "guessed" if common.accept_guesses else "refused"
    if config:
        reads(config)
        run.inputs.append(config)
        run.data = partial(common.data, config)
        run.config = config
        if common.numbers is not None:
            run = import_module("cpfls_cli.stages._numbers").with_numbers_of(run, common.numbers)
        require_numbers(run, own.name)
    return run


def _unshown(done: float, total: int, note: str = "") -> None:
    """Show no progress of what only answers."""


@contextmanager
def noted(job: Job) -> Iterator[None]:
    """Say with what cannot be computed what speaks against the numbers that it came about with."""
    try:
        yield
    except ComputationError as error:
        for caution in list(job.cautions)[: bool(job.study.vehicle.unknown)]:
            error.add_note(caution)
        raise


def command_of(name: str, line: CommandLine, load: Callable[[], Stage]) -> Callable[..., None]:
    """Write the command line of a stage: its own parameters, its output, a config where it takes one, common options.

    `load` gives the stage, when the command runs.
    """
    declared = any(each.name == "config" for each in line.parameters)
    hints = {"config": ConfigArgument} if line.study and not declared else {}
    hints |= {each.name: each.annotation for each in line.parameters}
    arguments = [own for own, hint in hints.items() if is_argument(hint)]
    shared = common_options(name, hints)

    def command(**given: Any) -> None:
        common = Common(**{each.name: given.pop(each.name) for each in shared})
        if "config" not in hints or (declared and given["config"] is None):
            refuse_overrides(common, given=not declared)
        check_order(name, {own: given[own] for own in arguments}, given.get("output"))
        with messages_for_errors():
            _run(load(), common, given, declared=declared)

    keyword = inspect.Parameter.KEYWORD_ONLY
    option = line.output or (FilledOption if line.folder else FolderOption if line.fills else OutputOption)
    output = inspect.Parameter("output", keyword, annotation=option)
    outputs = [] if line.output is False else [output.replace(default=None) if line.folder or line.output else output]
    first = [] if declared or not line.study else [inspect.Parameter("config", keyword, annotation=ConfigArgument)]
    whole = [*first, *(each.replace(kind=keyword) for each in line.parameters), *outputs, *shared]
    command.__signature__ = inspect.Signature(whole)  # type: ignore[attr-defined]
    command.__annotations__ = {each.name: each.annotation for each in whole}
    return command


def _run(own: Stage, common: Common, given: dict[str, Any], *, declared: bool) -> None:
    """Run a stage as its command line says, and print what it says."""
    from cpfls_cli.artifacts.output import locked

    output, config = given.pop("output", None), given["config"] if declared else given.pop("config", None)
    narration = Narration(own.name, common.verbose and not common.quiet)
    if callable(own.study) and not own.study(given):
        refuse_overrides(common)
        config = None
    if own.overrides:
        common = replace(common, overrides=[*(common.overrides or []), *own.overrides(**given)])
    with nullcontext(_unshown) if own.output is False else progress_bar(own.name, common) as progress:
        run = run_of(own, common, output, config, narration.reads, progress)
        with locked(run.output, own.name) if run.writes and not run.dry_run else nullcontext(), noted(run):
            outcome = own.run(run, **given)
    if output and not common.dry_run:
        narration.wrote(output)
    tell(outcome, common)
