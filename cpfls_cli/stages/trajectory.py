"""Plan a smooth path, full rotations that excite a model, or the flight that settles a diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from enum import StrEnum
from importlib import import_module
from math import inf, radians
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.job import Job, check_outputs, require_numbers
from cpfls_cli.autopilots.law import AXES
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.errors import ComputationError, ConfigError, InputError, SettingError
from cpfls_cli.excitation import Excitation, optimised_rotation
from cpfls_cli.export.mission import Home, qgc_plan, system_id_lines, waypoint_lines
from cpfls_cli.flights.path import DERIVATIVES, Excited, PlannedPath
from cpfls_cli.logs.csv_log import read_csv, row_lines
from cpfls_cli.pages.gap import effect_title
from cpfls_cli.report.canvas import BASELINE, Drawn, Figure, line, picture_of, stacked, style_of
from cpfls_cli.report.content import plain
from cpfls_cli.simulation.inverse import Flyability, RoomLeft, flyability, room_left, single_axis_torque
from cpfls_cli.stage import Run, stage
from cpfls_cli.stages._flight import FIGURES as OF_FLIGHTS
from cpfls_cli.stages._flight import demand_sentences
from cpfls_cli.trajectory.excited import added_motion
from cpfls_cli.trajectory.planning import PlannedRotation, Trajectory, held_rotation, plan, repeated
from cpfls_cli.trajectory.rotation import RotationPath, full_rotation
from cpfls_cli.trajectory.settings import TrajectorySettings, WaypointSettings, check_waypoints
from cpfls_cli.words import did_you_mean, joined

CSV, PX4, ARDUPILOT = "csv", "px4", "ardupilot"


@dataclass(frozen=True)
class Mission:
    """Files for autopilots that are asked for (csv, px4, ardupilot), and the place of the path on earth."""

    forms: tuple[str, ...] = ()
    home: Home | None = None


def mission_of(study: Study, forms: Sequence[str], home: str | None) -> Mission:
    """Take what is asked for; a path that is repeated or excited is to be flown, so it comes with a CSV."""
    settings = study.trajectory
    asked = tuple(dict.fromkeys(forms))
    if asked and settings.held:
        raise InputError(f"--format {asked[0]}: path {settings.path} turns a held vehicle; no autopilot flies it")
    if settings.path == "next-flight" and set(asked) - {CSV}:
        raise InputError(f"--format {asked[-1]}: a next flight is a curve; only a CSV holds it, and is always written")
    if ARDUPILOT in asked and not settings.excite.axes:
        raise InputError("--format ardupilot: writes sweeps for its System ID mode; say which axes with --excite AXES")
    if PX4 in asked and home is None:
        raise InputError("--format px4: a mission needs its place on earth; add --home LAT,LON,HEIGHT")
    if home is not None and PX4 not in asked:
        raise InputError(f"--home {home}: is the place of a mission; add --format px4")
    if not asked and (settings.repeat > 1 or settings.excite.axes):
        asked = (CSV,)
    return Mission(asked, None if home is None else _home(home))


def _home(text: str) -> Home:
    try:
        latitude, longitude, height = (float(part) for part in text.split(","))
        if not (-85 <= latitude <= 85 and -180 <= longitude <= 180 and 0 < height < 1e4):
            raise ValueError
    except ValueError:
        raise InputError(
            f"--home {text}: give latitude and longitude of x = y = 0 in degrees, and the height of z = 0 above the "
            "take-off in m, such as 47.3977,8.5456,10"
        ) from None
    return Home(latitude, longitude, height)


def mission_paths(job: Job, mission: Mission) -> dict[Path, str]:
    """Name the files, and the form of each, next to the artifact; of ArduPilot one for each axis, named by it."""
    output, axes = job.output, job.study.trajectory.excite.axes
    paths = {
        CSV: [output.with_name(f"{output.stem}-waypoints.csv")],
        PX4: [output.with_name(f"{output.stem}.plan")],
        ARDUPILOT: [output.with_name(f"{output.stem}-sid-{axis}.param") for axis in axes],
    }
    return {path: form for form in mission.forms for path in paths[form]}


def mission_texts(job: Job, mission: Mission, planned: PlannedPath, paths: Mapping[Path, str]) -> dict[Path, str]:
    """Write a path as the files that are asked for."""
    vehicle = job.study.vehicle
    most = sum(rotor.thrust_factor_n_s2 for rotor in vehicle.rotors) * vehicle.rotor_speed_max_rad_s**2
    hover = vehicle.mass_kg * vehicle.gravity_m_s2 / most
    run = float(planned.runs[0].end if planned.runs else planned.time[-1])
    texts, axes = {}, iter(planned.excited.axes if planned.excited else ())
    for path, form in paths.items():
        if form == CSV:
            texts[path] = waypoint_lines(planned)
        elif form == PX4:
            assert mission.home is not None, "asked for before"
            texts[path] = qgc_plan(planned, mission.home)
        else:
            assert planned.excited is not None, "asked for before"
            texts[path] = system_id_lines(planned.excited, next(axes), run, hover)
    return texts


def mission_words(forms: Sequence[str], planned: PlannedPath) -> Iterator[str]:
    """Say what each autopilot does with the files."""
    if PX4 in forms:
        yield (
            "PX4 flies the mission in its own time, by its own limits, at rest at each point: runs are alike, but do "
            "not take as long as those planned. Load it in QGroundControl, and check heights and the way back."
        )
    if ARDUPILOT in forms:
        times = f"{len(planned.runs)} times" if len(planned.runs) > 1 else "once"
        yield (
            f"ArduPilot makes the sweeps itself, in hover: switch to System ID mode {times} for each axis; the path of "
            "the file is not flown."
        )


class Signal(StrEnum):
    """What excites a path."""

    MULTISINE = "multisine"
    LINEAR = "sweep-linear"
    LOGARITHMIC = "sweep-logarithmic"


class MissionFormat(StrEnum):
    """What a path is written as for an autopilot."""

    CSV = "csv"
    PX4 = "px4"
    ARDUPILOT = "ardupilot"


WaypointsOption = Annotated[
    Path | None,
    typer.Option(
        "--waypoints",
        metavar="FILE",
        help="CSV of points to fly to, in place of the path of the config: x_m, y_m, z_m, and if wanted yaw_rad, "
        "pause_s.",
    ),
]
SeparateOption = Annotated[
    str | None,
    typer.Option(
        "--separate",
        "--to-tell",
        metavar="A,B",
        help="Plan the flight that distinguishes these effects (`cpfls effects`).",
    ),
]
ForOption = Annotated[
    Path | None,
    typer.Option("--for", metavar="DIAGNOSIS", help="Plan the flight that settles what this diagnosis leaves open."),
]
BoxOption = Annotated[
    str | None, typer.Option("--box", metavar="X,Y,Z", help="Space for such a flight, m; about x = y = 0.")
]
HeightOption = Annotated[
    float | None, typer.Option("--height", metavar="M", help="Height of the middle of the box above the ground, m.")
]
DurationOption = Annotated[
    float | None, typer.Option("--duration", metavar="S", help="Duration, s, in place of that of the config.")
]
HoverOption = Annotated[
    float | None, typer.Option("--hover", metavar="S", help="Hover for S seconds, in place of the path of the config.")
]
RepeatOption = Annotated[
    int | None,
    typer.Option(
        "--repeat", metavar="N", help="Fly the path N times, each run the same from rest to rest, with a way back."
    ),
]
ExciteOption = Annotated[
    str | None,
    typer.Option(
        "--excite", metavar="AXES", help="Add a test signal: roll, pitch, yaw, vertical, with commas between."
    ),
]
SignalOption = Annotated[
    Signal | None, typer.Option("--signal", help="What excites; default: that of the config, a multisine if none.")
]
BandOption = Annotated[
    str | None, typer.Option("--band", metavar="LOW,HIGH", help="Band of the test signal, Hz; 0.5,5 if none is set.")
]
SizeOption = Annotated[
    float | None,
    typer.Option(
        "--size", metavar="DEG", help="Its largest angle, degrees; smaller, with a warning, where the vehicle cannot."
    ),
]
MissionOption = Annotated[
    list[MissionFormat] | None,
    typer.Option(
        "--format",
        help="For an autopilot, next to OUTPUT: the path as csv; a mission for px4 (QGroundControl); ardupilot: sweeps "
        "for its System ID mode. May be repeated; --repeat and --excite write csv if none is named.",
    ),
]
HomeOption = Annotated[
    str | None,
    typer.Option(
        "--home",
        metavar="LAT,LON,HEIGHT",
        help="For px4: degrees of x = y = 0 (x east, y north), and metres of z = 0 above the take-off.",
    ),
]
PlotOption = Annotated[
    bool, typer.Option("--plot", help="Draw the derivatives and the attitude, as SVG next to OUTPUT.")
]


def option_overrides(
    waypoints: Path | None,
    separate: str | None,
    diagnosis: Path | None,
    box: str | None,
    height: float | None,
    duration: float | None,
    hover: float | None,
    repeat: int | None,
    excite: str | None,
    signal: Signal | None,
    band: str | None,
    size: float | None,
    **_: Any,
) -> list[str]:
    """Write the options as overrides of the config, ``section.key=value`` each, so that the file's config has them."""
    settles = separate is not None or diagnosis is not None
    if settles and waypoints is not None:
        raise InputError(f"--waypoints {waypoints}: --separate and --for choose the path themselves; leave it out")
    others = {
        f"--waypoints {waypoints}": waypoints is not None,
        "--separate and --for": settles,
        f"--duration {duration or 0:g}": duration is not None,
    }
    for other, given in others.items():
        if given and hover is not None:
            raise InputError(f"--hover {hover:g}: stays at one place for so long; leave out {other}")
    length = duration if hover is None else hover
    paths = {"next-flight": settles, "waypoints": waypoints is not None, "hover": hover is not None}
    lists = {"next_flight.separate": separate, "next_flight.box_m": box, "excite.axes": excite, "excite.band_hz": band}
    values = {
        "path": next((path for path, asked in paths.items() if asked), None),
        **{key: None if text is None else f"[{text}]" for key, text in lists.items()},
        "next_flight.height_m": None if height is None else repr(float(height)),
        "duration_s": None if length is None else repr(float(length)),
        "repeat": repeat,
        "excite.signal": None if signal is None else signal.value,
        "excite.size_rad": None if size is None else repr(radians(size)),
    }
    return [f"trajectory.{key}={value}" for key, value in values.items() if value is not None]


