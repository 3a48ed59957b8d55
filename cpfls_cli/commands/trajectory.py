"""Command `trajectory`: plan a path in space or the rotations of a held vehicle, and check it against the vehicle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, replace
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.job import Job, begin, check_outputs, finish, go_on, require_numbers
from cpfls_cli.artifacts.output import write_files
from cpfls_cli.artifacts.trajectory import ExcitedGroup, TrajectoryRecord
from cpfls_cli.commands.mission import Mission, mission_paths, mission_texts
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.errors import ComputationError, ConfigError, InputError, SettingError
from cpfls_cli.excitation.optimise import Excitation, optimised_rotation
from cpfls_cli.logs.csv_log import read_csv, row_lines
from cpfls_cli.pages.source import source_of
from cpfls_cli.pages.trajectory import (
    absolute_jerk,
    answer,
    demand_sentences,
    figure_names,
    guessed_words,
    mission_blocks,
    path_figures,
    plan_blocks,
)
from cpfls_cli.report.content import Text
from cpfls_cli.report.outcome import Command, Outcome, nothing_written
from cpfls_cli.simulation.inverse import Flyability, flyability, single_axis_torque
from cpfls_cli.simulation.room_left import RoomLeft, room_left
from cpfls_cli.trajectory.consistency import check_waypoints
from cpfls_cli.trajectory.excited import added_motion
from cpfls_cli.trajectory.legs import Leg
from cpfls_cli.trajectory.planning import PlannedRotation, Trajectory, held_rotation, plan
from cpfls_cli.trajectory.repeats import repeated
from cpfls_cli.trajectory.rotation import RotationPath, full_rotation
from cpfls_cli.trajectory.settings import TrajectorySettings, WaypointSettings
from cpfls_cli.words import did_you_mean

PlanAt = Callable[[float], PlannedRotation]
"""Samples a plan with a sample time in s."""

_POSITION_COLUMNS = ("x_m", "y_m", "z_m")
_OPTIONAL_COLUMNS = ("yaw_rad", "pause_s")
# Samples in the shortest part of a move, and how many in all are looked at.
_SAMPLES_IN_A_PART = 8
_MOST_SAMPLES = 1_000_000


@dataclass(frozen=True)
class Flight:
    """A path as it is to be flown.

    Attributes
    ----------
    planned : PlannedRotation
        All runs of it.
    at : callable
        Samples it anew, two runs at most, for a look between its samples.
    excitation : Excitation or None
        Of a held vehicle, where the path is optimised.
    excited : ExcitedGroup or None
        What is added to the setpoints.
    """

    planned: PlannedRotation
    at: PlanAt
    excitation: Excitation | None = None
    excited: ExcitedGroup | None = None


def run(job: Job, waypoints: Path | None = None, plot: bool = False, mission: Mission | None = None) -> Outcome:
    """Plan the path of a study and write it."""
    mission = mission or Mission()
    inputs = begin(job, {"waypoints": waypoints} if waypoints else {})
    settings = _settings(job.study, waypoints)
    require_numbers(job, "trajectory", whole=not settings.held)
    figures = figure_paths(job, figure_names(held=settings.held) if plot else ())
    check_outputs(job, *figures, *mission_paths(job, mission))
    # To optimise takes long; what else can go wrong shows only when it is planned.
    if job.dry_run and settings.path == "optimised":
        return nothing_written(job)
    with settings_of("trajectory", job.study):
        flight = _flight(job, settings)
        planned = flight.planned
        demand, problems = _demand(job.study, settings, planned, flight.at)
    if problems and settings.infeasible == "stop":
        change = f"{_remedy(job.study, settings)}, change the vehicle, or set trajectory.infeasible: report"
        raise ComputationError("\n".join([*problems, f"{job.output}: no path was written; {change}"]))
    record = TrajectoryRecord.of(planned, excited=flight.excited)
    texts = mission_texts(job, mission, record)
    if job.dry_run:
        return nothing_written(job)
    source = source_of(job, finish(job, record, inputs))
    drawn = path_figures(source) if figures else ()
    write_files({path: figure.picture.svg for path, figure in zip(figures, drawn, strict=True)} | texts)
    blocks = [*plan_blocks(planned, demand, flight.excitation), *answer(source)]
    blocks += [Text(f"drawn: {', '.join(map(str, figures))}")] if figures else []
    blocks += mission_blocks(texts, mission.forms, source.record)
    guessed = guessed_words(job.study.vehicle) if job.open_numbers == "refused" else ()
    blocks += [Text(problem, "warning") for problem in (*problems, *guessed)]
    summary = _summary(source.record, planned, demand, flight.excitation, figures)
    return Outcome(summary | {"files": [str(path) for path in texts]}, tuple(blocks), next=(to_simulate(job),))


def to_simulate(job: Job) -> Command:
    """Give the command that flies the path of a job."""
    return go_on(job, "simulate", job.output, output=job.beside("flight.h5"))


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


def _flight(job: Job, settings: TrajectorySettings) -> Flight:
    if settings.held:
        with settings_of("trajectory.rotation", job.study):
            path, excitation = _rotation(job, settings)
        return Flight(
            held_rotation(path, settings.sample_time_s),
            lambda sample_time: held_rotation(path, sample_time),
            excitation,
        )
    gravity = job.study.vehicle.gravity_m_s2
    plain = plan(settings, gravity)
    room: RoomLeft | None = None
    if settings.excite.axes:
        room = room_left(plain, added_motion(settings.excite, plain, gravity), settings, job.study.vehicle)
    twice = replace(settings, repeat=min(settings.repeat, 2))

    def at(sample_time: float) -> PlannedRotation:
        finer = plan(replace(settings, sample_time_s=sample_time), gravity)
        if room is not None:
            finer = added_motion(settings.excite, finer, gravity).of_sizes(room.added.sizes).onto(finer, gravity)
        return repeated(finer, twice, gravity)

    without = repeated(plain, settings, gravity)
    if room is None:
        return Flight(without, at)
    excited = repeated(room.added.onto(plain, gravity), settings, gravity)
    return Flight(excited, at, None, ExcitedGroup.of(settings.excite, excited, without, room))


def _rotation(job: Job, settings: TrajectorySettings) -> tuple[RotationPath, Excitation | None]:
    """Draw a path of full rotations, or optimise it for the model of the study."""
    assert settings.duration_s is not None
    rng, vehicle = generator(job.study, "trajectory"), job.study.vehicle
    if settings.path == "full-rotation":
        return full_rotation(settings.rotation, settings.duration_s, rng, vehicle.inertia_kg_m2), None
    structure = job.study.identification
    excitation = optimised_rotation(settings.rotation, settings.duration_s, structure, vehicle, rng, job.progress)
    return excitation.path, excitation


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
        hint = did_you_mean(name, known, f"the columns are {', '.join(known)}", cutoff=0.6)
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


def _demand(
    study: Study, settings: TrajectorySettings, planned: PlannedRotation, at: PlanAt
) -> tuple[Flyability, tuple[str, ...]]:
    """Find what a plan asks of its vehicle, sampled anew where needed, and say what is beyond what the vehicle has."""
    shortest = _shortest_part(planned, settings)
    step = shortest / _SAMPLES_IN_A_PART
    if step < settings.sample_time_s:
        if planned.duration / settings.repeat * min(settings.repeat, 2) > _MOST_SAMPLES * step:
            message = f"moves have parts of {shortest:.3g} s, too short to be checked between samples; lower it"
            raise SettingError("sample_time_s", f"{message}, or plan longer moves")
        planned = at(step)
    signals = {name: value for name, value in vars(planned).items() if isinstance(value, np.ndarray)}
    demand = flyability(signals, study.vehicle, settings.tilt_max_rad)
    return demand, demand_sentences(demand, planned)


def _shortest_part(planned: PlannedRotation, settings: TrajectorySettings) -> float:
    """Shortest wave or hold of any move, or half a period of the fastest harmonic; infinite in hover."""
    if not isinstance(planned, Trajectory):
        return 0.5 / settings.rotation.frequency_max_hz
    profiles = [profile for leg in planned.legs for profile in leg.profiles]
    parts = [part for profile in profiles for part in (profile.period, *astuple(profile.holds))]
    if settings.excite.axes:
        parts.append(0.5 / settings.excite.band_hz[1])
    return min((float(part) for part in parts if part > 0), default=inf)


def _remedy(study: Study, settings: TrajectorySettings) -> str:
    """Say which key to change about a plan that asks for too much."""
    if settings.held:
        alone = " ".join(f"{torque:.3g}" for torque in single_axis_torque(study.vehicle))
        return f"set trajectory.rotation.torque_max_n_m (about one axis at a time the rotors give up to {alone} N m)"
    turns = bool(settings.yaw_turn) or any(point.yaw_rad for point in settings.waypoints)
    if turns and not _too_much_without_turn(study, settings):
        by_points = any(point.yaw_rad is not None for point in settings.waypoints)
        key = "waypoints: their yaw_rad" if by_points else f"yaw_turn_rad = {settings.yaw_turn:.4g}"
        return f"it is the turn in yaw: lower trajectory.{key}, or take longer over it"
    slower = "lower trajectory.limits" if settings.limits.given else "raise trajectory.period_s"
    return slower if settings.tilt_max_rad is None else f"{slower}, raise trajectory.tilt_max_rad"


def _too_much_without_turn(study: Study, settings: TrajectorySettings) -> bool:
    points = tuple(replace(point, yaw_rad=None) for point in settings.waypoints)
    still = replace(settings, yaw_turn_rad=0.0, waypoints=points)

    def at(sample_time: float) -> Trajectory:
        return plan(replace(still, sample_time_s=sample_time), study.vehicle.gravity_m_s2)

    _, problems = _demand(study, still, at(still.sample_time_s), at)
    return bool(problems)


def figure_paths(job: Job, names: Sequence[str]) -> tuple[Path, ...]:
    """Name the figures of a path, beside its artifact."""
    return tuple(job.output.with_name(f"{job.output.stem}-{name}.svg") for name in names)


def _summary(
    record: TrajectoryRecord,
    planned: PlannedRotation,
    demand: Flyability,
    excitation: Excitation | None,
    figures: Sequence[Path],
) -> dict[str, Any]:
    """Describe a plan for machines: its artifact holds samples, the plan is known exactly."""
    summary: dict[str, Any] = {
        "figures": [str(path) for path in figures],
        "samples": len(planned.time),
        "duration_s": planned.duration,
        **record.summary,
        "max_thrust_n": float(demand.thrust.max()),
    }
    if isinstance(planned, Trajectory):
        summary |= {
            "max_tilt_rad": float(demand.tilt.max()),
            "max": {**planned.maxima, "position": planned.maxima["displacement"]},
            "legs": [_leg_summary(leg) for leg in planned.legs],
        }
    if excitation is not None:
        random = {"best": float(excitation.random.min()), "median": float(np.median(excitation.random))}
        summary |= {"condition_number": excitation.condition_number, "random": random}
        summary["evaluations"] = excitation.evaluations
    return summary


def _leg_summary(leg: Leg) -> dict[str, Any]:
    return {
        "begin_s": leg.begin,
        "duration_s": leg.duration,
        "displacement_m": leg.vector.tolist(),
        "limited_by": list(leg.limited_by),
        "jerk_integral_m_s2": absolute_jerk(leg),
    }
