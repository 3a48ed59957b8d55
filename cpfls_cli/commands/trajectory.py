"""Stage `trajectory`: plan a path in space, or the rotations of a vehicle that is held."""

from __future__ import annotations

from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.job import Job, begin, header_of
from cpfls_cli.artifacts.store import write_record
from cpfls_cli.artifacts.trajectory import TrajectoryRecord
from cpfls_cli.artifacts.trajectory_file import trajectory_data, trajectory_outcome, with_excitation
from cpfls_cli.commands.flyable_check import PlanAt, checked_plan, remedy
from cpfls_cli.commands.path_figures import check_figures, write_figures
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.errors import ComputationError, ConfigError, InputError, SettingError
from cpfls_cli.excitation import Excitation, optimised_rotation
from cpfls_cli.logs.csv_log import read_csv, row_lines
from cpfls_cli.report.outcome import Outcome, nothing_written
from cpfls_cli.trajectory import (
    RotationPath,
    TrajectorySettings,
    full_rotation,
    held_rotation,
    plan,
)
from cpfls_cli.trajectory.consistency import check_waypoints
from cpfls_cli.trajectory.settings import WaypointSettings

_POSITION_COLUMNS = ("x_m", "y_m", "z_m")
_OPTIONAL_COLUMNS = ("yaw_rad", "pause_s")


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
        points = _read_waypoints(waypoints, settings.duration_s is None)
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


def _read_waypoints(path: Path, paused: bool) -> tuple[WaypointSettings, ...]:
    """Read the points of a path from a CSV with the columns ``x_m, y_m, z_m`` and, if wanted, ``yaw_rad, pause_s``.

    Errors name the file and the column or the row that is wrong. `paused` tells whether the points may have pauses.
    """
    columns = read_csv(path, {*_POSITION_COLUMNS, *_OPTIONAL_COLUMNS})
    _check_columns(path, columns)
    lines = row_lines(path)
    _check_values(path, columns, lines)
    count = len(columns[_POSITION_COLUMNS[0]])
    yaw = columns["yaw_rad"].tolist() if "yaw_rad" in columns else [None] * count
    pause = columns.get("pause_s", np.zeros(count)).tolist()
    positions = zip(*(columns[name].tolist() for name in _POSITION_COLUMNS), strict=True)
    points = zip(positions, yaw, pause, strict=True)
    waypoints = tuple(WaypointSettings(position_m=p, yaw_rad=angle, pause_s=rest) for p, angle, rest in points)
    try:
        check_waypoints(waypoints, paused)
    except SettingError as error:
        raise InputError(f"{path}{_line_and_column(error.key, lines)}: {error}") from None
    return waypoints


def _check_columns(path: Path, columns: dict[str, Array]) -> None:
    known = (*_POSITION_COLUMNS, *_OPTIONAL_COLUMNS)
    missing = [name for name in _POSITION_COLUMNS if name not in columns]
    unknown = [name for name in columns if name not in known]
    problems = [
        f"{path}: column '{name}' is missing; waypoints need {', '.join(_POSITION_COLUMNS)}" for name in missing
    ]
    for name in unknown:
        near = get_close_matches(name, known, n=1)
        hint = f"did you mean {near[0]}?" if near else f"the columns are {', '.join(known)}"
        problems.append(f"{path}: column '{name}' is not known; {hint}")
    if problems:
        raise InputError("\n".join(problems))


def _check_values(path: Path, columns: dict[str, Array], lines: list[int]) -> None:
    problems = []
    for name, values in columns.items():
        wrong = ~np.isfinite(values) | ((values < 0) if name == "pause_s" else False)
        for row in np.flatnonzero(wrong):
            expected = "a finite number, 0 or more" if name == "pause_s" else "a finite number"
            fault = "is empty or not a number" if np.isnan(values[row]) else f"= {values[row]:g}"
            problems.append(f"{path}:{lines[row]}: column '{name}' {fault}: give {expected}")
    if problems:
        raise InputError("\n".join(problems))


def _line_and_column(key: str, lines: list[int]) -> str:
    """Name line and column of an entry such as ``waypoints.3.position_m``."""
    parts = key.split(".")
    if len(parts) < 3:
        return ""
    column = {"position_m": ", ".join(_POSITION_COLUMNS)}.get(parts[2], parts[2])
    return f":{lines[int(parts[1])]}: {column}"