def require_no_room(box: str | None, height: float | None) -> None:
    """Refuse room for a path that is not planned for it."""
    for option, value in (("--box", box), ("--height", height)):
        if value is not None:
            raise InputError(
                f"{option} {value}: is room for the flight that --separate or --for plans, and this path is planned "
                "without; give one of them, or set trajectory.displacement_m and trajectory.direction"
            )


def require_axes(study: Study, **given: object) -> None:
    """Refuse what describes an excitation where there is none."""
    for option, value in given.items():
        if value is not None and not study.trajectory.excite.axes:
            raise InputError(f"--{option} {value}: describes an excitation; say which axes with --excite AXES")


PlanAt = Callable[[float], PlannedRotation]
"""Samples a plan with a sample time in s."""

_POSITION_COLUMNS = ("x_m", "y_m", "z_m")
_OPTIONAL_COLUMNS = ("yaw_rad", "pause_s")
# Samples in the shortest part of a move, and how many in all are looked at.
_SAMPLES_IN_A_PART = 8
_MOST_SAMPLES = 1_000_000


def _draw_derivatives(r: PlannedPath, figure: Figure) -> None:
    """Draw pop to displacement over the first move: Figure 2 of the paper."""
    time, curves = r.first_leg()
    panels = stacked(figure, len(DERIVATIVES))
    for axes, peak in zip(panels, r.peaks, strict=True):
        curve = curves[peak.name]
        line(axes, time, curve, **style_of(0))
        jumps = "" if np.any(curve) else ": not limited, infinite where the derivative below jumps"
        axes.set(title=f"{peak.name}{jumps}", ylabel=peak.unit)
        axes.axhline(0.0, color="#999999", linewidth=0.6)
        for limit in (-peak.limit, peak.limit) if np.isfinite(peak.limit) else ():
            axes.axhline(limit, **BASELINE)
    panels[-1].set_xlabel("time, s")


