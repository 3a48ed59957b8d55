"""The page: all sections in one file that needs nothing else."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from markupsafe import Markup

from cpfls_cli import page
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.flights.flight import Flight, Imported
from cpfls_cli.pages.comparison import compared_vehicles_section
from cpfls_cli.pages.identification import WORDS
from cpfls_cli.pages.identified_figures import COMPARED
from cpfls_cli.pages.model import cautions_of
from cpfls_cli.pages.provenance import missing, provenance_section, vehicle_section
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.canvas import figure_html, pictures
from cpfls_cli.report.content import (
    Block,
    Box,
    Facts,
    Folded,
    Heading,
    Listing,
    Plot,
    Section,
    Table,
    Text,
    Tone,
    unfolded,
)
from cpfls_cli.report.forms import Form
from cpfls_cli.report.json_page import json_page
from cpfls_cli.report.source import Document
from cpfls_cli.stage import stage_named


def _summary_section(sources: Sources) -> Section:
    """Say in plain words what ran on what and how it ended."""
    blocks: list[Block] = [Text(caution, "warning") for caution in _cautions(sources)]
    blocks += [Text(note, "note") for note in sources.settings.notes]
    judged = [each for each in sources.all if each.sha256 not in sources.answered]
    blocks += [box for source in judged for box in stage_named(source.stage).verdict(source)]
    exact = [model.label for model in sources.models if _learned_without_noise(model, sources)]
    blocks += [Text(f"{label}: {_EXACT}", "note") for label in exact]
    if not sources.models and not sources.only_gap:
        blocks.append(Text("No model was given, so there is nothing to judge yet.", "note"))
    for flight in sources.of_kind(Imported):
        said = (*flight.record.contradictions, *flight.record.warnings)
        blocks += [Text(f"{flight.label}: {warning}.", "warning") for warning in said]
    blocks += [Text(sentence, "note") for sentence in missing(sources).values()]
    return Section("summary", "Summary", blocks)


def _cautions(sources: Sources) -> Iterator[str]:
    """Say what speaks against models that the artifacts rest on, each once; those on the page say it themselves."""
    shown = {each for source in sources.vehicles for each in cautions_of(source.record, source.label)}
    given = dict.fromkeys(caution for source in sources.all for caution in source.header.cautions)
    yield from (caution for caution in given if caution not in shown)


def _learned_without_noise(model: Source[IdentifiedModel], sources: Sources) -> bool:
    """Tell whether a model's flight is shown that was simulated and to which nothing was added."""
    flight: Source[Flight] | None = sources.by_hash(model.made_from("flight"))
    if flight is None or flight.made_from("trajectory") is None:
        return False
    settings = flight.config["simulation"]
    return not any((*settings["noise"].values(), *settings["relative_noise"].values()))


def _compared_models(sources: Sources) -> Section | None:
    """Compare identified models with each other; None for fewer than two."""
    models = sources.models
    if len(models) < 2:
        return None
    text = page.words("identify_compared", models, added=WORDS)
    return Section(
        "comparison",
        "The models side by side",
        page.blocks(text, pictures(COMPARED, "comparison-", models), "comparison-"),
    )


def _of_stage(name: str) -> Callable[[Sources], list[Section]]:
    """Make the sections of all results of a stage."""

    def sections(sources: Sources) -> list[Section]:
        own = [source for source in sources.all if source.stage == name]
        shown = stage_named(name).together(own) if own else ()
        several, elsewhere = len(shown) > 1, sources.answered if name == "extend" else ()
        return [
            stage_named(name).section(source, number, named=several, drawn=source.sha256 not in elsewhere)
            for number, source in enumerate(shown, start=1)
        ]

    return sections


_EXACT = (
    "The flight is simulated without noise by a rigid body, so six inertia parameters reproduce it up to rounding. No "
    "fuzzy model can beat that here; the row measures how close it comes."
)
_HASH_SHOWN = 12
_SECTIONS: Sequence[Callable[[Sources], Section | list[Section] | None]] = (
    _summary_section,
    _compared_models,
    _of_stage("identify"),
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
    _of_stage("sweep"),
    _of_stage("predict"),
    _of_stage("twin"),
    _of_stage("response"),
    _of_stage("tune"),
    _of_stage("replay"),
    _of_stage("trend"),
    _of_stage("changed"),
    _of_stage("_flight_numbers"),
    provenance_section,
)


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
        text=written(Document(sources.title, version, sections, sources.all), form),
        sections=tuple(section.name for section in sections),
        figures=tuple(name for section in sections for name in section.plots),
        tables=tuple(name for section in sections for name in section.tables),
        missing=tuple(missing(sources)),
    )


def written(document: Document, form: Form) -> str:
    """Write a report in a form."""
    if form is Form.JSON:
        return json_page(document)
    files = ", ".join(f"{page.escaped(each.label)} {page.code(each.sha256[:_HASH_SHOWN])}" for each in document.origins)
    parts = [f"# {page.escaped(document.title)}", f"Made by cpfls {page.escaped(document.version)} from {files}."]
    for section in document.sections:
        parts += [f"## {page.escaped(section.title)} {{#{section.name}}}", *_words(section.blocks)]
    text = "\n\n".join(parts)
    if form is Form.MARKDOWN:
        return page.markdown(text)
    shown = (block for section in document.sections for block in unfolded(section.blocks))
    figures = {block.name: partial(figure_html, block.picture) for block in shown if isinstance(block, Plot)}
    return page.html(document.title, text, figures)


def _words(blocks: Iterable[Block]) -> Iterator[str]:
    """Write blocks as Markdown with what pages add to it."""
    for block in blocks:
        match block:
            case Heading():
                yield f"#### {page.said(block.text)}"
            case Text():
                yield f"{'> ' if block.tone == 'warning' else ''}{_toned(block.text, block.tone)}"
            case Facts():
                yield "\n".join(f"- **{page.said(term)}**: {page.said(value)}" for term, value in block.rows)
            case Table():
                yield f"{page.said(block.explained)} {{#{block.name}}}"
                rows = [[_toned(cell.text, cell.tone) for cell in row] for row in block.cells]
                yield page.table([page.said(name) for name in block.header], rows, block.words)
            case Plot():
                more = f" [{page.said(block.see[1])}](#{block.see[0]})" if block.see else ""
                yield f"![{page.said(block.caption)}{more}]({block.name})"
            case Listing():
                fence = "`" * max(3, 1 + max(map(len, re.findall("`+", block.text)), default=0))
                yield f"::: {page.said(block.summary)}{' {open wide}' if block.shown else ''}"
                yield f"{fence}text\n{block.text.rstrip()}\n{fence}\n:::"
            case Folded():
                yield f"::: {page.said(block.summary)}{' {open wide}' if block.shown else ''}"
                yield from _words(block.blocks)
                yield ":::"
            case Box():
                yield f"::: {page.said(f'{block.label}: {block.title}')} {{{block.tone} open wide}}"
                yield from map(page.said, block.sentences)
                yield ":::"


def _toned(text: str, tone: Tone) -> Markup:
    """Write a text or a cell with its tone."""
    return Markup(f"{page.said(text)} {{{tone}}}") if tone != "plain" and text.strip() else page.said(text)
