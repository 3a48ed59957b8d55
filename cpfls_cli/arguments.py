"""Arguments and options that several commands take, as their command lines declare them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from cpfls_cli.logs.formats import formats_in_words, suffixes_in_words

_SECONDS = {"s": 1.0, "m": 60.0, "h": 3600.0}


def seconds(text: str) -> float:
    """Read a duration in s, such as ``90``, ``90s``, ``10m`` or ``2h``."""
    unit = _SECONDS.get(text[-1:])
    try:
        value = float(text if unit is None else text[:-1]) * (unit or 1.0)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise typer.BadParameter(f"{text!r} is not a duration; write 90, 90s, 10m or 2h")
    return value


def moments(text: str | Sequence[float]) -> tuple[float, float, float]:
    """Read three moments of inertia, such as ``0.011,0.012,0.02``.

    Returns
    -------
    tuple of float, kg m^2
    """
    try:
        x, y, z = (float(part) for part in (text.split(",") if isinstance(text, str) else text))
    except ValueError:
        x = y = z = math.nan
    if not all(0.0 < value < math.inf for value in (x, y, z)):
        raise typer.BadParameter(f"{text!r} is not three moments of inertia above 0; write IXX,IYY,IZZ in kg m^2")
    return x, y, z


FlownArgument = Annotated[
    Path,
    typer.Argument(
        metavar="TRAJECTORY", help="Made by `cpfls trajectory`; or a flight or log, whose setpoints --autopilot flies."
    ),
]
TrainingArgument = Annotated[
    list[Path], typer.Argument(metavar="FLIGHT", help="Made by `cpfls simulate` or `cpfls import`; one or more.")
]
LogArgument = Annotated[Path, typer.Argument(metavar="LOG", help=f"Flight log: {suffixes_in_words()}.")]
FileArgument = Annotated[Path, typer.Argument(metavar="FILE", help="Any artifact.")]
FlightsArgument = Annotated[
    list[Path],
    typer.Argument(metavar="FLIGHT", help=f"Flights, or logs ({formats_in_words()}) that the config describes."),
]
DisagreementArgument = Annotated[Path, typer.Argument(metavar="DISAGREEMENT", help="Made by `cpfls compare`.")]
DiagnosisArgument = Annotated[Path, typer.Argument(metavar="DIAGNOSIS", help="Made by `cpfls diagnose`.")]
FolderOption = Annotated[
    Path, typer.Option("--output", "-o", metavar="FOLDER", help="Folder to fill.", show_default=False)
]
ModelOption = Annotated[
    Path | None,
    typer.Option(
        "--model",
        metavar="MODEL",
        help="Made by `cpfls identify` or `vehicle` (`compare` takes one of `extend` too); default: the vehicle of "
        "the config.",
    ),
]
WriteConfigOption = Annotated[
    Path | None,
    typer.Option(
        "--write-config", metavar="FILE", help="Write the config again with the numbers of a finished search."
    ),
]
HeldOutOption = Annotated[
    list[Path] | None,
    typer.Option("--held-out", metavar="FLIGHT", help="Judge on this flight, learn nothing from it; may be repeated."),
]
ValidateOption = Annotated[
    list[Path] | None,
    typer.Option("--validate", metavar="FLIGHT", help="Judge on another flight too; may be repeated."),
]
ChooseOnOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--choose-on",
        metavar="FLIGHT",
        help="Choose the model on this flight (identification.choice: held-out); may be repeated.",
    ),
]
ResumeOption = Annotated[
    bool, typer.Option("--resume", help="Go on with a search that was stopped, from OUTPUT.checkpoint.")
]
TimeLimitOption = Annotated[
    float | None,
    typer.Option(
        "--time-limit",
        metavar="TIME",
        parser=seconds,
        help="Stop the search after TIME (90, 90s, 10m, 2h) and write the best so far; --resume goes on.",
    ),
]
AnywayOption = Annotated[
    bool,
    typer.Option(
        "--anyway",
        help="Search in logs that contradict themselves, or are too slow to identify what is sought, too; nothing "
        "found there is to be used.",
    ),
]
QuickOption = Annotated[
    bool,
    typer.Option(
        "--quick",
        help="Give a first answer: named effects alone, judged on at most 100 windows, no forecast by the past.",
    ),
]
ExportAnywayOption = Annotated[
    bool,
    typer.Option(
        "--anyway",
        help="Also where numbers of the model are impossible, its search was stopped or its verdict is do-not-use; the "
        "file says so first.",
    ),
]
PlayedArgument = Annotated[
    Path,
    typer.Argument(
        metavar="MODEL",
        help="Made by `cpfls identify`, `extend` or `vehicle`; or the word vehicle: that of the config.",
    ),
]
JudgedOption = Annotated[
    Path | None,
    typer.Option(
        "--model",
        metavar="MODEL",
        help="Made by `cpfls identify`, `extend` or `vehicle`; default: the vehicle of the config.",
    ),
]
HorizonOption = Annotated[
    float | None,
    typer.Option("--horizon", metavar="TIME", parser=seconds, help="Longest horizon (1, 1s); default: half a second."),
]
HistoryOption = Annotated[
    float | None,
    typer.Option(
        "--history",
        metavar="TIME",
        parser=seconds,
        help="Use so much of the flight before each start too (0.5, 0.5s), where `cpfls vehicle` found a forecast "
        "for that.",
    ),
]
EveryOption = Annotated[int, typer.Option("--every", metavar="N", min=1, help="Begin at every N-th sample.")]

Between = StrEnum("Between", "linear previous")
"""What a rotor speed is between samples."""

HoldOption = Annotated[
    Between | None,
    typer.Option(
        "--hold",
        help="Between samples a rotor speed is a straight line, or its last value; default: the first for measured "
        "speeds, the second for commands.",
    ),
]

TimeOrder = StrEnum("TimeOrder", "date name given")
"""What shows which flight came first."""
AutopilotChoice = StrEnum("AutopilotChoice", "px4 ardupilot betaflight crazyflie")
"""Whose control law is meant."""

WorkersOption = Annotated[int, typer.Option("--workers", metavar="N", min=1, help="Processes that evaluate.")]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler", metavar="ADDRESS", help="Evaluate on the workers of this Dask scheduler (tcp://host:port)."
    ),
]

OtherVehicleOption = Annotated[
    bool,
    typer.Option("--anyway", help="Compare flights even where their logs say that they are of different vehicles."),
]
