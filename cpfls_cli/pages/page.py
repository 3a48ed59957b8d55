"""The page: all sections in one file that needs nothing else."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

from cpfls_cli.pages.comparison import compared_vehicles_section, comparison_section
from cpfls_cli.pages.evidence import steps_blocks, validation_blocks
from cpfls_cli.pages.fuzzy_part import partitions_blocks, rules_blocks
from cpfls_cli.pages.identification import identification_section, search_blocks
from cpfls_cli.pages.model import model_blocks
from cpfls_cli.pages.provenance import missing, provenance_section, vehicle_section
from cpfls_cli.pages.residuals import residual_blocks
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.pages.summary import models_section, summary_section
from cpfls_cli.pages.uncertainty import uncertainty_blocks
from cpfls_cli.report.content import Block, Document, Section
from cpfls_cli.report.forms import Form
from cpfls_cli.report.html import html_page
from cpfls_cli.report.json_page import json_page
from cpfls_cli.report.markdown import markdown_page
from cpfls_cli.stage import stage_named


def _of_each(
    name: str,
    title: str,
    given: Callable[[Sources], Sequence[Source[Any]]],
    blocks: Callable[..., Iterable[Block]],
    *,
    holds: Callable[[Any], object] = lambda _: True,
    among: bool = False,
) -> Callable[[Sources], Section | None]:
    """Make a section of all artifacts of one kind, or of those that hold what it shows, each numbered from 1.

    Parameters
    ----------
    blocks : callable
        What is shown of an artifact with its number and, if it has to know what is shown beside it, of all.
    """

    def section(sources: Sources) -> Section | None:
        shown, others = [source for source in given(sources) if holds(source.record)], [sources] if among else []
        parts = (blocks(source, number, *others) for number, source in enumerate(shown, start=1))
        return Section(name, title, [block for part in parts for block in part]) if shown else None

    return section


def _of_stage(name: str) -> Callable[[Sources], list[Section]]:
    """Make the sections of all results of a stage."""

    def sections(sources: Sources) -> list[Section]:
        own = [source for source in sources.all if source.stage == name]
        shown = stage_named(name).together(own) if own else ()
        return [
            stage_named(name).section(source, number, drawn=name != "extend" or source.sha256 not in sources.answered)
            for number, source in enumerate(shown, start=1)
        ]

    return sections


_MODELS = attrgetter("models")
_SECTIONS: Sequence[Callable[[Sources], Section | list[Section] | None]] = (
    summary_section,
    comparison_section,
    models_section,
    _of_each("model", "What the model is", _MODELS, model_blocks, among=True),
    _of_stage("diagnose"),
    _of_stage("extend"),
    compared_vehicles_section,
    _of_stage("vehicle"),
    _of_stage("compare"),
    vehicle_section,
    _of_stage("trajectory"),
    _of_stage("simulate"),
    _of_stage("import"),
    _of_stage("reduce"),
    identification_section,
    _of_each("validation", "How far to trust it", _MODELS, validation_blocks),
    _of_each("residuals", "What the model leaves unexplained", _MODELS, residual_blocks, holds=attrgetter("residuals")),
    _of_each(
        "uncertainty",
        "How sure the inertia is",
        _MODELS,
        uncertainty_blocks,
        holds=lambda record: record.uncertainty or record.curves,
    ),
    _of_each("steps", "Prediction by horizon", _MODELS, steps_blocks, holds=attrgetter("steps")),
    _of_stage("sweep"),
    _of_each("search", "Search", _MODELS, search_blocks),
    _of_each("partitions", "Partitions and parameters", _MODELS, partitions_blocks),
    _of_stage("predict"),
    _of_stage("twin"),
    _of_stage("response"),
    _of_stage("tune"),
    _of_stage("replay"),
    _of_stage("trend"),
    _of_stage("changed"),
    _of_stage("_flight_numbers"),
    _of_each("rules", "Excitation of the rules", _MODELS, rules_blocks),
    provenance_section,
)

_WRITE = {Form.HTML: html_page, Form.MARKDOWN: markdown_page, Form.JSON: json_page}


@dataclass(frozen=True)
class Page:
    """A finished report: its text, the names of what it shows in order, and the formats that were not given."""

    text: str
    sections: tuple[str, ...]
    figures: tuple[str, ...]
    tables: tuple[str, ...]
    missing: tuple[str, ...]


def sections_of(sources: Sources) -> list[Section]:
    """List what there is to say of artifacts, section by section."""
    made = (make(sources) for make in _SECTIONS)
    return [each for own in made if own for each in (own if isinstance(own, list) else [own])]


def report_page(sources: Sources, version: str, form: Form = Form.HTML) -> Page:
    """Write a report about artifacts, with the version of the program; equal text for equal artifacts and settings."""
    return page_of(sources, sections_of(sources), version, form)


def page_of(sources: Sources, sections: Sequence[Section], version: str, form: Form = Form.HTML) -> Page:
    """Write sections about artifacts as one page: those of `sections_of`, and what a study adds of its own."""
    return Page(
        text=_WRITE[form](Document(sources.title, version, sections, sources.all)),
        sections=tuple(section.name for section in sections),
        figures=tuple(name for section in sections for name in section.plots),
        tables=tuple(name for section in sections for name in section.tables),
        missing=tuple(missing(sources)),
    )
