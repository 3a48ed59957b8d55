"""Options that every command takes, declared once, durations as values, and files in the place of others."""

from __future__ import annotations

import copy
import difflib
import functools
import inspect
import re
import shlex
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_type_hints

import typer
from typer.core import TyperGroup
from typer.models import ArgumentInfo

from cpfls_cli.errors import ConfigError, InputError
from cpfls_cli.files import is_hdf5
from cpfls_cli.logs.formats import foreign_file, is_log

if TYPE_CHECKING:
    from cpfls_cli.config.study import Study


ConfigArgument = Annotated[Path, typer.Argument(metavar="CONFIG", help="Study config (YAML).", show_default=False)]
OutputOption = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE", help="File to write.", show_default=False)
]


@dataclass(frozen=True)
class Common:
    """Values of the options that every command takes."""

    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="SECTION.KEY=VALUE", help="Override a key of the config; may be repeated."),
    ] = None
    seed: Annotated[int | None, typer.Option("--seed", metavar="N", min=0, help="Override the seed of the config.")] = (
        None
    )
    force: Annotated[bool, typer.Option("--force", help="Replace an existing output.")] = False
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False
    verbose: Annotated[
        bool,
        typer.Option("--verbose", "-v", help="Show the whole answer, what is read and written, and how long it took."),
    ] = False
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Check config, inputs and output; compute and write nothing.")
    ] = False

    accept_guesses: Annotated[
        bool,
        typer.Option(
            "--accept-guesses",
            help="Take guesses from mass and arms for what the config leaves open; the answer says how far it depends "
            "on them.",
        ),
    ] = False
    numbers: Annotated[
        Path | None,
        typer.Option(
            "--model", metavar="VEHICLE", help="Take what the config leaves open from this vehicle of `cpfls vehicle`."
        ),
    ] = None

    def study(self, config: Path) -> Study:
        """Load a study with the overrides given on the command line."""
        from cpfls_cli.config.load import load_study

        return load_study(config, self.overrides or (), self.seed)

    def data(self, config: Path) -> dict[str, Any]:
        """Read a config as plain data, with the overrides given on the command line."""
        from cpfls_cli.config.load import read_overridden

        return read_overridden(config, self.overrides or (), self.seed)


class Commands(TyperGroup):
    """The commands, with messages on values of options that name the value, and the nearest one where there are few."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            error.message = _in_own_words(error)
            raise


def repeated(params: Sequence[Any], args: Sequence[str]) -> list[str]:
    """Repeat options that may be given several times before each of the values that follow."""
    several = {name for own in params if getattr(own, "multiple", False) for name in own.opts} - {"--set"}
    given: list[str] = []
    option = ""
    for index, word in enumerate(args):
        if word.startswith("-"):
            option = word if word in several else ""
        elif option and args[index - 1] != option:
            given.append(option)
        given.append(word)
    return given


def _in_own_words(error: typer.BadParameter) -> str:
    message = error.message.removeprefix("Value error, ").removesuffix(".")
    details: list[dict[str, Any]] = getattr(error.__cause__, "errors", list)()
    value = details[0]["input"] if details else None
    if isinstance(value, str) and not message.startswith(repr(value)):
        return f"{value!r}: {message[:1].lower()}{message[1:]}"
    _, among, choices = message.partition(" is not one of ")
    near = difflib.get_close_matches(str(value), re.findall(r"'([^']*)'", choices), n=1, cutoff=0.5) if among else []
    return f"{message} (did you mean {near[0]!r}?)" if near else message


@functools.cache
def _common_hints() -> dict[str, Any]:
    return get_type_hints(Common, include_extras=True)


def is_argument(hint: Any) -> bool:
    """Tell an argument from an option by its annotation."""
    return any(isinstance(each, ArgumentInfo) for each in get_args(hint))


def common_options(command: str, hints: Mapping[str, Any]) -> list[inspect.Parameter]:
    """Give the common options of a command as parameters; `hints` are the annotations of its own."""
    left_out, unheard = _left_out(command, hints), () if "config" in hints else _OF_A_CONFIG
    known = ((f, _common_hints()[f.name]) for f in fields(Common) if f.name not in left_out)
    return [
        inspect.Parameter(
            f.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=f.default,
            annotation=_hidden(hint) if f.name in unheard else hint,
        )
        for f, hint in known
    ]


_OF_A_CONFIG = ("overrides", "seed")
"""Options that a command without a config refuses with a word of its own, and does not offer."""


def _hidden(hint: Any) -> Any:
    """Leave an option out of the help of a command."""
    kind, option = get_args(hint)
    option = copy.copy(option)
    option.hidden = True
    return Annotated[kind, option]


_OF_NUMBERS = ("accept_guesses", "numbers")
_WITHOUT_VEHICLE = ("vehicle", "report", "config")
"""Commands that read a config and do with guesses, or need no vehicle."""


def _left_out(command: str, hints: Mapping[str, Any]) -> tuple[str, ...]:
    """List the options that a command has no use for, being those on numbers, or has as an option of its own."""
    if "config" not in hints or command in _WITHOUT_VEHICLE:
        return (*_OF_NUMBERS, "seed") if "seed" in hints else _OF_NUMBERS
    own = "model" in hints and not is_argument(hints["model"])
    return ("numbers",) if own else ()


def refuse_overrides(common: Common, *, given: bool = True) -> None:
    """Refuse what overrides a config where none is read, or where the one that could be is not given."""
    from cpfls_cli.cli.terminal import messages_for_errors

    overrides = {"--set": next(iter(common.overrides or ()), None), "--seed": common.seed}
    with messages_for_errors():
        for option, value in overrides.items():
            if value is not None:
                why = f"this command reads no config; leave {option} out" if given else "needs a CONFIG"
                raise InputError(f"{option} {value}: {why}")


def check_order(command: str, arguments: Mapping[str, Any], output: Path | None) -> None:
    """Refuse a file in the place of another: of the config, of a model before flights, of a log."""
    from cpfls_cli.cli.terminal import messages_for_errors

    given = [path for value in arguments.values() for path in (value if isinstance(value, list) else [value]) if path]
    logs = arguments.get("logs") or [path for path in (arguments.get("log"),) if path]
    with messages_for_errors():
        # Of a log alone gains are found too.
        if arguments.get("config") is not None and not (command == "tune" and len(given) == 1):
            refuse_misplaced_config(command, given, output)
            if arguments.get("model") is not None and _what(given[1]) == "a log":
                _refuse_exchanged(command, given, 1, _MODELS, "model comes before it", output)
        for path in logs:
            refuse_misplaced_log(path)


_SHEET = """\
I have one log
  cpfls look log.bbl -o look
  cpfls tune log.bbl -o gains
