"""A planned path for autopilots: points of time as CSV, a mission for PX4, sweeps for ArduPilot's System ID mode."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, degrees, pi, radians, sin, sqrt, tan
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.export.text import number, strict_json
from cpfls_cli.flights.path import Excited, PlannedPath
from cpfls_cli.trajectory.excited import fade_time

_STEP_S = 0.1
_SAMPLES_IN_A_PERIOD = 20
_POINTS = ("time_s", "x_m", "y_m", "z_m", "yaw_rad", "vx_m_s", "vy_m_s", "vz_m_s")
_MORE = ("ax_m_s2", "ay_m_s2", "az_m_s2", "roll_rad", "pitch_rad")
_ADDED = ("roll_added_rad", "pitch_added_rad", "yaw_added_rad", "ax_added_m_s2", "ay_added_m_s2", "az_added_m_s2")

# WGS 84: semi-major axis in m, and the square of the eccentricity.
_EQUATOR_M, _FLAT = 6378137.0, 6.69437999014e-3
_LEAST_HOLD_S = 1.0
# Commands and frames of MAVLink, and what QGroundControl calls PX4, a multirotor, and a height above home.
_WAYPOINT, _RETURN, _TAKEOFF, _CHANGE_SPEED = 16, 20, 22, 178
_ABOVE_HOME, _NO_PLACE = 3, 2
_PX4, _MULTIROTOR, _RELATIVE = 12, 2, 1

SYSTEM_ID_AXES = {"roll": 7, "pitch": 8, "yaw": 9, "vertical": 13}
"""ArduPilot's SID_AXIS: body rates, which a sweep of equal rates is one of, and the thrust of the mixer."""

_LONGEST_RECORD_S, _LONGEST_RISE_S, _LONGEST_FALL_S = 255.0, 20.0, 5.0
_SID_FREQUENCIES = (0.01, 100.0)
_STEADY_PERIODS = 2.0
"""Periods of the lowest frequency that ArduPilot holds it for, before it sweeps."""


@dataclass(frozen=True)
class Home:
    """Place of a path on earth.

    Attributes
    ----------
    latitude, longitude : float, degrees
        Of x = y = 0; x points east, y north.
    height : float, m
        Of z = 0 above the place of take-off.
    """

    latitude: float
    longitude: float
    height: float


def waypoint_lines(record: PlannedPath) -> str:
    """Write a path as CSV: time, position, yaw, velocity; of an excited one acceleration, attitude, what is added."""
    assert record.position is not None, "a path in space"
    assert record.velocity is not None, "a path in space"
    names: tuple[str, ...] = _POINTS
    columns = [record.time[:, None], record.position, record.yaw[:, None], record.velocity]
    step, excited = _STEP_S, record.excited
    if excited is not None:
        assert record.acceleration is not None, "a path in space"
        step = min(step, 1 / (_SAMPLES_IN_A_PERIOD * float(excited.band_hz[1])))
        columns += [record.acceleration, record.attitude[:, :2], excited.attitude, excited.acceleration]
        names = (*_POINTS, *_MORE, *_ADDED)
    rows = np.concatenate(columns, axis=1)[:: max(1, round(step / float(record.time[1])))]
    return "\n".join([",".join(names), *(",".join(f"{value:.6f}" for value in row) for row in rows)]) + "\n"


def qgc_plan(record: PlannedPath, home: Home) -> str:
    """Write the points at which a path rests as a mission for PX4, in the file format of QGroundControl.

    Raises
    ------
    InputError
        If the path is none of moves from rest to rest, is excited, or goes below the ground.

    References
    ----------
    QGroundControl developer guide, Plan file format; MAVLink, MAV_CMD.
    """
    _refuse_no_points(record, home)
    points = list(_rests(record))
    height = home.height + points[0][1][2]
    speed = float(np.linalg.norm(np.asarray(record.velocity), axis=1).max())
    items = [_item(1, _TAKEOFF, [0, 0, 0, None, *_on_earth(home, points[0][1]), height], height)]
    if speed:
        # Of the ground, as fast as that, throttle as it is.
        items.append(_item(2, _CHANGE_SPEED, [1, round(speed, 3), -1, 0, 0, 0, 0]))
    for rest, place, yaw in points:
        height = round(home.height + float(place[2]), 4)
        heading = round((90.0 - degrees(yaw)) % 360.0, 3)
        hold = round(max(rest, _LEAST_HOLD_S), 3)
        items.append(_item(len(items) + 1, _WAYPOINT, [hold, 0, 0, heading, *_on_earth(home, place), height], height))
    items.append(_item(len(items) + 1, _RETURN, [0] * 7))
    mission = {
        "cruiseSpeed": 15,
        "firmwareType": _PX4,
        "globalPlanAltitudeMode": _RELATIVE,
        "hoverSpeed": round(speed, 3) or 5,
        "items": items,
        "plannedHomePosition": [home.latitude, home.longitude, 0],
        "vehicleType": _MULTIROTOR,
        "version": 2,
    }
    return strict_json(
        {
            "fileType": "Plan",
            "geoFence": {"circles": [], "polygons": [], "version": 2},
            "groundStation": "QGroundControl",
            "mission": mission,
            "rallyPoints": {"points": [], "version": 2},
            "version": 1,
        }
    )


