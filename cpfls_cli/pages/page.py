"""The page: all sections in one file that needs nothing else."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from cpfls_cli.artifacts.changed import ChangedRecord
from cpfls_cli.artifacts.diagnosis import DiagnosisRecord
from cpfls_cli.artifacts.disagreement import DisagreementRecord
from cpfls_cli.artifacts.flight_numbers import FlightNumbersRecord
from cpfls_cli.artifacts.gains import GainsRecord
from cpfls_cli.artifacts.identified import IdentifiedRecord
from cpfls_cli.artifacts.trajectory import TrajectoryRecord
from cpfls_cli.artifacts.trend import TrendRecord
from cpfls_cli.artifacts.twin import TwinRecord
from cpfls_cli.pages.changed import changed_blocks
from cpfls_cli.pages.comparison import compared_vehicles_section, comparison_section
from cpfls_cli.pages.diagnosis import diagnosis_blocks
from cpfls_cli.pages.disagreement import disagreement_blocks
from cpfls_cli.pages.evidence import steps_blocks, validation_blocks
from cpfls_cli.pages.extended import extension_section
from cpfls_cli.pages.flight import flight_section, vehicle_section
from cpfls_cli.pages.flight_numbers import answer as flight_numbers_blocks
from cpfls_cli.pages.fuzzy_part import partitions_blocks, rules_blocks
from cpfls_cli.pages.gains import gains_blocks
from cpfls_cli.pages.identification import identification_section, search_section
from cpfls_cli.pages.model import model_section
from cpfls_cli.pages.prediction import prediction_section
from cpfls_cli.pages.provenance import missing, provenance_section
from cpfls_cli.pages.replay import replay_section
from cpfls_cli.pages.residuals import residual_blocks
from cpfls_cli.pages.response import response_section
from cpfls_cli.pages.selection import reduction_section
from cpfls_cli.pages.sensors import sensors_section, unseen_section
from cpfls_cli.pages.source import R, Source, Sources, section_of_each
from cpfls_cli.pages.summary import models_section, summary_section
from cpfls_cli.pages.sweep import replicates_section
from cpfls_cli.pages.tracking import tracking_section
from cpfls_cli.pages.trajectory import path_blocks
from cpfls_cli.pages.trend import trend_blocks
from cpfls_cli.pages.twin import twin_blocks
from cpfls_cli.pages.uncertainty import uncertainty_blocks
from cpfls_cli.pages.vehicle_model import found_vehicle_section
from cpfls_cli.report.content import Block, Document, Section
from cpfls_cli.report.forms import Form
from cpfls_cli.report.html import html_page
from cpfls_cli.report.json_page import json_page
from cpfls_cli.report.markdown import markdown_page


def _of_each(
    name: str,
    title: str,
    kind: type[R],
    blocks: Callable[[Source[R], int], Iterable[Block]],
    holds: Callable[[R], object] = lambda _: True,
) -> Callable[[Sources], Section | None]:
    """Make a section of all artifacts of one kind, or of those that hold what it shows."""

    def section(sources: Sources) -> Section | None:
        shown = [source for source in sources.of_kind(kind) if holds(source.record)]
        return section_of_each(name, title, shown, blocks)

    return section


_SECTIONS: Sequence[Callable[[Sources], Section | None]] = (
    summary_section,
    comparison_section,
    models_section,
    model_section,
    _of_each("diagnosis", "Before and after", DiagnosisRecord, diagnosis_blocks),
    extension_section,
    compared_vehicles_section,
    found_vehicle_section,
    _of_each("disagreement", "Where they disagree", DisagreementRecord, disagreement_blocks),
    sensors_section,
    unseen_section,
    vehicle_section,
    _of_each("path", "Training path", TrajectoryRecord, path_blocks),
    flight_section,
    reduction_section,
    identification_section,
    _of_each("validation", "How far to trust it", IdentifiedRecord, validation_blocks),
    _of_each(
        "residuals", "What the model leaves unexplained", IdentifiedRecord, residual_blocks, lambda one: one.residuals
    ),
    _of_each(
        "uncertainty",
        "How sure the inertia is",
        IdentifiedRecord,
        uncertainty_blocks,
        lambda one: one.uncertainty or one.curves,
    ),
    _of_each("steps", "Prediction by horizon", IdentifiedRecord, steps_blocks, lambda one: one.steps),
    replicates_section,
    search_section,
    _of_each("partitions", "Partitions and parameters", IdentifiedRecord, partitions_blocks),
    prediction_section,
    _of_each("twin", "Does the simulator fly like the vehicle", TwinRecord, twin_blocks),
    response_section,
    _of_each("gains", "Gains for an autopilot", GainsRecord, gains_blocks),
    replay_section,
    _of_each("trend", "What changed over many flights", TrendRecord, trend_blocks),
    _of_each("changed", "What changed", ChangedRecord, changed_blocks),
    _of_each("flight-numbers", "What each flight tells", FlightNumbersRecord, flight_numbers_blocks),
    tracking_section,
    _of_each("rules", "Excitation of the rules", IdentifiedRecord, rules_blocks),
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
    return [section for make in _SECTIONS if (section := make(sources)) is not None]


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
