"""`info --format`: the datasets of a format, as in the reference of the site; no file is read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cpfls_cli.artifacts.formats import records
from cpfls_cli.artifacts.spec import DatasetSpec, Format
from cpfls_cli.errors import InputError
from cpfls_cli.report.content import Block, Facts, Table, Text
from cpfls_cli.report.outcome import Outcome
from cpfls_cli.result import datasets
from cpfls_cli.stage import Stage, loaded
from cpfls_cli.words import did_you_mean

_COLUMNS = ("Dataset", "Dimensions", "Unit", "Frame", "Required", "What it holds")


def run(name: str | None) -> Outcome:
    """Describe the formats of a name, such as ``flight`` or ``cpfls/flight``; without a name, list all."""
    every = formats()
    if name is None:
        rows = [(_short(each), each.description) for each in every]
        listed = [_head(each) for each in every]
        return Outcome({"formats": listed}, (Facts(rows),), next=(("cpfls", "info", "--format", rows[0][0]),))
    chosen = [each for each in every if name.removeprefix("cpfls/") in (_short(each), each.name.removeprefix("cpfls/"))]
    if not chosen:
        known = list(dict.fromkeys(_short(each) for each in every))
        hint = did_you_mean(name.removeprefix("cpfls/"), known, "", most=3)
        raise InputError(f"--format {name}: no such format{f' ({hint})' if hint else ''}; there are {', '.join(known)}")
    described = [_head(each) | {"datasets": {own.path: _entry(own) for own in each.datasets}} for each in chosen]
    return Outcome({"formats": described}, tuple(block for each in chosen for block in _blocks(each)))


def formats() -> list[Format]:
    """List every format of a file: those of records, in the order of the pipeline, then those of stages."""
    files = sorted((Path(__file__).parents[1] / "stages").glob("[a-z]*.py"))
    stages = [loaded(file.stem) for file in files]
    # What fills a folder with results of other stages has none of its own.
    return [own.spec() for own in records()] + [_of_stage(own) for own in stages if hasattr(own.kind, "FORMAT")]


def rows(described: Format) -> list[list[str]]:
    """List the datasets of a format as the rows of a table, in the columns of `_COLUMNS`."""
    return [
        [
            own.path,
            " x ".join(own.dimensions) or "scalar",
            own.units,
            own.frame,
            "yes" if own.required else "no",
            own.description + ("; may be not finite" if own.gaps else ""),
        ]
        for own in described.datasets
    ]


def origin(described: Format) -> str:
    """Say which commands write a format, and of which inputs."""
    inputs = ", ".join(f"`/inputs/{role}`" for role in described.inputs)
    return f"Made by {described.makers}: {described.description}.{f' Inputs: {inputs}.' if inputs else ''}"


def _of_stage(own: Stage) -> Format:
    """Describe the result of a stage as a format."""
    specs = (
        DatasetSpec(
            path,
            each.about.axes,
            "text" if each.scalar is str else each.about.unit,
            each.about.frame,
            each.about.text,
            each.required,
            each.about.gaps,
        )
        for path, each in datasets(own.kind)
        if each.about
    )
    first = str(own.kind.__doc__).split("\n", 1)[0].rstrip(".")
    return Format(own.kind.FORMAT, first[0].lower() + first[1:], own.name, datasets=tuple(specs))


def _short(described: Format) -> str:
    name = described.name.removeprefix("cpfls/")
    return f"{described.kind}-{name}" if described.kind else name


def _head(described: Format) -> dict[str, Any]:
    return {
        "format": described.name,
        "kind": described.kind,
        "description": described.description,
        "commands": [command.strip() for command in described.made_by.split(",")],
        "inputs": list(described.inputs),
    }


def _entry(own: DatasetSpec) -> dict[str, Any]:
    return {
        "dimensions": list(own.dimensions),
        "units": own.units,
        "frame": own.frame,
        "required": own.required,
        "gaps": own.gaps,
        "description": own.description,
    }


def _blocks(described: Format) -> list[Block]:
    every = frozenset(range(len(_COLUMNS)))
    kind = f", kind {described.kind}" if described.kind else ""
    title = Text(f"{described.name}{kind}. {origin(described).replace('`', '')}")
    return [title, Table(f"format-{_short(described)}", "", _COLUMNS, rows(described), every, frozenset({5}))]
