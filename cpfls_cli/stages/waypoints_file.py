"""Waypoints in CSV, as settings."""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError, SettingError
from cpfls_cli.stages.table import read_csv, row_lines
from cpfls_cli.trajectory.consistency import check_waypoints
from cpfls_cli.trajectory.settings import WaypointSettings

_POSITION = ("x_m", "y_m", "z_m")
_OPTIONAL = ("yaw_rad", "pause_s")


def read_waypoints(path: Path, paused: bool) -> tuple[WaypointSettings, ...]:
    """Read the points of a path.

    Parameters
    ----------
    path : Path
        ``.csv`` with one line of names: ``x_m, y_m, z_m`` and, if wanted, ``yaw_rad`` and ``pause_s``.
    paused : bool
        Whether the points may have pauses of their own.

    Raises
    ------
    InputError
        Naming the file and the column or the row that is wrong.
    """
    columns = read_csv(path, {*_POSITION, *_OPTIONAL})
    _check_columns(path, columns)
    lines = row_lines(path)
    _check_values(path, columns, lines)
    count = len(columns[_POSITION[0]])
    yaw = columns["yaw_rad"].tolist() if "yaw_rad" in columns else [None] * count
    pause = columns.get("pause_s", np.zeros(count)).tolist()
    positions = zip(*(columns[name].tolist() for name in _POSITION), strict=True)
    points = zip(positions, yaw, pause, strict=True)
    waypoints = tuple(WaypointSettings(position_m=p, yaw_rad=angle, pause_s=rest) for p, angle, rest in points)
    try:
        check_waypoints(waypoints, paused)
    except SettingError as error:
        raise InputError(f"{path}{_place(error.key, lines)}: {error}") from None
    return waypoints


def _check_columns(path: Path, columns: dict[str, Array]) -> None:
    known = (*_POSITION, *_OPTIONAL)
    missing = [name for name in _POSITION if name not in columns]
    unknown = [name for name in columns if name not in known]
    problems = [f"{path}: column '{name}' is missing; waypoints need {', '.join(_POSITION)}" for name in missing]
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
            found = "is empty or not a number" if np.isnan(values[row]) else f"= {values[row]:g}"
            problems.append(f"{path}:{lines[row]}: column '{name}' {found}: give {expected}")
    if problems:
        raise InputError("\n".join(problems))


def _place(key: str, lines: list[int]) -> str:
    """Line and column of an entry such as ``waypoints.3.position_m``."""
    parts = key.split(".")
    if len(parts) < 3:
        return ""
    column = {"position_m": ", ".join(_POSITION)}.get(parts[2], parts[2])
    return f":{lines[int(parts[1])]}: {column}"