I have logs and want a model
  cpfls init logs/* --mass 1.2 --arm 0.16 -o study.yaml
  cpfls vehicle study.yaml logs/* --held-out today.csv -o vehicle.h5
My simulator differs from flight
  cpfls gap uav.sdf logs/* -o gap
  cpfls gap study.yaml logs/* -o gap
  cpfls simulate study.yaml today.csv --autopilot px4 -o twin.h5
  cpfls report study.yaml twin.h5 -o twin.html
Something changed
  cpfls changed study.yaml today.csv --reference logs/* -o changed
  cpfls trend study.yaml logs -o trend
I want gains
  cpfls vehicle study.yaml logs/* --held-out today.csv -o vehicle.h5
  cpfls tune study.yaml vehicle.h5 --autopilot px4 -o gains.h5
I want to plan a flight
  cpfls trajectory study.yaml --hover 30 --excite roll,pitch -o path.h5
  cpfls simulate study.yaml path.h5 --autopilot px4 -o flight.h5
I want the paper
  make quick
  make reproduce"""


def sheet(indent: str = "") -> str:
    """Write what to type for what: the first screen of ``cpfls --help`` and of README.md."""
    return textwrap.indent(_SHEET, indent)


_CONFIGS = (".yaml", ".yml")
_MODELS = ("a cpfls/extended", "a cpfls/identified", "a cpfls/vehicle")


def _what(path: Path) -> str | None:
    """Say what a file is, by what it holds, then by its name; None where that is not known."""
    if not path.is_file():
        return None
    if is_hdf5(path):
        from cpfls_cli.artifacts.gate import format_name

        if (held := format_name(path)) is not None:
            return f"a {held}"
    suffix, log = path.suffix.lower(), "a log" if is_log(path) else None
    # A simulator's frame may end in .json as a log does.
    if suffix in _CONFIGS or (log and suffix != ".json"):
        return log or "a config"
    from cpfls_cli.simulators.formats import is_simulator_file

    return "a simulator's file" if is_simulator_file(path) else log


def refuse_misplaced_log(path: Path) -> None:
    """Refuse another file in the place of a log."""
    what = _what(path)
    if what not in (None, "a log"):
        shown = f": it needs no import; `cpfls info {path}` shows it" if what.startswith("a cpfls/") else ""
        raise InputError(f"{path}: is {what}, not a log{shown}")


def refuse_misplaced_config(command: str, given: Sequence[Path], output: Path | None) -> None:
    """Refuse another file in the place of the config, and give the command with the two exchanged.

    `given` are its arguments, the config first.
    """
    what, wanted = _what(given[0]), ["a config"]
    if command == "gap":
        wanted += ["a simulator's file", "a cpfls/vehicle"]
    if what in (None, *wanted):
        return
    _refuse_exchanged(command, given, 0, wanted, "config comes first", output)
    name, made = shlex.quote(str(given[0])), "`cpfls config` prints a commented default"
    if what == "a simulator's file":
        made = f"`cpfls init --from {name} -o study.yaml` writes one of it"
    elif what == "a log":
        made = f"`cpfls init {name} -o study.yaml` writes one for it, and {made}"
    raise ConfigError(f"{given[0]}: is {what}, not a config (YAML); {made}")


def _refuse_exchanged(
    command: str, given: Sequence[Path], place: int, wanted: Sequence[str], why: str, output: Path | None
) -> None:
    """Refuse a file where one that comes later belongs, and give the command with the two exchanged."""
    for other, path in enumerate(given[place + 1 :], place + 1):
        if _what(path) in wanted:
            paths = [*given[:place], path, *given[place + 1 : other], given[place], *given[other + 1 :]]
            words = ["cpfls", command, *map(str, paths), *([] if output is None else ["-o", str(output)])]
            raise ConfigError(f"{given[place]}: is {_what(given[place])}, and the {why}: {shlex.join(words)}")


def what_it_is(path: Path) -> str | None:
    """Say of a file in the place of an artifact what it is and what to do with it; None where that is not known."""
    what = _what(path)
    if what == "a log":
        flight = path.name.partition(".")[0] + ("-flight.h5" if path.suffix == ".h5" else ".h5")
        words = ["cpfls", "import", "CONFIG", str(path), "-o", flight]
        return f"{path}: is a log, and this takes what cpfls made: {shlex.join(words)}"
    if what in ("a config", "a simulator's file"):
        shows = f"; `{shlex.join(['cpfls', 'config', str(path)])}` shows it" if what == "a config" else ""
        return f"{path}: is {what}, and this takes what cpfls made{shows}"
    foreign = foreign_file(path) if what is None and path.is_file() else None
    return foreign and f"{path}: {foreign}"
