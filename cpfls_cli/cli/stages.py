"""Commands of stages: listed without a look into their modules, which load when a command is typed."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from contextlib import nullcontext
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from cpfls_cli.cli.options import Commands, Common, ConfigArgument, OutputOption, with_common
from cpfls_cli.cli.terminal import Narration, messages_for_errors, progress_bar, tell

if TYPE_CHECKING:
    from cpfls_cli.stage import Stage

STAGES = Path(__file__).parents[1] / "stages"
_FIRST = ("look",)
"""Stages that stand at the head of the list."""
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
        super().__init__(file.stem.replace("_", "-"), help=inspect.cleandoc(described[1]), rich_markup_mode=None)

    @cached_property
    def _loaded(self) -> TyperCommand:
        app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
        app.command(self.name)(with_common(command_of(import_module("cpfls_cli.stage").loaded(self._file.stem))))
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


class AllCommands(Commands):
    """The commands of stages, and behind them all others."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self.commands = {**stage_commands(), **self.commands}


def stage_commands(folder: Path = STAGES) -> dict[str, TyperCommand]:
    """List the commands of the stages in a folder."""
    files = {file.stem.replace("_", "-"): file for file in sorted(folder.glob("[a-z]*.py"))}
    names = [*(name for name in _FIRST if name in files), *(name for name in files if name not in _FIRST)]
    return {name: StageCommand(files[name]) for name in names}


def command_of(own: Stage) -> Callable[..., None]:
    """Write the command line of a stage: its own parameters, its output, and a config where it takes one."""
    parameters = [
        each for each in inspect.signature(own.function, eval_str=True).parameters.values() if each.name != "run"
    ]

    def command(*, common: Common, output: Path | None = None, config: Path | None = None, **given: Any) -> None:
        with messages_for_errors():
            from cpfls_cli.artifacts.output import locked
            from cpfls_cli.stage import Run

            narration = Narration(own.name, common.verbose and not common.quiet)
            study = common.study(config) if config else None
            with progress_bar(own.name, common) as progress:
                run = Run(output, common.force, common.dry_run, progress, narration.reads, study, config)
                run.inputs += [config] if config else []
                with locked(output, own.name) if output and not common.dry_run else nullcontext():
                    outcome = own.run(run, **given)
            if output and not common.dry_run:
                narration.wrote(output)
            tell(outcome, common)

    keyword = inspect.Parameter.KEYWORD_ONLY
    added = {"config": ConfigArgument} if own.study else {}
    output = inspect.Parameter("output", keyword, annotation=FilledOption if own.folder else OutputOption)
    whole = [
        *(inspect.Parameter(name, keyword, annotation=hint) for name, hint in added.items()),
        *(each.replace(kind=keyword) for each in parameters),
        output.replace(default=None) if own.folder else output,
        inspect.Parameter("common", keyword, annotation=Common),
    ]
    command.__signature__ = inspect.Signature(whole)  # type: ignore[attr-defined]
    command.__annotations__ = {each.name: each.annotation for each in whole}
    command.__name__ = own.name.replace("-", "_")
    return command
