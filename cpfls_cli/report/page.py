"""The page: all sections in one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from cpfls_cli.report.content import Section
from cpfls_cli.report.figure_tables import figure_tables
from cpfls_cli.report.missing import missing
from cpfls_cli.report.sections.diagnosis import diagnosis_section
from cpfls_cli.report.sections.disagreement import disagreement_section
from cpfls_cli.report.sections.extension import extension_section
from cpfls_cli.report.sections.flight import flight_section
from cpfls_cli.report.sections.identification import identification_section
from cpfls_cli.report.sections.partitions import partitions_section
from cpfls_cli.report.sections.path import path_section
from cpfls_cli.report.sections.prediction import prediction_section
from cpfls_cli.report.sections.provenance import provenance_section
from cpfls_cli.report.sections.reduction import reduction_section
from cpfls_cli.report.sections.replicates import replicates_section
from cpfls_cli.report.sections.rules import rules_section
from cpfls_cli.report.sections.search import search_section
from cpfls_cli.report.sections.sensors import sensors_section
from cpfls_cli.report.sections.summary import summary_section
from cpfls_cli.report.sections.unseen import unseen_section
from cpfls_cli.report.sections.vehicle import vehicle_section
from cpfls_cli.report.source import Sources

_SECTIONS = (
    summary_section,
    diagnosis_section,
    extension_section,
    disagreement_section,
    sensors_section,
    unseen_section,
    vehicle_section,
    path_section,
    flight_section,
    reduction_section,
    identification_section,
    replicates_section,
    search_section,
    partitions_section,
    prediction_section,
    rules_section,
    provenance_section,
)


@dataclass(frozen=True)
class Page:
    """A finished report.

    Attributes
    ----------
    html : str
    sections, figures, tables : tuple of str
        Names of what it shows, in order.
    missing : tuple of str
        Formats of which no artifact was given.
    """

    html: str
    sections: tuple[str, ...]
    figures: tuple[str, ...]
    tables: tuple[str, ...]
    missing: tuple[str, ...]


def report_page(sources: Sources, version: str) -> Page:
    """Write a report about artifacts.

    Parameters
    ----------
    sources : Sources
    version : str
        Of the program, for the footer.

    Returns
    -------
    Page
        Equal text for equal artifacts and settings.
    """
    sections = [section for make in _SECTIONS if (section := make(sources)) is not None]
    return Page(
        html=_render(sections, sources, version),
        sections=tuple(section.name for section in sections),
        figures=tuple(name for section in sections for name in section.plots),
        tables=tuple(name for section in sections for name in section.tables),
        missing=tuple(missing(sources)),
    )


def _render(sections: Sequence[Section], sources: Sources, version: str) -> str:
    environment = Environment(
        loader=PackageLoader("cpfls_cli.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    # Figures are made here and hold only escaped text; everything else on the page is escaped by the template.
    environment.filters["figure"] = Markup
    environment.filters["figure_tables"] = figure_tables
    template = environment.get_template("page.html")
    return template.render(title=sources.title, sections=sections, version=version, sources=sources.all)
