"""The pictures of a path, as files beside its artifact."""

from __future__ import annotations

from pathlib import Path

from cpfls_cli.artifacts.job import Job
from cpfls_cli.artifacts.output import check_output, write_text
from cpfls_cli.artifacts.trajectory import TrajectoryRecord
from cpfls_cli.config.study import resolved
from cpfls_cli.pages.figures.attitude import attitude_figure
from cpfls_cli.pages.figures.derivatives import derivatives_figure
from cpfls_cli.pages.figures.rotation import rotation_figure
from cpfls_cli.pages.source import Source
from cpfls_cli.report.content import Plot


def figure_paths(job: Job, held: bool) -> tuple[Path, ...]:
    """Name the pictures of a path.

    Parameters
    ----------
    held : bool
        Whether the vehicle is held and only turns.

    Returns
    -------
    tuple of Path
        Beside the output: the derivatives (Figure 2) and the attitude (Figure 3), or the rotations.
    """
    names = ("rotation",) if held else ("derivatives", "attitude")
    return tuple(job.output.with_name(f"{job.output.stem}-{name}.svg") for name in names)


def check_figures(job: Job, held: bool) -> None:
    """Refuse pictures that cannot or must not be written, before anything is computed.

    Raises
    ------
    InputError
    """
    for path in figure_paths(job, held):
        check_output(path, job.force)


def write_figures(job: Job, trajectory: TrajectoryRecord) -> tuple[Path, ...]:
    """Draw a path.

    Returns
    -------
    tuple of Path
        Of the pictures.

    References
    ----------
    Figures 2 and 3 of the paper.
    """
    source = Source.of(job.output.name, "", trajectory, resolved(job.study), job.study.vehicle, 0)
    held = trajectory.position is None
    paths = figure_paths(job, held)
    for path, plot in zip(paths, _plots(source, held), strict=True):
        write_text(path, plot.svg)
    return paths


def _plots(source: Source, held: bool) -> tuple[Plot, ...]:
    if held:
        return (rotation_figure("rotation", source),)
    return derivatives_figure("derivatives", source), attitude_figure("attitude", source)
