"""Where everything comes from."""

from __future__ import annotations

from cpfls_cli.pages.repeat import commands, config_name
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.content import Block, Listing, Section, Table, Text

_REPEAT = (
    "To make these artifacts again, save each config below, as it is, under the name that stands before it, and run "
    "these commands in the same folder. With the same versions of cpfls and of the libraries under it every file comes "
    "out equal, byte for byte."
)


def provenance_section(sources: Sources) -> Section:
    """List the artifacts with their hashes, inputs and configs."""
    blocks: list[Block] = [
        Table(
            "artifacts",
            "The artifacts of this report, by the SHA-256 of the file.",
            ("File", "Format", "cpfls", "Seed", "SHA-256 of the file", "SHA-256 of the config"),
            [_artifact(source) for source in sources.all],
            frozenset({0, 1, 2, 4, 5}),
            frozenset({4, 5}),
        )
    ]
    inputs = [row for source in sources.all for row in _inputs(source, sources)]
    if inputs:
        header = ("File", "Role", "Made from", "Format", "SHA-256", "In this report")
        caption = "The files that they were made from."
        blocks.append(Table("inputs", caption, header, inputs, frozenset(range(6)), frozenset({2, 4})))
    blocks.append(Text(_REPEAT))
    blocks.append(Listing("Commands to repeat", commands(sources), shown=True))
    for config in dict.fromkeys(source.artifact.header.config for source in sources.all):
        users = [source for source in sources.all if source.artifact.header.config == config]
        names = ", ".join(source.label for source in users)
        blocks.append(Listing(f"{config_name(users[0])}: config of {names}", config))
    return Section("provenance", "Provenance", blocks)


def _artifact(source: Source) -> list[str]:
    header = source.artifact.header
    name = source.artifact.spec.format
    return [source.label, name, header.version, str(header.seed), source.sha256, source.config_sha256]


def _inputs(source: Source, sources: Sources) -> list[list[str]]:
    return [
        [source.label, role, file.name, file.format, file.sha256, "yes" if sources.by_hash(file.sha256) else "no"]
        for role, file in source.artifact.header.inputs.items()
    ]
