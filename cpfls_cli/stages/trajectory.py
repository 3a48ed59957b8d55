"""Stage `trajectory`: plan a path in space, or the rotations of a vehicle that is held."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from cpfls_cli.artifacts.formats import TRAJECTORY
from cpfls_cli.artifacts.records import Artifact
from cpfls_cli.artifacts.writing import write_artifact
from cpfls_cli.config.study import Study
from cpfls_cli.errors import ComputationError, ConfigError
from cpfls_cli.simulation.flyable import flyability, single_axis_torque
from cpfls_cli.stages.flyable_words import flyability_sentences
from cpfls_cli.stages.job import Job, Outcome, begin, header_of
from cpfls_cli.stages.path_figures import check_figures, write_figures
from cpfls_cli.stages.study import generator, settings_of
from cpfls_cli.stages.trajectory_file import trajectory_data, trajectory_outcome
from cpfls_cli.stages.waypoints_file import read_waypoints
from cpfls_cli.trajectory import PlannedRotation, Trajectory, TrajectorySettings, full_rotation, held_rotation, plan


def run(job: Job, waypoints: Path | None = None, plot: bool = False) -> Outcome:
    """Plan the path of a study and write it.

    Parameters
    ----------
    job : Job
    waypoints : Path or None
        CSV of the points to fly to, in place of the path of the config.
    plot : bool
        Draw the path beside the output.

    Returns
    -------
    Outcome

    Raises
    ------
    ComputationError
        If the path asks for more than the vehicle has, unless `trajectory.infeasible` is ``report``.
    """
    started = begin(job, {"waypoints": waypoints} if waypoints else {})
    settings = _settings(job.study, waypoints)
    if plot:
        check_figures(job, settings.held)
    if started.dry_run is not None:
        return started.dry_run
    planned = _planned(job, settings)
    signals = {name: value for name, value in vars(planned).items() if name not in {"legs", "maxima"}}
    found = flyability(signals, job.study.vehicle, settings.tilt_max_rad)
    problems = flyability_sentences(found, planned)
    if problems and settings.infeasible == "stop":
        remedy = f"{_remedy(job.study, settings)}, change the vehicle, or set trajectory.infeasible: report"
        raise ComputationError("\n".join([*problems, f"{job.output}: no path was written; {remedy}"]))
    artifact = Artifact(TRAJECTORY, header_of(job.study, started.inputs), trajectory_data(planned))
    write_artifact(job.output, artifact)
    figures = write_figures(job, artifact) if plot else ()
    return trajectory_outcome(planned, found, problems, figures)


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


def _planned(job: Job, settings: TrajectorySettings) -> Trajectory | PlannedRotation:
    if not settings.held:
        with settings_of("trajectory", job.study):
            return plan(settings, job.study.vehicle.gravity_m_s2)
    assert settings.duration_s is not None
    rng = generator(job.study, "trajectory")
    with settings_of("trajectory.rotation", job.study):
        path = full_rotation(settings.rotation, settings.duration_s, rng, job.study.vehicle.inertia_kg_m2)
    return held_rotation(path, settings.sample_time_s)


def _remedy(study: Study, settings: TrajectorySettings) -> str:
    if not settings.held:
        return "lower the limits of the path"
    alone = " ".join(f"{torque:.3g}" for torque in single_axis_torque(study.vehicle))
    return f"set trajectory.rotation.torque_max_n_m (about one axis at a time the rotors give up to {alone} N m)"
