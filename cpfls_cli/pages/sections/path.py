"""The training path: Figures 2 and 3, and its peaks."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.pages.figures.attitude import attitude_figure
from cpfls_cli.pages.figures.derivatives import derivatives_figure
from cpfls_cli.pages.figures.rotation import rotation_figure
from cpfls_cli.pages.leg import DERIVATIVES, UNITS, peaks
from cpfls_cli.pages.printed import PRINTED_PEAKS
from cpfls_cli.pages.source import Source, Sources, section_of_each
from cpfls_cli.report.content import Block, Section, Table
from cpfls_cli.report.numbers import number

_LEGS_SHOWN = 20


def path_section(sources: Sources) -> Section | None:
    """Show the planned paths.

    Returns
    -------
    Section or None
        None where no trajectory was given.
    """
    paper = sources.settings.paper
    return section_of_each("path", "Training path", sources.trajectories, lambda path, index: _path(path, index, paper))


def _path(trajectory: Source, index: int, paper: bool) -> Iterator[Block]:
    if "position" not in trajectory.artifact.data:
        yield rotation_figure(f"figure-rotation-{index}", trajectory)
        return
    yield derivatives_figure(f"figure-2-derivatives-{index}", trajectory)
    yield _peaks(trajectory, index, paper)
    if "leg/begin" in trajectory.artifact.data and any(trajectory.artifact.texts("leg/limited_by")):
        yield _legs(trajectory, index)
    yield attitude_figure(f"figure-3-attitude-{index}", trajectory)


def _peaks(trajectory: Source, index: int, paper: bool) -> Table:
    found = peaks(trajectory.artifact)
    rows = [
        [name, unit, _peak(name, found), *([number(PRINTED_PEAKS[name])] if paper else [])]
        for name, unit in zip(DERIVATIVES, UNITS, strict=True)
    ]
    caption = f"Largest length of each derivative at the samples of {trajectory.label}, along the path."
    if paper:
        caption += " The paper prints its maxima for intervals of P = 1 s."
    header = ("Derivative", "Unit", "Largest", *(("Paper",) if paper else ()))
    return Table(f"peaks-{index}", caption, header, rows, frozenset({0, 1}))


def _peak(name: str, found: dict[str, float]) -> str:
    """Write a peak; above a snap that jumps there is nothing at the samples, and no bound between them."""
    return "no bound" if name in ("crackle", "pop") and not found[name] and found["snap"] else number(found[name])


def _legs(trajectory: Source, index: int) -> Table:
    artifact = trajectory.artifact
    begins, ends = artifact.array("leg/begin"), artifact.array("leg/end")
    lengths = np.linalg.norm(artifact.array("leg/displacement"), axis=1)
    reached = artifact.texts("leg/limited_by")
    rows = [
        [
            str(leg + 1),
            number(begins[leg]),
            number(ends[leg] - begins[leg]),
            number(lengths[leg]),
            reached[leg].replace(" ", ", "),
        ]
        for leg in range(min(len(begins), _LEGS_SHOWN))
    ]
    header = ("Move", "Begins, s", "Takes, s", "Length, m", "Limited by")
    caption = f"Moves of {trajectory.label} under limits, and the derivatives that reach theirs."
    if len(begins) > _LEGS_SHOWN:
        caption += f" The first {_LEGS_SHOWN} of {len(begins)}."
    return Table(f"legs-{index}", caption, header, rows, frozenset({0, 4}))
