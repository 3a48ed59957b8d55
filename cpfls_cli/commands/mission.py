"""Files of a planned path for autopilots, beside its artifact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cpfls_cli.artifacts.job import Job
from cpfls_cli.artifacts.trajectory import TrajectoryRecord
from cpfls_cli.config.study import Study
from cpfls_cli.errors import InputError
from cpfls_cli.export.mission import Home, qgc_plan, system_id_lines, waypoint_lines

CSV, PX4, ARDUPILOT = "csv", "px4", "ardupilot"


@dataclass(frozen=True)
class Mission:
    """Files for autopilots that are asked for.

    Attributes
    ----------
    forms : tuple of str
        Some of csv, px4, ardupilot.
    home : Home or None
        Place of the path on earth, for a mission.
    """

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


def mission_texts(job: Job, mission: Mission, record: TrajectoryRecord) -> dict[Path, str]:
    """Write a path as the files that are asked for."""
    vehicle = job.study.vehicle
    most = sum(rotor.thrust_factor_n_s2 for rotor in vehicle.rotors) * vehicle.rotor_speed_max_rad_s**2
    hover = vehicle.mass_kg * vehicle.gravity_m_s2 / most
    run = float(record.time[-1] if record.run is None else record.run.end[0])
    texts, axes = {}, iter(() if record.excited is None else record.excited.axis)
    for path, form in mission_paths(job, mission).items():
        if form == CSV:
            texts[path] = waypoint_lines(record)
        elif form == PX4:
            assert mission.home is not None, "asked for before"
            texts[path] = qgc_plan(record, mission.home)
        else:
            assert record.excited is not None, "asked for before"
            texts[path] = system_id_lines(record.excited, next(axes), run, hover)
    return texts
