"""`info --format`: the datasets of a format, as in the reference of the site; no file is read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cpfls_cli.errors import InputError
from cpfls_cli.report.content import Block, Facts, Table, Text
from cpfls_cli.report.outcome import Outcome
from cpfls_cli.result import datasets
from cpfls_cli.stage import Stage, loaded
from cpfls_cli.words import did_you_mean

_COLUMNS = ("Dataset", "Dimensions", "Unit", "Frame", "Required", "What it holds")


def run(name: str | None) -> Outcome:
    """Describe the format of a name, such as ``flight`` or ``cpfls/flight``; without a name, list all."""
    every = {short(own): own for own in formats()}
    if name is None:
        rows = [(own, description(each)) for own, each in every.items()]
        listed = [_head(each) for each in every.values()]
        return Outcome({"formats": listed}, (Facts(rows),), next=(("cpfls", "info", "--format", rows[0][0]),))
    asked = name.removeprefix("cpfls/")
    if asked not in every:
        hint = did_you_mean(asked, list(every), "", most=3)
        raise InputError(f"--format {name}: no such format{f' ({hint})' if hint else ''}; there are {', '.join(every)}")
    chosen = every[asked]
    described = [_head(chosen) | {"datasets": dict(_entries(chosen))}]
    return Outcome({"formats": described}, tuple(_blocks(chosen)))


def formats() -> list[Stage]:
    """List the stages whose results have a format of their own; what fills a folder with those of others has none."""
    files = sorted((Path(__file__).parents[1] / "stages").glob("*.py"))
    stages = [loaded(file.stem) for file in files if "@stage(" in file.read_text(encoding="utf-8")]
    return sorted((own for own in stages if hasattr(own.kind, "FORMAT")), key=short)


def rows(own: Stage) -> list[list[str]]:
    """List the datasets of a format as the rows of a table, in the columns of `_COLUMNS`."""
    return [
        [
            path,
            " x ".join(each["dimensions"]) or "scalar",
            each["units"],
            each["frame"],
            "yes" if each["required"] else "no",
            each["description"] + ("; may be not finite" if each["gaps"] else ""),
        ]
        for path, each in _entries(own)
    ]


def origin(own: Stage) -> str:
    """Say which command writes a format."""
    return f"Made by `cpfls {_maker(own)}`: {description(own)}."


def short(own: Stage) -> str:
    """Name a format without what all begin with."""
    return str(own.kind.FORMAT).removeprefix("cpfls/")


def description(own: Stage) -> str:
    """Say what a format holds."""
    first = str(own.kind.__doc__).split("\n", 1)[0].rstrip(".")
    return first[0].lower() + first[1:]


def _maker(own: Stage) -> str:
    return str(getattr(own.kind, "MADE_BY", own.name))


def _head(own: Stage) -> dict[str, Any]:
    return {"format": own.kind.FORMAT, "description": description(own), "commands": [_maker(own)]}


def _entries(own: Stage) -> list[tuple[str, dict[str, Any]]]:
    return [
        (
            path,
            {
                "dimensions": list(each.about.axes),
                "units": "text" if each.scalar is str else each.about.unit,
                "frame": each.about.frame,
                "required": each.required,
                "gaps": each.about.gaps,
                "description": each.about.text,
            },
        )
        for path, each in datasets(own.kind)
        if each.about
    ]


def _blocks(own: Stage) -> list[Block]:
    every = frozenset(range(len(_COLUMNS)))
    title = Text(f"{own.kind.FORMAT}. {origin(own).replace('`', '')}")
    return [title, Table(f"format-{short(own)}", "", _COLUMNS, rows(own), every, frozenset({5}))]
