"""The training path: Figures 2 and 3, and its peaks."""

from __future__ import annotations

from collections.abc import Iterator

from cpfls_cli.report.content import Block, Section, Table
from cpfls_cli.report.figures.attitude import attitude_figure
from cpfls_cli.report.figures.derivatives import derivatives_figure
from cpfls_cli.report.leg import DERIVATIVES, UNITS, peaks
from cpfls_cli.report.numbers import number
from cpfls_cli.report.sections.each import section_of_each
from cpfls_cli.report.source import Source, Sources

_PRINTED = ("2π = 6.283", "2", "1", "1", "2", "8", "64")


def path_section(sources: Sources) -> Section | None:
    """Show the planned paths.

    Parameters
    ----------
    sources : Sources

    Returns
    -------
    Section or None
        None where no trajectory was given.
    """
    paper = sources.settings.paper
    return section_of_each("path", "Training path", sources.trajectories, lambda path, index: _path(path, index, paper))


def _path(trajectory: Source, index: int, paper: bool) -> Iterator[Block]:
    yield derivatives_figure(f"figure-2-derivatives-{index}", trajectory)
    found = peaks(trajectory.artifact)
    rows = [
        [name, unit, number(found[name]), *([printed] if paper else [])]
        for name, unit, printed in zip(DERIVATIVES, UNITS, _PRINTED, strict=True)
    ]
    caption = f"Largest length of each derivative at the samples of {trajectory.label}, along the path."
    if paper:
        caption += " The paper prints its maxima for intervals of P = 1 s."
    header = ("Derivative", "Unit", "Largest", *(("Paper",) if paper else ()))
    yield Table(f"peaks-{index}", caption, header, rows, frozenset({0, 1}))
    yield attitude_figure(f"figure-3-attitude-{index}", trajectory)
