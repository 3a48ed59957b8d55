"""NanoBench: flights of a Crazyflie 2.1 with brushed motors, which log their commands alone."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter, medfilt
from scipy.spatial.transform import Rotation

from cpfls_cli.arrays import Array
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.kernels import MeasuredMotion
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings

PERIOD = 0.01
MASS, ARM, INERTIA = 0.027, 0.0325, 1.66e-5
"""As the data set states it, half the distance of neighbouring motors, and about roll and pitch as published for the
type at 28 g."""
YAW_INERTIA, THRUST_FACTOR, LEVER = 2.93e-5, 2.88e-8, 0.006
"""About yaw as published; rotors as usual for the type, whose commands tell nothing about them."""
GRAVITY = 9.81
EXPONENT, MOTOR_LAG_S = 1.4, 0.07
"""Of the thrust by the command, as the accelerometer shows it from 0.4 to 2.5 Hz, and how late it follows; 40 to 90 ms
fit the turning as well."""
_FULL = 65535.0
_ALOFT_M, _AFTER, _BEFORE, _SHORTEST = 0.6, 150, 50, 800
_SATURATED = 0.06
"""Flights whose motors stand at full command for longer are left out, share of the time."""


HUBS = (((ARM, -ARM), -1), ((-ARM, -ARM), 1), ((-ARM, ARM), -1), ((ARM, ARM), 1))
VEHICLE = VehicleSettings(
    mass_kg=MASS,
    inertia_kg_m2=(INERTIA, INERTIA, YAW_INERTIA),
    rotor_speed_max_rad_s=3500.0,
    rotors=tuple(
        RotorSettings(
            position_m=(*hub, 0.0),
            spin=spin,
            thrust_factor_n_s2=THRUST_FACTOR,
            drag_factor_n_m_s2=LEVER * THRUST_FACTOR,
        )
        for hub, spin in HUBS
    ),
)


class Commanded(NamedTuple):
    """A flight of which the motors' commands are known.

    Attributes
    ----------
    path : str
        What is flown, and how fast.
    thrust : array, shape (time,), N
        As the accelerometer feels it.
    torque : array, shape (time, 2), N m
        About roll and pitch: the difference that the commands make, in proportion to that thrust.
    """

    name: str
    path: str
    motion: MeasuredMotion
    thrust: Array
    torque: Array


def commanded_flights(folder: Path) -> Iterator[Commanded]:
    """Read the flights of a folder, each once: the data set holds some twice under different names."""
    seen: set[bytes] = set()
    for path in sorted(folder.glob("*_rep*.csv")):
        with path.open(newline="") as stream:
            columns = next(csv.reader(stream))
        values = np.genfromtxt(path, delimiter=",", skip_header=1)
        content = values.tobytes()
        flight = None if content in seen else _flight(path.stem, dict(zip(columns, values.T, strict=True)))
        seen.add(content)
        if flight is not None:
            yield flight


def playback_of(flight: Commanded) -> PlaybackFlight:
    """Give the rotor speeds that thrust and torque stand for; about yaw they turn nothing."""
    about_roll, about_pitch = (flight.torque / ARM).T
    each = np.stack(
        [
            flight.thrust - about_roll - about_pitch,
            flight.thrust - about_roll + about_pitch,
            flight.thrust + about_roll + about_pitch,
            flight.thrust + about_roll - about_pitch,
        ],
        axis=1,
    )
    speed = np.sqrt(np.maximum(0.25 * each, 0.0) / THRUST_FACTOR)
    whole = (slice(0, len(speed)),)
    return PlaybackFlight(name=flight.name, motion=flight.motion, speed=speed, hold="previous", stretches=whole)


def _flight(name: str, logged: dict[str, Array]) -> Commanded | None:
    """Cut a flight to where it is aloft; None where that is short or the motors saturate."""
    command = np.stack([logged[f"motor_motor_m{motor}"] for motor in (1, 2, 3, 4)], axis=1) / _FULL
    command = medfilt(command, (5, 1)) if command.max() > 1.01 else command
    aloft = np.flatnonzero((logged["pz"] > _ALOFT_M) & (command.min(axis=1) > 0.1))
    longest = max(np.split(aloft, np.flatnonzero(np.diff(aloft) > 5) + 1), key=len)
    part = slice(longest[0] + _AFTER, longest[-1] - _BEFORE) if len(longest) else slice(0)
    command = command[part]
    if len(command) < _SHORTEST or command.max() > 1.05 or (command > 0.999).mean(axis=0).max() > _SATURATED:
        return None
    position, velocity, quaternion, rate, felt = (
        np.ascontiguousarray(np.stack([logged[column][part] for column in columns], axis=1))
        for columns in (
            ("px", "py", "pz"),
            ("vx", "vy", "vz"),
            ("qx", "qy", "qz", "qw"),
            ("imu_gyro_x", "imu_gyro_y", "imu_gyro_z"),
            ("imu_acc_z",),
        )
    )
    each = late_by_lag(np.clip(command, 0.05, 1.0) ** EXPONENT, MOTOR_LAG_S)
    thrust = MASS * GRAVITY * late_by_lag(np.clip(felt[:, 0], 0.5, 1.6), 0.03)
    front_right, back_right, back_left, front_left = each.T * (ARM * thrust / each.sum(axis=1))
    torque = np.stack(
        [back_left + front_left - front_right - back_right, back_right + back_left - front_right - front_left], axis=1
    )
    motion = MeasuredMotion(position, velocity, Rotation.from_quat(quaternion).as_matrix(), rate, PERIOD)
    return Commanded(name, re.sub(r"_rep\d+$", "", name), motion, thrust, torque)


def late_by_lag(values: Array, lag_s: float) -> Array:
    """Let values pass a first-order lag, along the first axis."""
    if lag_s <= 0:
        return values
    kept = np.exp(-PERIOD / lag_s)
    return np.asarray(lfilter([1 - kept], [1, -kept], values, axis=0, zi=kept * values[:1])[0])
