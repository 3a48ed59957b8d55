"""Stage `trajectory`: plan a path in space, or the rotations of a vehicle that is held."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from cpfls_cli.artifacts.job import Job, begin, header_of
from cpfls_cli.artifacts.store import write_record
from cpfls_cli.artifacts.trajectory import TrajectoryRecord
from cpfls_cli.artifacts.trajectory_file import trajectory_data, trajectory_outcome, with_excitation
from cpfls_cli.commands.flyable_check import PlanAt, checked_plan, remedy
from cpfls_cli.commands.path_figures import check_figures, write_figures
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.errors import ComputationError, ConfigError
from cpfls_cli.excitation import Excitation, optimised_rotation
from cpfls_cli.report.outcome import Outcome, nothing_written
from cpfls_cli.stages.waypoints_file import read_waypoints
from cpfls_cli.trajectory import (
    RotationPath,
    TrajectorySettings,
    full_rotation,
    held_rotation,
    plan,
)


def run(job: Job, waypoints: Path | None = None, plot: bool = False) -> Outcome:
    """Plan the path of a study and write it.

    Parameters
    ----------
    waypoints : Path or None
        CSV of the points to fly to, in place of the path of the config.
    plot : bool
        Draw the path beside the output.

    Raises
    ------
    ComputationError
        If the path asks for more than the vehicle has, unless `trajectory.infeasible` is ``report``.
    """
    inputs = begin(job, {"waypoints": waypoints} if waypoints else {})
    settings = _settings(job.study, waypoints)
    if plot:
        check_figures(job, settings.held)
    # To optimise takes long; what else can go wrong shows only when it is planned.
    if job.dry_run and settings.path == "optimised":
        return nothing_written(job)
    with settings_of("trajectory", job.study):
        at, excitation = _plan(job, settings)
        planned = at(settings.sample_time_s)
        checked = checked_plan(job.study, settings, planned, at)
    if checked.problems and settings.infeasible == "stop":
        change = f"{remedy(job.study, settings)}, change the vehicle, or set trajectory.infeasible: report"
        raise ComputationError("\n".join([*checked.problems, f"{job.output}: no path was written; {change}"]))
    if job.dry_run:
        return nothing_written(job)
    record = TrajectoryRecord.of_data(header_of(job.study, inputs), trajectory_data(planned))
    write_record(job.output, record)
    figures = write_figures(job, record) if plot else ()
    return with_excitation(trajectory_outcome(planned, checked, figures), excitation)


def _settings(study: Study, waypoints: Path | None) -> TrajectorySettings:
    settings = study.trajectory
    if waypoints is not None:
        points = read_waypoints(waypoints, settings.duration_s is None)
        with settings_of("trajectory", study):
            return replace(settings, path="waypoints", waypoints=points)
    if settings.path == "waypoints" and not settings.waypoints:
        raise ConfigError(
            "trajectory.waypoints = []: a path needs two or more points; give them here, or with --waypoints FILE"
        )
    return settings


def _plan(job: Job, settings: TrajectorySettings) -> tuple[PlanAt, Excitation | None]:
    if not settings.held:
        gravity = job.study.vehicle.gravity_m_s2
        return lambda sample_time: plan(replace(settings, sample_time_s=sample_time), gravity), None
    with settings_of("trajectory.rotation", job.study):
        path, excitation = _rotation(job, settings)
    return lambda sample_time: held_rotation(path, sample_time), excitation


def _rotation(job: Job, settings: TrajectorySettings) -> tuple[RotationPath, Excitation | None]:
    """Draw a path of full rotations, or optimise it for the model of the study."""
    assert settings.duration_s is not None
    rng, vehicle = generator(job.study, "trajectory"), job.study.vehicle
    if settings.path == "full-rotation":
        return full_rotation(settings.rotation, settings.duration_s, rng, vehicle.inertia_kg_m2), None
    structure = job.study.identification
    found = optimised_rotation(settings.rotation, settings.duration_s, structure, vehicle, rng, job.progress)
    return found.path, found
