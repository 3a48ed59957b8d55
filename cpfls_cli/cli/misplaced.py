"""Files in the place of others: what a file is, and the command that was meant."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from cpfls_cli.errors import ConfigError, InputError
from cpfls_cli.files import is_hdf5
from cpfls_cli.logs.formats import foreign_file, is_log

_CONFIGS = (".yaml", ".yml")

Kind = Literal["log", "artifact", "config"]


def _kind(path: Path) -> Kind | None:
    """Tell what a file is: by what it holds, then by its name."""
    if not path.is_file():
        return None
    if _format(path) is not None:
        return "artifact"
    if is_log(path):
        return "log"
    return "config" if path.suffix.lower() in _CONFIGS else None


def _format(path: Path) -> str | None:
    """Tell the format of an artifact; None for any other file, which is not opened as one."""
    if not is_hdf5(path):
        return None
    from cpfls_cli.artifacts.gate import format_name

    return format_name(path)


def refuse_misplaced_log(path: Path, order: str = "first the config, then the log") -> None:
    """Refuse an artifact or a config in the place of a log."""
    kind = _kind(path)
    if kind == "artifact":
        raise InputError(f"{path}: is a {_format(path)}, not a log: it needs no import; `cpfls info {path}` shows it")
    if kind == "config":
        raise InputError(f"{path}: is a config, not a log; {order}")


def refuse_misplaced_config(command: str, given: Sequence[Path], output: Path | None) -> None:
    """Refuse a log or an artifact in the place of the config, and give the command with the two exchanged.

    `given` are its arguments, the config first.
    """
    kind = _kind(given[0])
    if command == "gap" and kind == "artifact" and _format(given[0]) == "cpfls/vehicle":
        return
    if kind not in ("log", "artifact"):
        if kind is None and command != "gap" and given[0].is_file():
            _refuse_simulator_file(given[0])
        return
    what = "a log" if kind == "log" else f"a {_format(given[0])}"
    config = next((path for path in given if _kind(path) == "config"), None)
    if config is not None:
        exchanged = [config, *(given[0] if path == config else path for path in given[1:])]
        words = ["cpfls", command, *map(str, exchanged), *([] if output is None else ["-o", str(output)])]
        raise ConfigError(f"{given[0]}: is {what}, and the config comes first: {shlex.join(words)}")
    made = f"`cpfls init {shlex.quote(str(given[0]))} -o study.yaml` writes one for it, and " if kind == "log" else ""
    raise ConfigError(f"{given[0]}: is {what}, not a config (YAML); {made}`cpfls config` prints a commented default")


def _refuse_simulator_file(path: Path) -> None:
    from cpfls_cli.simulators.formats import is_simulator_file

    if is_simulator_file(path):
        made = shlex.join(["cpfls", "init", "--from", str(path), "-o", "study.yaml"])
        raise ConfigError(f"{path}: is a simulator's file, not a config (YAML); `{made}` writes one of it")


def what_it_is(path: Path) -> str | None:
    """Say of a file in the place of an artifact what it is and what to do with it; None where that is not known."""
    kind = _kind(path)
    if kind == "log":
        flight = path.name.partition(".")[0] + ("-flight.h5" if path.suffix == ".h5" else ".h5")
        words = ["cpfls", "import", "CONFIG", str(path), "-o", flight]
        return f"{path}: is a log, and this takes what cpfls made: {shlex.join(words)}"
    if kind == "config":
        shows = shlex.join(["cpfls", "config", str(path)])
        return f"{path}: is a config, and this takes what cpfls made; `{shows}` shows it"
    foreign = foreign_file(path) if kind is None and path.is_file() else None
    return None if foreign is None else f"{path}: {foreign}"