def _refuse_no_points(record: PlannedPath, home: Home) -> None:
    assert record.position is not None, "a path in space"
    if record.excited is not None:
        raise InputError("--format px4: a mission of waypoints holds no excitation; leave out --excite, or use csv")
    if not record.legs and float(np.ptp(record.position, axis=0).max()):
        raise InputError("--format px4: this path is a curve, but a mission flies from point to point; use csv")
    lowest = home.height + float(record.position[:, 2].min())
    if lowest <= 0:
        raise InputError(
            f"--home: {home.height:g} m above take-off is too low: the path descends to {lowest:g} m; raise the "
            "third number"
        )


def _rests(record: PlannedPath) -> Iterator[tuple[float, Array, float]]:
    """List how long a path rests, s, where, m, and at which yaw, rad: at its start and at the end of each move."""
    assert record.position is not None, "a path in space"
    begins = [0.0, *(move.end_s for move in record.legs)]
    ends = [*(move.begin_s for move in record.legs), float(record.time[-1])]
    for begin, end in zip(begins, ends, strict=True):
        sample = int(np.searchsorted(record.time, 0.5 * (begin + max(end, begin)), side="right")) - 1
        sample = min(max(sample, 0), len(record.time) - 1)
        yield float(end - begin), record.position[sample], float(record.yaw[sample])


def _item(number: int, command: int, parameters: list[Any], height: float | None = None) -> dict[str, Any]:
    place = {} if height is None else {"AMSLAltAboveTerrain": None, "Altitude": height, "AltitudeMode": _RELATIVE}
    return {
        **place,
        "autoContinue": True,
        "command": command,
        "doJumpId": number,
        "frame": _NO_PLACE if height is None else _ABOVE_HOME,
        "params": parameters,
        "type": "SimpleItem",
    }


def _on_earth(home: Home, place: Array) -> tuple[float, float]:
    """Latitude and longitude of a place, degrees, on the plane that touches the ellipsoid at home."""
    latitude = radians(home.latitude)
    square = 1.0 - _FLAT * sin(latitude) ** 2
    north, east = _EQUATOR_M * (1.0 - _FLAT) / (square * sqrt(square)), _EQUATOR_M / sqrt(square)
    longitude = home.longitude + degrees(float(place[0]) / (east * cos(latitude)))
    return round(home.latitude + degrees(float(place[1]) / north), 9), round(longitude, 9)


def system_id_lines(excited: Excited, axis: str, run: float, hover: float) -> str:
    """Write a sweep of one axis for ArduPilot's System ID mode as a parameter file.

    Parameters
    ----------
    axis : str
        One of those excited.
    run : float, s
        Duration of one run.
    hover : float
        Thrust in hover over the largest.

    Raises
    ------
    InputError
        If a number is beyond what ArduPilot takes.

    References
    ----------
    ArduPilot, Copter, System ID mode: parameters SID_*.
    """
    low, high = (float(value) for value in excited.band_hz)
    length = run / (1 if excited.signal == "multisine" else len(excited.axes))
    fade = fade_time(low, length)
    thrust, size = axis == "vertical", float(excited.size_rad[excited.axes.index(axis)])
    magnitude = hover * tan(size) if thrust else degrees(size) * 2 * pi * low
    _refuse_record(length, low, high)
    values = {
        "SID_AXIS": SYSTEM_ID_AXES[axis],
        "SID_MAGNITUDE": magnitude,
        "SID_F_START_HZ": low,
        "SID_F_STOP_HZ": high,
        "SID_T_FADE_IN": min(fade, _LONGEST_RISE_S),
        "SID_T_REC": length,
        "SID_T_FADE_OUT": min(fade, _LONGEST_FALL_S),
    }
    head = (
        f"# ArduPilot System ID mode (25): a logarithmic sweep of {axis}, {low:g} to {high:g} Hz.",
        f"# SID_MAGNITUDE: {'share of the thrust' if thrust else 'deg/s, body rate'}; times: s.",
        "# SID_T_REC and the others exist once SID_AXIS is not 0: load, read all parameters again, load again.",
        "# Hover high and in still air, log at full rate (LOG_BITMASK, fast attitude), switch to the mode: it starts",
        "# after 1 s and stops by itself. Switch away at once if it drifts. Each switch to the mode is another run.",
    )
    return "\n".join([*head, *(f"{name},{number(value, '.6g')}" for name, value in values.items())]) + "\n"


def _refuse_record(length: float, low: float, high: float) -> None:
    if length > _LONGEST_RECORD_S:
        raise InputError(
            f"--format ardupilot: a sweep of {length:g} s; SID_T_REC allows {_LONGEST_RECORD_S:g} at most: lower "
            "--duration"
        )
    if length <= _STEADY_PERIODS / low:
        raise InputError(
            f"--format ardupilot: a sweep of {length:g} s; ArduPilot holds {low:g} Hz for {_STEADY_PERIODS / low:g} s "
            "before it sweeps: raise --duration, or the lowest frequency of --band"
        )
    least, most = _SID_FREQUENCIES
    if low < least or high > most:
        raise InputError(f"--format ardupilot: --band {low:g},{high:g}: SID_F_* allow {least:g} to {most:g} Hz")
