"""The page: all sections in one file that needs nothing else."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np
from markupsafe import Markup

from cpfls_cli import page
from cpfls_cli.artifacts.diagnosis import Diagnosis, Disagreement, Extended
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.flightlog.results import Flight, Imported
from cpfls_cli.flights.path import PlannedPath
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.comparison import BEYOND, compared_constants
from cpfls_cli.pages.identification import WORDS as OF_IDENTIFIED
from cpfls_cli.pages.identified_figures import COMPARED
from cpfls_cli.pages.model import cautions_of
from cpfls_cli.pages.trust import model_words
from cpfls_cli.reduction.training_set import Selection
from cpfls_cli.report.canvas import figure_html, pictures
from cpfls_cli.report.content import (
    STRUCK,
    UNKNOWN,
    Block,
    Box,
    Facts,
    Folded,
    Form,
    Heading,
    Listing,
    Plot,
    Section,
    Table,
    Text,
    Tone,
    plain,
    unfolded,
)
from cpfls_cli.report.source import Source, Sources
from cpfls_cli.stage import stage_named
from cpfls_cli.words import by_name


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


def _of_template(template: str, name: str, title: str, sources: Sources) -> Section:
    """Make the section that a template words of all sources."""
    return Section(name, title, page.blocks(page.words(f"report_{template}", sources, added=WORDS)))


def _compared_models(models: Sequence[Source[IdentifiedModel]]) -> Section:
    """Compare identified models with each other."""
    text = page.words("identify_compared", models, added=OF_IDENTIFIED)
    blocks = page.blocks(text, pictures(COMPARED, "comparison-", models), "comparison-")
    return Section("comparison", "The models side by side", blocks)


def _of_stage(name: str, sources: Sources) -> list[Section]:
    """Make the sections of all results of a stage."""
    own = [source for source in sources.all if source.stage == name]
    shown = stage_named(name).together(own) if own else ()
    several, elsewhere = len(shown) > 1, sources.answered if name == "extend" else ()
    return [
        stage_named(name).section(source, number, named=several, drawn=source.sha256 not in elsewhere)
        for number, source in enumerate(shown, start=1)
    ]


_LACKS: Mapping[str, tuple[type, str, str]] = {
    "trajectory": (PlannedPath, "Figure 2 and the table of peaks", "cpfls trajectory CONFIG -o trajectory.h5"),
    "flight": (
        Flight,
        "Figure 4 and the quality of the flight",
        "cpfls simulate CONFIG trajectory.h5 -o flight.h5, or cpfls import CONFIG LOG -o flight.h5",
    ),
    "selection": (Selection, "Table 4 and Figure 5", "cpfls reduce CONFIG flight.h5 -o selection.h5"),
    "model": (
        IdentifiedModel,
        "Table 5, the baselines, Figure 6 and the rules",
        "cpfls identify CONFIG flight.h5 -o model.h5",
    ),
    "disagreement": (
        Disagreement,
        "where and when model and flights disagree",
        "cpfls compare CONFIG FLIGHT... -o disagreement.h5",
    ),
    "diagnosis": (Diagnosis, "what the model misses", "cpfls diagnose CONFIG disagreement.h5 -o diagnosis.h5"),
    "extended": (Extended, "the model with the effects in it", "cpfls extend CONFIG diagnosis.h5 -o extended.h5"),
}


def missing(sources: Sources) -> dict[str, str]:
    """Name the formats, such as ``selection``, of which no artifact was given: what is not shown, and what makes it."""
    # Nobody who looks for a gap wants a training path.
    wanted: tuple[str, ...] = () if sources.only_gap else ("trajectory", "flight", "selection", "model")
    wanted += ("disagreement", "diagnosis") if sources.gap else ()
    wanted += ("extended",) if any(diagnosis.record.effects for diagnosis in sources.diagnoses) else ()
    return {
        word: f"Not shown, because no {word.replace('extended', 'extended model')} was given: {shows}; made by: "
        f"{command}."
        for word, (kind, shows, command) in _LACKS.items()
        if word in wanted and not sources.of_kind(kind)
    }


def _vehicle_rows(sources: Sources) -> Iterator[tuple[str, str]]:
    vehicle = sources.vehicle
    yield "gravity g, m/s²", plain(vehicle.gravity_m_s2)
    yield "mass m, kg", plain(vehicle.mass_kg)
    yield "rotors", str(len(vehicle.rotors))
    yield "arm l, m", _range([float(np.hypot(*rotor.position_m[:2])) for rotor in vehicle.rotors])
    yield "thrust factor k, N s²", _range([rotor.thrust_factor_n_s2 for rotor in vehicle.rotors])
    yield "drag factor b, N m s²", _range([rotor.drag_factor_n_m_s2 for rotor in vehicle.rotors])
    for name, moment in zip(INERTIA_PARAMETERS, vehicle.inertia_kg_m2, strict=False):
        yield f"{name}, kg m²", plain(moment)
    if not sources.only_gap:
        times = [source.record.time for source in sources.flights or sources.trajectories]
        durations = [float(time[-1] - time[0]) for time in times if len(time)]
        yield "flight time T, s", _range(durations) if times else UNKNOWN


def _range(values: Sequence[float]) -> str:
    low, high = (plain(float(f"{value:.4g}")) for value in (min(values), max(values)))
    return low if low == high else f"{low} … {high}"


WORDS: Mapping[str, Any] = {"BEYOND": BEYOND, **by_name(compared_constants, model_words, _vehicle_rows)}
"""What templates of several artifacts know."""

_EXACT = (
    "The flight is simulated without noise by a rigid body, so six inertia parameters reproduce it up to rounding. No "
    "fuzzy model can beat that here; the row measures how close it comes."
)
_HASH_SHOWN = 12
_ORDER = (
    *("identify", "diagnose", "extend", "vehicle", "compare", "trajectory", "simulate", "import", "reduce"),
    *("twin", "response", "tune", "replay", "trend", "changed"),
)
"""Stages whose results a report shows, answers first; what it does not name comes last."""


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
    made = [_summary_section(sources)]
    if len(sources.models) > 1:
        made.append(_compared_models(sources.models))
    of_stages = {
        name: _of_stage(name, sources) for name in dict.fromkeys((*_ORDER, *(own.stage for own in sources.all)))
    }
    for name, sections in of_stages.items():
        if name == "vehicle" and len(sources.vehicles) > 1:
            made.append(_of_template("vehicles", "vehicles", "The vehicles side by side", sources))
        made += sections
        # Gains are for a vehicle that was found, whatever the config states of it.
        if name == "compare" and any(own.stage != "tune" for own in sources.all):
            made.append(_of_template("stated_vehicle", "stated-vehicle", "Vehicle", sources))
    return [*made, _of_template("provenance", "provenance", "Provenance", sources)]


def report_page(sources: Sources, version: str, form: Form = Form.HTML) -> Page:
    """Write a report about artifacts, with the version of the program; equal text for equal artifacts and settings."""
    return page_of(sources, sections_of(sources), version, form)


def page_of(sources: Sources, sections: Sequence[Section], version: str, form: Form = Form.HTML) -> Page:
    """Write sections about artifacts as one page: those of `sections_of`, and what a study adds of its own."""
    return Page(
        text=written(sources.title, version, sections, sources.all, form),
        sections=tuple(section.name for section in sections),
        figures=tuple(name for section in sections for name in section.plots),
        tables=tuple(name for section in sections for name in section.tables),
        missing=tuple(missing(sources)),
    )


def written(title: str, version: str, sections: Sequence[Section], origins: Sequence[Source], form: Form) -> str:
    """Write a report in a form."""
    if form is Form.JSON:
        listed = [
            {"name": section.name, "title": section.title, "blocks": list(map(_block, section.blocks))}
            for section in sections
        ]
        whole = {"title": title, "cpfls_version": version, "sections": listed, "artifacts": list(map(_origin, origins))}
        return json.dumps(whole, ensure_ascii=False, allow_nan=False, separators=(",", ":")) + "\n"
    files = ", ".join(f"{page.escaped(each.label)} {page.code(each.sha256[:_HASH_SHOWN])}" for each in origins)
    parts = [f"# {page.escaped(title)}", f"Made by cpfls {page.escaped(version)} from {files}."]
    for section in sections:
        parts += [f"## {page.escaped(section.title)} {{#{section.name}}}", *_words(section.blocks)]
    text = "\n\n".join(parts)
    if form is Form.MARKDOWN:
        return page.markdown(text)
    shown = (block for section in sections for block in unfolded(section.blocks))
    figures = {block.name: partial(figure_html, block.picture) for block in shown if isinstance(block, Plot)}
    return page.html(title, text, figures)


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
                yield f"{page.said(block.caption)} {{#{block.name}}}"
                rows = [[_toned(cell.text, cell.tone) for cell in row] for row in block.cells]
                yield page.table([page.said(name) for name in block.header], rows, block.words)
            case Plot():
                more = f" [{page.said(block.see[1])}](#{block.see[0]})" if block.see else ""
                yield f"![{page.said(block.caption)}{more}]({block.name})"
            case Listing():
                yield page.listing(block.text)
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


def _block(block: Block) -> dict[str, Any]:
    kind = type(block).__name__.lower()
    match block:
        case Table():
            return {"kind": kind, **_table(block)}
        case Folded():
            return {"kind": kind, "summary": block.summary, "blocks": [_block(inner) for inner in block.blocks]}
        case Facts():
            return {"kind": kind, "rows": [[_bare(term), _bare(value)] for term, value in block.rows]}
        case Text():
            return {"kind": kind, "text": block.text, "tone": block.tone}
        case Plot():
            return {"kind": "figure", "name": block.name, "caption": block.caption, "description": block.description}
        case _:
            return {"kind": kind, **asdict(block)}


def _bare(text: str) -> str:
    """Leave out what strikes a number through; the word behind it stays."""
    return STRUCK.sub(r"\1", text)


def _table(table: Table) -> dict[str, Any]:
    cells = table.cells
    marked = [
        {"row": row, "column": column, "tone": cell.tone}
        for row, line in enumerate(cells)
        for column, cell in enumerate(line)
        if cell.tone != "plain"
    ]
    return {
        "name": table.name,
        "caption": table.caption,
        "header": list(table.header),
        "rows": [[_bare(cell.text) for cell in line] for line in cells],
        "marked": marked,
    }


def _origin(origin: Source) -> dict[str, Any]:
    header = origin.header
    return {
        "file": origin.label,
        "format": origin.format,
        "cpfls_version": header.version,
        "seed": header.seed,
        "sha256": origin.sha256,
        "config_sha256": origin.config_sha256,
        "inputs": {role: asdict(file) for role, file in header.inputs.items()},
        "cautions": list(header.cautions),
        "config": header.config,
    }
