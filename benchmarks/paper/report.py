"""The report on the paper: the page of `cpfls report`, the paper's figures next to ours, and its claims one by one."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.paper.beside import replicates, with_the_paper
from benchmarks.paper.claims import EvaluationTime, PaperSources
from benchmarks.paper.replicates import Sweep
from benchmarks.paper.reproduction import reproduction_section
from benchmarks.shared.measure import program
from cpfls_cli.artifacts.output import write_text
from cpfls_cli.config.load import load_study
from cpfls_cli.files import read_content
from cpfls_cli.pages.page import Page, page_of, sections_of
from cpfls_cli.report.source import source_of_result, unique_labels
from cpfls_cli.stages.report import read_sources
from cpfls_cli.store import format_name, read
from cpfls_cli.version import __version__

_BEFORE = ("summary", "comparison", "identify")
"""How the names of sections begin that come before the reproduction."""


def paper_page(config: Path, artifacts: Sequence[Path], times: Sequence[EvaluationTime] = ()) -> Page:
    """Write a report on the paper; times are measured, for no artifact holds one."""
    study = load_study(config)
    searched = [path for path in artifacts if format_name(path) == Sweep.FORMAT]
    others = [path for path in artifacts if path not in searched]
    given = read_sources(others, [read_content(path).sha256 for path in others])
    sweeps = [
        source_of_result(*read(path, Sweep), path, label, read_content(path).sha256)
        for path, label in zip(searched, unique_labels(searched), strict=True)
    ]
    sources = PaperSources(given, study.vehicle, study.report, times, sweeps)
    sections = sections_of(sources)
    place = sum(section.name.startswith(_BEFORE) for section in sections)
    ordered = [*sections[:place], reproduction_section(sources), *sections[place:]]
    shown = [with_the_paper(section, sources) for section in ordered]
    last = next((at for at, section in enumerate(shown) if section.name == "provenance"), len(shown))
    page = [*shown[:last], *replicates(sources), *shown[last:]]
    return page_of(replace(sources, all=[*given, *sweeps]), page, __version__)


def main(
    config: Path,
    artifacts: list[Path],
    output: Annotated[Path, typer.Option("--output", "-o")],
    times: Path | None = None,
) -> None:
    measured = json.loads(times.read_text(encoding="utf-8")) if times else []
    page = paper_page(config, artifacts, [EvaluationTime(**row) for row in measured])
    write_text(output, page.text)
    print(f"{len(page.sections)} sections, {len(page.figures)} figures, {len(page.tables)} tables")


if __name__ == "__main__":
    program(main)
