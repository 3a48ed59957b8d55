"""Files of a planned path for autopilots, next to its artifact."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cpfls_cli.artifacts.job import Job
from cpfls_cli.config.study import Study
from cpfls_cli.errors import InputError
from cpfls_cli.export.mission import Home, qgc_plan, system_id_lines, waypoint_lines
from cpfls_cli.flights.path import PlannedPath

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
