"""Options of the command `trajectory`, which plans paths of many kinds."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Signal(StrEnum):
    """What excites a path."""

    MULTISINE = "multisine"
    LINEAR = "sweep-linear"
    LOGARITHMIC = "sweep-logarithmic"


MissionFormat = StrEnum("MissionFormat", "csv px4 ardupilot")
"""What a path is written as for an autopilot."""

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
