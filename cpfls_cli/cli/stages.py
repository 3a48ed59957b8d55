"""The program: commands of stages, listed by their sources; their modules load when a command is typed."""

from __future__ import annotations

import ast
import copy
import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import cached_property, partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from cpfls_cli.arguments import FolderOption
from cpfls_cli.cli.interrupts import deferred_interrupts
from cpfls_cli.cli.options import (
    Commands,
    Common,
    ConfigArgument,
    OutputOption,
    check_order,
    common_options,
    is_argument,
    refuse_overrides,
    repeated,
    sheet,
)
from cpfls_cli.cli.terminal import Narration, messages_for_errors, progress_bar, tell
from cpfls_cli.errors import ComputationError
from cpfls_cli.version import __version__

if TYPE_CHECKING:
    from cpfls_cli.artifacts.job import Job, Progress
    from cpfls_cli.stage import Run, Stage


@dataclass(frozen=True)
class CommandLine:
    """What the command line of a stage is made of: parameters of its function but for the run, the rest as of `Stage`.

    `output` is the option of its output where it has one of its own.
    """

    parameters: list[inspect.Parameter]
    study: bool
    folder: bool
    fills: bool
    several: bool
    output: Any


def command_line(file: Path) -> CommandLine:
    """Read the command line of a stage: its signature, and of its module only what that needs."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    function, decorator = next(
        (node, own)
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
        for own in node.decorator_list
        if isinstance(own, ast.Call) and getattr(own.func, "id", "") == "stage"
    )
    given = {own.arg: own.value for own in decorator.keywords if own.arg}
    output = given.get("output", ast.Constant(None))
    # Without its body and its decorator, which need everything else.
    bare = copy.deepcopy(function)
    bare.body, bare.decorator_list, bare.returns = [ast.Pass()], [], None
    asked = ast.Assign([ast.Name("output", ast.Store())], output)
    # What only the types of the run and the result name is not loaded.
    annotations = [own.annotation for own in _arguments(bare) if own.arg != "run" and own.annotation]
    values = [*bare.args.defaults, *(each for each in bare.args.kw_defaults if each), output]
    for own in _arguments(bare):
        own.annotation = None if own.arg == "run" else own.annotation
    needed = _needed(tree, {name for node in (*annotations, *values) for name in _names(node)})
    module = ast.fix_missing_locations(ast.Module([*needed, asked, bare], []))
    known: dict[str, Any] = {"__name__": f"cpfls_cli.stages.{file.stem}"}
    exec(compile(module, str(file), "exec", dont_inherit=True), known)
    parameters = inspect.signature(known[function.name], eval_str=True).parameters.values()
    return CommandLine(
        [each for each in parameters if each.name != "run"],
        study=_true(given, "study"),
        folder=_true(given, "folder"),
        fills=_true(given, "fills"),
        several=_true(given, "several"),
        output=known["output"],
    )


def _true(given: Mapping[str, ast.expr], name: str) -> bool:
    value = given.get(name)
    return value is not None and not (isinstance(value, ast.Constant) and not value.value)


def _arguments(function: ast.FunctionDef) -> list[ast.arg]:
    return [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]


def _names(node: ast.AST) -> set[str]:
    return {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}


def _needed(tree: ast.Module, names: set[str]) -> list[ast.stmt]:
    """Take the statements of a module that make names, and what these need, in their order."""
    made: dict[int, ast.stmt] = {}
    open_names, seen = set(names), set[str]()
    while open_names:
        name = open_names.pop()
        seen.add(name)
        for index, node in enumerate(tree.body):
            if isinstance(node, ast.Import | ast.ImportFrom):
                aliases = [own for own in node.names if (own.asname or own.name.partition(".")[0]) == name]
                kept = getattr(made.get(index), "names", [])
                if aliases and isinstance(node, ast.ImportFrom):
                    made[index] = ast.ImportFrom(node.module, [*kept, *aliases], node.level)
                elif aliases:
                    made[index] = ast.Import([*kept, *aliases])
            elif name in _defined(node):
                made[index] = node
                open_names |= _names(node) - seen
    return [made[index] for index in sorted(made)]


def _defined(node: ast.stmt) -> Iterator[str]:
    if isinstance(node, ast.ClassDef | ast.FunctionDef):
        yield node.name
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    yield from (target.id for target in targets if isinstance(target, ast.Name))


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

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Repeat options that take all values that follow."""
        return super().parse_args(ctx, repeated(self.params, args) if self._line.several else args)

    @cached_property
    def _loaded(self) -> TyperCommand:
        app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
        assert self.name is not None, "a command has a name"
        app.command(self.name)(
            command_of(self.name, self._line, lambda: import_module("cpfls_cli.stage").loaded(self._file.stem))
        )
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
    with nullcontext(lambda *_, **__: None) if own.output is False else progress_bar(own.name, common) as progress:
        run = run_of(own, common, output, config, narration.reads, progress)
        with locked(run.output, own.name) if run.writes and not run.dry_run else nullcontext(), noted(run):
            outcome = own.run(run, **given)
    if output and not common.dry_run:
        narration.wrote(output)
    tell(outcome, common)


class AllCommands(Commands):
    """The commands of all stages."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given | {"commands": stage_commands()})


app = typer.Typer(
    name="cpfls",
    cls=AllCommands,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    # Lines behind a backspace stay as they are.
    help=f"From flight logs: what a model of a multirotor misses, and how far to trust it.\n\n\b\n{sheet()}",
)


def _version(asked: bool) -> None:
    if asked:
        with messages_for_errors():
            print(f"cpfls {__version__}", flush=True)
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Take the options that stand before a command."""
