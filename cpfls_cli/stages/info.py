"""Show what the command that wrote an artifact answered, what it holds and where it comes from.

Without FILE, list all formats, or describe one.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from cpfls_cli import store
from cpfls_cli.errors import InputError
from cpfls_cli.report.source import source_of_result
from cpfls_cli.result import datasets, plain
from cpfls_cli.stage import Run, Stage, loaded, stage, stage_that_made
from cpfls_cli.words import did_you_mean

_NOTHING: dict[str, Any] = {"file": None, "listed": (), "described": None}
_LONG = "too long to be shown: its values are in the file"

FileArgument = Annotated[Path | None, typer.Argument(metavar="FILE", help="Any artifact.")]
NameOption = Annotated[
    str | None, typer.Option("--format", metavar="NAME", help="Describe the datasets of a format, such as flight.")
]


def short(described: Mapping[str, Any]) -> str:
    """Give the name of a format as it is typed."""
    return str(described["format"]).removeprefix("cpfls/")


@stage(dict, output=False, words={"short": short})
def info(run: Run, file: FileArgument = None, name: NameOption = None) -> dict[str, Any]:
    """Show a file, or formats."""
    if file and name is not None:
        raise InputError("--format describes files of a format in general: leave out FILE or --format")
    if file is None:
        return _formats(run, name)
    own = stage_that_made(file)
    long = store.is_long(file, own.kind)
    if long:
        store.check_rows(file, own.kind, store.held_rows(file, own.kind))
    given, origin = store.examine(file, own.kind, 2)[:2] if long else store.read(file, own.kind)
    source = source_of_result(given, origin, file, file.name, "")
    held = {
        "file": str(file),
        "format": own.kind.FORMAT,
        "cpfls_version": origin.version,
        "seed": origin.seed,
        "inputs": {role: vars(each) for role, each in origin.inputs.items()},
        "cautions": origin.cautions,
    }
    run.also = held | ({} if long else {"result": plain(given)})
    run.next.append(("cpfls", "check", file))
    answer = _LONG if long else own.text(given, about=source)
    return _NOTHING | {"file": held | {"answer": answer, "datasets": _datasets(own)}}


def _formats(run: Run, name: str | None) -> dict[str, Any]:
    """Describe the format of a name, such as ``flight`` or ``cpfls/flight``; without a name, list all."""
    every = tuple(map(described, formats()))
    if name is None:
        run.also = {"formats": [{name: each[name] for name in ("format", "description", "commands")} for each in every]}
        run.next.append(("cpfls", "info", "--format", short(every[0])))
        return _NOTHING | {"listed": every}
    known = {short(each): each for each in every}
    chosen = known.get(asked := name.removeprefix("cpfls/"))
    if chosen is None:
        hint = did_you_mean(asked, list(known), "", most=3)
        raise InputError(f"--format {name}: no such format{f' ({hint})' if hint else ''}; there are {', '.join(known)}")
    run.also = {"formats": [chosen]}
    return _NOTHING | {"described": chosen}


def formats() -> list[Stage]:
    """List the stages whose results have a format of their own, one for each format.

    What only answers has none, nor what fills a folder with results of other stages.
    """
    files = (file for file in sorted(Path(__file__).parent.glob("*.py")) if "\n@stage(" in file.read_text("utf-8"))
    stages = {str(own.kind.FORMAT): own for file in files if hasattr((own := loaded(file.stem)).kind, "FORMAT")}
    return [stages[name] for name in sorted(stages)]


def described(own: Stage) -> dict[str, Any]:
    """Describe the format of a stage."""
    first = str(own.kind.__doc__).split("\n", 1)[0].rstrip(".")
    return {
        "format": own.kind.FORMAT,
        "description": first[0].lower() + first[1:],
        "commands": str(getattr(own.kind, "MADE_BY", own.name)).split(" or "),
        "datasets": _datasets(own),
    }


def _datasets(own: Stage) -> dict[str, Any]:
    return {
        path: {
            "dimensions": each.about.axes,
            "units": "text" if each.scalar is str else each.about.unit,
            "frame": each.about.frame,
            "required": each.required,
            "gaps": each.about.gaps,
            "description": each.about.text,
        }
        for path, each in datasets(own.kind)
        if each.about
    }
