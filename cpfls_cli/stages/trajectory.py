"""Stage `trajectory`: plan a path in space, or the rotations of a vehicle that is held."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from cpfls_cli.artifacts.formats import TRAJECTORY
from cpfls_cli.artifacts.records import Artifact
from cpfls_cli.artifacts.writing import write_artifact
from cpfls_cli.config.study import Study
from cpfls_cli.errors import ComputationError, ConfigError
from cpfls_cli.excitation import Excitation, optimised_rotation
from cpfls_cli.simulation.flyable import Flyability, flyability, single_axis_torque
from cpfls_cli.stages.flyable_words import flyability_sentences
from cpfls_cli.stages.job import Job, Outcome, begin, header_of
from cpfls_cli.stages.path_figures import check_figures, write_figures
from cpfls_cli.stages.study import generator, settings_of
from cpfls_cli.stages.trajectory_file import trajectory_data, trajectory_outcome, with_excitation
from cpfls_cli.stages.waypoints_file import read_waypoints
from cpfls_cli.trajectory import (
    PlannedRotation,
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
    # To optimise takes long; what else can go wrong shows only when it is planned.
    if started.dry_run is not None and settings.path == "optimised":
        return started.dry_run
    planned, excitation = _planned(job, settings)
    found = _asked(job.study, settings, planned)
    problems = flyability_sentences(found, planned)
    if problems and settings.infeasible == "stop":
        remedy = f"{_remedy(job.study, settings)}, change the vehicle, or set trajectory.infeasible: report"
        raise ComputationError("\n".join([*problems, f"{job.output}: no path was written; {remedy}"]))
    if started.dry_run is not None:
        return started.dry_run
    artifact = Artifact(TRAJECTORY, header_of(job.study, started.inputs), trajectory_data(planned))
    write_artifact(job.output, artifact)
    figures = write_figures(job, artifact) if plot else ()
    return with_excitation(trajectory_outcome(planned, found, problems, figures), excitation)


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


def _planned(job: Job, settings: TrajectorySettings) -> tuple[PlannedRotation, Excitation | None]:
    if not settings.held:
        with settings_of("trajectory", job.study):
            return plan(settings, job.study.vehicle.gravity_m_s2), None
    with settings_of("trajectory.rotation", job.study):
        path, excitation = _rotation(job, settings)
    return held_rotation(path, settings.sample_time_s), excitation


def _rotation(job: Job, settings: TrajectorySettings) -> tuple[RotationPath, Excitation | None]:
    """Draw a path of full rotations, or optimise it for the model of the study."""
    assert settings.duration_s is not None
    rng, vehicle = generator(job.study, "trajectory"), job.study.vehicle
    if settings.path == "full-rotation":
        return full_rotation(settings.rotation, settings.duration_s, rng, vehicle.inertia_kg_m2), None
    structure = job.study.identification
    found = optimised_rotation(settings.rotation, settings.duration_s, structure, vehicle, rng, job.progress)
    return found.path, found


def _remedy(study: Study, settings: TrajectorySettings) -> str:
    """Say what to change, of what the config holds."""
    if settings.held:
        alone = " ".join(f"{torque:.3g}" for torque in single_axis_torque(study.vehicle))
        return f"set trajectory.rotation.torque_max_n_m (about one axis at a time the rotors give up to {alone} N m)"
    keys = ["limits"] if settings.limits.given else ["displacement_m or raise trajectory.period_s"]
    if settings.yaw_turn and not _problems(study, replace(settings, yaw_turn_rad=0.0)):
        return f"it is the turn in yaw: lower trajectory.yaw_turn_rad = {settings.yaw_turn:.4g}, or take longer over it"
    if settings.tilt_max_rad is not None:
        keys.append("acceleration, or raise trajectory.tilt_max_rad")
    return f"lower trajectory.{keys[0]}" + "".join(f", lower the {key}" for key in keys[1:])


def _problems(study: Study, settings: TrajectorySettings) -> tuple[str, ...]:
    planned = plan(settings, study.vehicle.gravity_m_s2)
    return flyability_sentences(_asked(study, settings, planned), planned)


def _asked(study: Study, settings: TrajectorySettings, planned: PlannedRotation) -> Flyability:
    """Check a plan against the vehicle."""
    signals = {name: value for name, value in vars(planned).items() if isinstance(value, np.ndarray)}
    return flyability(signals, study.vehicle, settings.tilt_max_rad)
