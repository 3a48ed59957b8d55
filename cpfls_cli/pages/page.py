"""The page: all sections in one file that needs nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cpfls_cli.pages.comparison import comparison_section
from cpfls_cli.pages.diagnosis import diagnosis_section
from cpfls_cli.pages.disagreement import disagreement_section
from cpfls_cli.pages.evidence import steps_section, validation_section
from cpfls_cli.pages.extended import extension_section
from cpfls_cli.pages.flight import flight_section, vehicle_section
from cpfls_cli.pages.fuzzy_part import partitions_section, rules_section
from cpfls_cli.pages.identification import identification_section, search_section
from cpfls_cli.pages.model import model_section
from cpfls_cli.pages.prediction import prediction_section
from cpfls_cli.pages.provenance import missing, provenance_section
from cpfls_cli.pages.replay import replay_section
from cpfls_cli.pages.residuals import residuals_section
from cpfls_cli.pages.selection import reduction_section
from cpfls_cli.pages.sensors import sensors_section, unseen_section
from cpfls_cli.pages.source import Sources
from cpfls_cli.pages.summary import models_section, summary_section
from cpfls_cli.pages.sweep import replicates_section
from cpfls_cli.pages.tracking import tracking_section
from cpfls_cli.pages.trajectory import path_section
from cpfls_cli.pages.uncertainty import uncertainty_section
from cpfls_cli.pages.vehicle_model import found_vehicle_section
from cpfls_cli.report.content import Document, Section
from cpfls_cli.report.forms import Form
from cpfls_cli.report.html import html_page
from cpfls_cli.report.json_page import json_page
from cpfls_cli.report.markdown import markdown_page

_SECTIONS = (
    summary_section,
    comparison_section,
    models_section,
    model_section,
    diagnosis_section,
    extension_section,
    found_vehicle_section,
    disagreement_section,
    sensors_section,
    unseen_section,
    vehicle_section,
    path_section,
    flight_section,
    reduction_section,
    identification_section,
    validation_section,
    residuals_section,
    uncertainty_section,
    steps_section,
    replicates_section,
    search_section,
    partitions_section,
    prediction_section,
    replay_section,
    tracking_section,
    rules_section,
    provenance_section,
)


_WRITE = {Form.HTML: html_page, Form.MARKDOWN: markdown_page, Form.JSON: json_page}


@dataclass(frozen=True)
class Page:
    """A finished report.

    Attributes
    ----------
    sections, figures, tables : tuple of str
        Names of what it shows, in order.
    missing : tuple of str
        Formats of which no artifact was given.
    """

    text: str
    sections: tuple[str, ...]
    figures: tuple[str, ...]
    tables: tuple[str, ...]
    missing: tuple[str, ...]


def sections_of(sources: Sources) -> list[Section]:
    """List what there is to say of artifacts, section by section."""
    return [section for make in _SECTIONS if (section := make(sources)) is not None]


def report_page(sources: Sources, version: str, form: Form = Form.HTML) -> Page:
    """Write a report about artifacts.

    Parameters
    ----------
    version : str
        Of the program.

    Returns
    -------
    Page
        Equal text for equal artifacts and settings.
    """
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