FIGURES = {
    "derivatives": Drawn(
        f"Seven curves over time: {', '.join(DERIVATIVES)}", 8.6, _draw_derivatives, lambda r: not r.held
    ),
    "attitude": replace(OF_FLIGHTS["attitude"], holds=lambda r: not r.held),
    "rotation": replace(OF_FLIGHTS["rotation"], holds=lambda r: r.held),
}


@stage(
    PlannedPath,
    title="Training path",
    figures=FIGURES,
    words={"plain": plain, "axes": AXES, "effect_title": effect_title},
    study=True,
    overrides=option_overrides,
)
def trajectory(
    run: Run,
    waypoints: WaypointsOption = None,
    separate: SeparateOption = None,  # noqa: ARG001  # the config has it
    diagnosis: ForOption = None,
    box: BoxOption = None,
    height: HeightOption = None,
    duration: DurationOption = None,  # noqa: ARG001  # the config has it
    hover: HoverOption = None,  # noqa: ARG001
    repeat: RepeatOption = None,  # noqa: ARG001
    excite: ExciteOption = None,  # noqa: ARG001
    signal: SignalOption = None,
    band: BandOption = None,
    size: SizeOption = None,
    form: MissionOption = None,
    home: HomeOption = None,
    plot: PlotOption = False,
) -> PlannedPath | None:
    """Plan a path in space or the rotations of a held vehicle, and check it against the vehicle."""
    mission = mission_of(run.study, [each.value for each in form or []], home)
    settles = run.study.trajectory.path == "next-flight"
    if not settles:
        require_no_room(box, height)
        require_axes(run.study, signal=signal, band=band, size=size)
    settings = run.study.trajectory if settles else _settings(run.study, waypoints)
    names = () if not plot else ("rotation",) if settings.held else ("derivatives", "attitude")
    figures = [run.output.with_name(f"{run.output.stem}-{name}.svg") for name in names]
    texts = {run.sibling(f"{run.output.stem}-waypoints.csv"): "csv"} if settles else mission_paths(run, mission)
    check_outputs(run, *figures, *texts)
    if settles:
        # What reads diagnoses and models is loaded for no other path.
        planned: PlannedPath | None = import_module("cpfls_cli.stages._next_flight").planned(run, diagnosis)
    else:
        planned = _planned(run, settings, waypoints)
    written = None if planned is None else mission_texts(run, mission, planned, texts)
    if planned is None or written is None or run.dry_run:
        return None
    pictures = (picture_of(FIGURES[name], name, planned) for name in names)
    run.texts |= {path: each.svg for path, each in zip(figures, pictures, strict=True) if each}
    run.texts |= written
    if figures:
        run.say(f"drawn: {', '.join(map(str, figures))}")
    if texts:
        run.say(f"other files: {', '.join(map(str, texts))}")
    for sentence in mission_words(mission.forms, planned):
        run.say(sentence)
    run.also = {"figures": [str(path) for path in figures], "files": [str(path) for path in texts]}
    run.go_on("simulate", run.output, output=run.sibling("flight.h5"))
    return planned


