"""Commands that make the artifacts of a report again."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from cpfls_cli.artifacts.formats import (
    DIAGNOSIS,
    DISAGREEMENT,
    EXTENDED,
    FLIGHT,
    MODEL,
    PREDICTION,
    SELECTION,
    SWEEP,
    TRAJECTORY,
)
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.content import HASH_SHOWN


@dataclass(frozen=True)
class _Command:
    """How a stage is called: its name, the roles that are arguments, and those that are options."""

    name: str
    arguments: tuple[str, ...]
    options: tuple[str, ...] = ()


_COMMANDS = {
    TRAJECTORY.format: _Command("trajectory", (), ("waypoints",)),
    FLIGHT.format: _Command("simulate", ("trajectory",), ("model",)),
    SELECTION.format: _Command("reduce", ("flight",)),
    MODEL.format: _Command("identify", ("flight",), ("selection", "validate", "choose-on")),
    SWEEP.format: _Command("sweep", ("flight",), ("validate", "choose-on")),
    PREDICTION.format: _Command("predict", ("model", "flight")),
    DISAGREEMENT.format: _Command("compare", ("flight",), ("model",)),
    DIAGNOSIS.format: _Command("diagnose", ("disagreement",), ("held-out",)),
    EXTENDED.format: _Command("extend", ("diagnosis",), ("model",)),
}
_IMPORT = _Command("import", ("log",))


def config_name(source: Source) -> str:
    """Name the file that the config of an artifact is saved as."""
    return f"study-{source.config_sha256[:HASH_SHOWN]}.yaml"


def commands(sources: Sources) -> str:
    """Write the commands that make all artifacts of a report again, in an order that works.

    An artifact holds the names of its inputs, so that equal bytes need equal names.

    Returns
    -------
    str
        Lines for a shell; what cannot be known is said in comments.
    """
    paths = _paths(sources)
    foreign = [f"# needs {shlex.quote(file.name)}, sha256 {file.sha256}" for file in _foreign(sources)]
    folders = sorted({path.rsplit("/", 1)[0] for path in paths.values() if "/" in path})
    lines = [line for source in _in_order(sources.all) for line in _lines(source, paths)]
    return "\n".join([*foreign, *(f"mkdir -p {folder}" for folder in folders), *lines])


def _paths(sources: Sources) -> dict[str, str]:
    """Name every artifact as those that were made from it call it; equal names go into folders of their own."""
    called = {file.sha256: file.name for source in sources.all for file in source.artifact.header.inputs.values()}
    own = {source.sha256: source.label.removesuffix(f" ({source.short_hash})") for source in sources.all}
    names = {sha256: called.get(sha256, name) for sha256, name in own.items()}
    count = Counter(names.values())
    return {sha256: name if count[name] == 1 else f"{sha256[:HASH_SHOWN]}/{name}" for sha256, name in names.items()}


def _foreign(sources: Sources) -> list[InputFile]:
    files = {file.sha256: file for source in sources.all for file in source.artifact.header.inputs.values()}
    return [file for sha256, file in files.items() if sources.by_hash(sha256) is None]


def _in_order(given: Sequence[Source]) -> Iterator[Source]:
    """Put every artifact behind those that it was made from."""
    left = list(given)
    while left:
        waiting = {source.sha256 for source in left}
        inputs = {source.sha256: {file.sha256 for file in source.artifact.header.inputs.values()} for source in left}
        ready = next((source for source in left if not inputs[source.sha256] & waiting), left[0])
        left.remove(ready)
        yield ready


def _lines(source: Source, paths: dict[str, str]) -> Iterator[str]:
    inputs = source.artifact.header.inputs
    command = _IMPORT if "log" in inputs else _COMMANDS.get(source.artifact.spec.format)
    output = shlex.quote(paths[source.sha256])
    if command is None:
        yield f"# {output}: no command is known that makes it"
        return
    if source.artifact.spec == MODEL and not source.record.complete:
        yield f"# the search for {output} was stopped before its end; this one goes on to it"
    words = ["cpfls", command.name, config_name(source)]
    for role in command.arguments:
        words += _files(inputs, role, paths)
    for role in command.options:
        for file in _files(inputs, role, paths):
            words += [f"--{role}", file]
    yield " ".join([*words, "-o", output])


def _files(inputs: Mapping[str, InputFile], role: str, paths: dict[str, str]) -> list[str]:
    """Find the files of a role, which are numbered where there are several."""
    own = {name: file for name, file in inputs.items() if name == role or _numbered(name, role)}
    order = sorted(own, key=lambda name: int(name.removeprefix(role).strip("-") or 1))
    return [shlex.quote(paths.get(own[name].sha256, own[name].name)) for name in order]


def _numbered(name: str, role: str) -> bool:
    return name.startswith(f"{role}-") and name.removeprefix(f"{role}-").isdigit()
