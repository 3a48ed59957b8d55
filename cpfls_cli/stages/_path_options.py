"""Options of the command `trajectory`: as typed, as overrides of the config, and what makes no sense together."""

from __future__ import annotations

from enum import StrEnum
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cpfls_cli.errors import InputError

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
    hover: float | None,
    repeat: int | None,
    excite: str | None,
    signal: Signal | None,
    band: str | None,
    size: float | None,
    **_: Any,
) -> list[str]:
    """Write the options as overrides of the config, ``section.key=value`` each, so that the file's config has them."""
    settles = to_tell is not None or diagnosis is not None
    if settles and waypoints is not None:
        raise InputError(f"--waypoints {waypoints}: --to-tell and --for choose the path themselves; leave it out")
    others = {
        f"--waypoints {waypoints}": waypoints is not None,
        "--to-tell and --for": settles,
        f"--duration {duration or 0:g}": duration is not None,
    }
    for other, given in others.items():
        if given and hover is not None:
            raise InputError(f"--hover {hover:g}: stays at one place for so long; leave out {other}")
    length = duration if hover is None else hover
    paths = {"next-flight": settles, "waypoints": waypoints is not None, "hover": hover is not None}
    lists = {"next_flight.to_tell": to_tell, "next_flight.box_m": box, "excite.axes": excite, "excite.band_hz": band}
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
                f"{option} {value}: is room for the flight that --to-tell or --for plans, and this path is planned "
                "without; give one of them, or set trajectory.displacement_m and trajectory.direction"
            )


def require_axes(study: Study, **given: object) -> None:
    """Refuse what describes an excitation where there is none."""
    for option, value in given.items():
        if value is not None and not study.trajectory.excite.axes:
            raise InputError(f"--{option} {value}: describes an excitation; say which axes with --excite AXES")
