"""What PX4 logged before ULog: messages without stamps, behind one that holds the time, as topics that ULog has."""

from collections.abc import Mapping, Sequence
from math import nan
from pathlib import Path
from typing import Any, Final

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.topics import STAMP
from cpfls_cli.logs.formats import LogContents
from cpfls_cli.logs.records import date, numbers, seconds

_CLOCK, _START, _PER_SECOND = "TIME", "StartTime", 10**6
_AXES: Final = ("Roll", "Pitch", "Yaw")


def _counted(field: str, *spellings: str) -> dict[str, tuple[str, ...]]:
    """Name fields of an array by what a message calls each of its numbers, with another spelling of it or two."""
    columns = [spelling.split(",") for spelling in spellings]
    return {f"{field}[{each}]": own for each, own in enumerate(zip(*columns, strict=True))}


# Of each topic the message that holds it, and of each of its fields what versions call it.
_TOPICS: Final[dict[str, tuple[str, dict[str, tuple[str, ...]]]]] = {
    "vehicle_attitude": ("ATT", {name: (name,) for name in _AXES}),
    "sensor_combined": (
        "IMU",
        _counted("gyro_rad", "GyroX,GyroY,GyroZ") | _counted("accelerometer_m_s2", "AccX,AccY,AccZ"),
    ),
    "actuator_outputs": ("OUT0", _counted("output", ",".join(f"Out{each}" for each in range(8)))),
    "actuator_controls_0": ("ATTC", _counted("control", "Roll,Pitch,Yaw,Thrust", "Ch0,Ch1,Ch2,Ch3")),
    "vehicle_rates_setpoint": ("ARSP", {name.lower(): (f"{name}RateSP",) for name in _AXES}),
    "vehicle_attitude_setpoint": ("ATSP", {f"{name.lower()}_body": (f"{name}SP",) for name in _AXES}),
    "vehicle_local_position": ("LPOS", {name.lower(): (name,) for name in ("X", "Y", "Z", "VX", "VY", "VZ")}),
    "battery_status": ("BATT", {"voltage_v": ("V",), "voltage_filtered_v": ("VFilt",), "current_a": ("C",)}),
    "vehicle_status": (
        "STAT",
        {
            "nav_state": ("NavState", "MainState"),
            "arming_state": ("ArmS", "ArmState"),
            "failsafe": ("Failsafe", "FailsafeState"),
        },
    ),
    "vehicle_land_detected": ("STAT", {"landed": ("Landed",)}),
    "vehicle_gps_position": ("GPS", {"time_utc_usec": ("GPSTime",)}),
}


def is_sdlog2(tables: Mapping[str, np.ndarray]) -> bool:
    """Tell messages of PX4 from those of ArduPilot, which have stamps of their own."""
    return _CLOCK in tables and _holds(tables[_CLOCK], _START, "iu")


def of_messages(
    path: Path,
    places: Mapping[str, Sequence[int]],
    tables: Mapping[str, np.ndarray],
    parameters: dict[str, float | str],
) -> LogContents:
    """Give messages, which begin at some places of the file, the time that was written before them."""
    origin = int(tables[_CLOCK][_START][0])
    clock = seconds(tables[_CLOCK][_START], origin, _PER_SECOND)
    topics: dict[str, dict[str, Array]] = {}
    for topic, (message, spellings) in _TOPICS.items():
        own = tables.get(message, np.empty(0, dtype=[]))
        held = {name: next((each for each in named if _holds(own, each)), "") for name, named in spellings.items()}
        if not all(held.values()) and topic != "vehicle_status":
            continue
        at = np.searchsorted(places[_CLOCK], places.get(message, ())) - 1
        # What comes before the first time has none.
        fields = {name: numbers(own[field][at >= 0]) for name, field in held.items() if field}
        if (at >= 0).any() and fields:
            topics[topic] = {STAMP: clock[at[at >= 0]], **fields}
    if "vehicle_attitude" not in topics:
        raise InputError(f"{path}: a log of PX4 before ULog (sdlog2), without the attitude (ATT)")
    _turn_to_quaternions(topics["vehicle_attitude"])
    stated: dict[str, Any] = {"system": "PX4", "flown_at": _flown_at(topics), "begins": {"": origin / _PER_SECOND}}
    return LogContents(topics, {}, parameters, **stated)


def _holds(table: np.ndarray, field: str, kinds: str = "iuf") -> bool:
    """Tell whether a message has a field that is a number, which a damaged log may describe as text."""
    return field in (table.dtype.names or ()) and table.dtype[field].kind in kinds


def _turn_to_quaternions(attitude: dict[str, Array]) -> None:
    """Compute the quaternion that later versions log; those in between leave it 0."""
    from scipy.spatial.transform import Rotation

    angles = np.column_stack([attitude.pop(name) for name in reversed(_AXES)])
    x, y, z, w = Rotation.from_euler("ZYX", np.nan_to_num(angles)).as_quat().T
    attitude |= {f"q[{each}]": np.asarray(own) for each, own in enumerate((w, x, y, z))}


def _flown_at(topics: Mapping[str, Mapping[str, Array]]) -> float:
    receiver = topics.get("vehicle_gps_position", {STAMP: np.empty(0), "time_utc_usec": np.empty(0)})
    begins = receiver["time_utc_usec"] / _PER_SECOND - receiver[STAMP]
    return next((at for at in map(date, begins) if np.isfinite(at)), nan)
