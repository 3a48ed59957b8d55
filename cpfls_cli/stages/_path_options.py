"""Options of `trajectory`: as typed, as overrides of the config, what makes no sense together, and the mission."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cpfls_cli.artifacts.job import Job
from cpfls_cli.config.study import Study
from cpfls_cli.errors import InputError
from cpfls_cli.export.mission import Home, qgc_plan, system_id_lines, waypoint_lines
from cpfls_cli.flights.path import PlannedPath

if TYPE_CHECKING:
    from cpfls_cli.config.study import Study


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
ToTellOption = Annotated[
    str | None,
    typer.Option("--to-tell", metavar="A,B", help="Plan the flight that tells these effects apart (`cpfls effects`)."),
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
        "--size",
        metavar="DEG",
        help="Its largest angle, degrees; smaller, with a warning, where the vehicle cannot.",
    ),
]
MissionOption = Annotated[
    list[MissionFormat] | None,
    typer.Option(
        "--format",
        help="For an autopilot, beside OUTPUT: the path as csv; a mission for px4 (QGroundControl); ardupilot: sweeps "
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
    bool, typer.Option("--plot", help="Draw the derivatives and the attitude, as SVG beside OUTPUT.")
]


def option_overrides(
    waypoints: Path | None,
    to_tell: str | None,
    diagnosis: Path | None,
    box: str | None,
    height: float | None,
    duration: float | None,
) -> list[str]:
    """Write the options as overrides of the config, so that the artifact's config has them too."""
    settles = to_tell is not None or diagnosis is not None
    if settles and waypoints is not None:
        raise InputError(f"--waypoints {waypoints}: --to-tell and --for choose the path themselves; leave it out")
    next_flight = {
        "to_tell": None if to_tell is None else f"[{to_tell}]",
        "box_m": None if box is None else f"[{box}]",
        "height_m": None if height is None else repr(float(height)),
    }
    path = "next-flight" if settles else "waypoints" if waypoints is not None else None
    return [
        *([] if path is None else [f"trajectory.path={path}"]),
        *(f"trajectory.next_flight.{key}={value}" for key, value in next_flight.items() if value is not None),
        *([] if duration is None else [f"trajectory.duration_s={float(duration)!r}"]),
    ]


def require_no_room(box: str | None, height: float | None) -> None:
    """Refuse room for a path that is not planned for it."""
    for option, value in (("--box", box), ("--height", height)):
        if value is not None:
            raise InputError(
                f"{option} {value}: is room for the flight that --to-tell or --for plans, and this path is planned "
                "without; give one of them, or set trajectory.displacement_m and trajectory.direction"
            )


@dataclass(frozen=True)
class Added:
    """Options of repeats and excitations, None where one is not given: band in Hz, size in degrees, hover in s."""

    repeat: int | None = None
    axes: str | None = None
    signal: str | None = None
    band: str | None = None
    size: float | None = None
    hover: float | None = None

    def overrides(self, waypoints: Path | None, settles: bool, duration: float | None) -> list[str]:
        """Write the options as overrides of the config, ``section.key=value`` each."""
        others = {
            f"--waypoints {waypoints}": waypoints is not None,
            "--to-tell and --for": settles,
            f"--duration {duration or 0:g}": duration is not None,
        }
        for other, given in others.items():
            if given and self.hover is not None:
                raise InputError(f"--hover {self.hover:g}: stays at one place for so long; leave out {other}")
        values = {
            "repeat": self.repeat,
            "excite.axes": None if self.axes is None else f"[{self.axes}]",
            "excite.signal": self.signal,
            "excite.band_hz": None if self.band is None else f"[{self.band}]",
            "excite.size_rad": None if self.size is None else repr(radians(self.size)),
            "duration_s": None if self.hover is None else repr(float(self.hover)),
            "path": None if self.hover is None else "hover",
        }
        return [f"trajectory.{key}={value}" for key, value in values.items() if value is not None]

    def require_axes(self, study: Study) -> None:
        """Refuse what describes an excitation where there is none."""
        given = {"--signal": self.signal, "--band": self.band, "--size": self.size}
        for option, value in given.items():
            if value is not None and not study.trajectory.excite.axes:
                raise InputError(f"{option} {value}: describes an excitation; say which axes with --excite AXES")


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
    """Name the files, and the form of each, beside the artifact; of ArduPilot one for each axis, named by it."""
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