def _planned(run: Run, settings: TrajectorySettings, waypoints: Path | None) -> PlannedPath | None:
    run.take({"waypoints": waypoints} if waypoints else {})
    require_numbers(run, "trajectory", whole=not settings.held)
    # To optimise takes long; what else can go wrong shows only when it is planned.
    if run.dry_run and settings.path == "optimised":
        return None
    with settings_of("trajectory", run.study):
        planned, at, excitation, excited = _flight(run, settings)
        demand, problems = _demand(run.study, settings, planned, at)
    if problems and settings.infeasible == "stop":
        change = f"{_remedy(run.study, settings)}, change the vehicle, or set trajectory.infeasible: report"
        raise ComputationError("\n".join([*problems, f"{run.output}: no path was written; {change}"]))
    for problem in problems:
        run.note(problem)
    if run.study.vehicle.unknown and run.open_numbers == "refused":
        unknown = joined(name.replace("_", " ") for name in run.study.vehicle.unknown)
        run.note(f"{unknown}: null in the config; what the path asks of the rotors was checked with guesses")
    return PlannedPath.of(planned, demand, settings, excitation=excitation, excited=excited)


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


def _flight(
    job: Run, settings: TrajectorySettings
) -> tuple[PlannedRotation, PlanAt, Excitation | None, Excited | None]:
    """Give a path as it is to be flown, all runs of it, with what is optimised of a held vehicle and what is added.

    The function samples it anew, two runs at most, for a look between its samples.
    """
    if settings.held:
        with settings_of("trajectory.rotation", job.study):
            path, excitation = _rotation(job, settings)
        planned = held_rotation(path, settings.sample_time_s)
        return planned, lambda sample_time: held_rotation(path, sample_time), excitation, None
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
        return without, at, None, None
    excited = repeated(room.added.onto(plain, gravity), settings, gravity)
    return excited, at, None, Excited.of(settings.excite, excited, without, room)


def _rotation(job: Run, settings: TrajectorySettings) -> tuple[RotationPath, Excitation | None]:
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

    Errors name the file and the column or the row that is wrong. `paused` says whether the points may have pauses.
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
