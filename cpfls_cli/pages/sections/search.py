"""The search: convergence and Pareto front."""

from __future__ import annotations

from collections.abc import Iterator

from cpfls_cli.pages.figures.convergence import convergence_figure
from cpfls_cli.pages.figures.front import front_figure
from cpfls_cli.pages.sections.each import section_of_each
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.pages.verdict import fuzzy_part_off
from cpfls_cli.report.content import Block, Section, Text


def search_section(sources: Sources) -> Section | None:
    """Show how the models were found.

    Returns
    -------
    Section or None
        None where no model was given.
    """
    return section_of_each("search", "Search", sources.models, _search)


def _search(model: Source, index: int) -> Iterator[Block]:
    if model.searched:
        yield from _found(model, index)
    else:
        yield Text(
            f"No search: one chromosome. {model.label} has one rule per input, so there is no partition to search for.",
            "note",
        )


def _found(model: Source, index: int) -> Iterator[Block]:
    if fuzzy_part_off(model):
        yield Text(
            f"The fuzzy part of {model.label} is off, so all chromosomes may give one and the same model, and the "
            "search decides nothing.",
            "note",
        )
    yield convergence_figure(f"convergence-{index}", model)
    yield front_figure(f"pareto-front-{index}", model)
