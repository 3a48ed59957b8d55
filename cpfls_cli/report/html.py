"""A report as one HTML page that needs nothing else."""

from __future__ import annotations

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from cpfls_cli.report.content import Document
from cpfls_cli.report.figure_tables import figure_tables


def html_page(document: Document) -> str:
    """Write sections as HTML."""
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
    return template.render(document=document)
