"""The report on the paper: the page of `cpfls report`, the paper's figures beside ours, and its claims one by one."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.paper.beside import with_the_paper
from benchmarks.paper.claims import EvaluationTime, PaperSources, compares_readings
from benchmarks.paper.reproduction import reproduction_section
from benchmarks.shared.measure import program
from cpfls_cli.artifacts.output import write_text
from cpfls_cli.config.load import load_study
from cpfls_cli.files import read_content
from cpfls_cli.pages.page import Page, page_of, sections_of
from cpfls_cli.report.content import Section
from cpfls_cli.stages.report import read_sources
from cpfls_cli.version import __version__

_BEFORE = ("summary", "comparison", "identify")
"""How the names of sections begin that come before the reproduction."""


def paper_page(config: Path, artifacts: Sequence[Path], times: Sequence[EvaluationTime] = ()) -> Page:
    """Write a report on the paper; times are measured, for no artifact holds one."""
    study = load_study(config)
    given = read_sources(artifacts, [read_content(path).sha256 for path in artifacts])
    sources = PaperSources(given, study.vehicle, study.report, times)
    sections = [_without_readings(section, sources) for section in sections_of(sources)]
    place = sum(section.name.startswith(_BEFORE) for section in sections if section)
    ordered = [*sections[:place], reproduction_section(sources), *sections[place:]]
    return page_of(sources, [with_the_paper(section, sources) for section in ordered if section], __version__)


def _without_readings(section: Section, sources: PaperSources) -> Section | None:
    """Leave out of the replicates the sweeps over readings of the paper, which stand beside its claims."""
    if not section.name.startswith("sweep"):
        return section
    readings = [sweep for sweep in sources.sweeps if compares_readings(sweep.record.settings)]
    others = replace(sources, all=[source for source in sources.all if source not in readings])
    return next((each for each in sections_of(others) if each.name == section.name), None)


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
