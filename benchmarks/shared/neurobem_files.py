"""Test segments of NeuroBEM with the predictions of BEM+NN, as MATLAB files, and the vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.playback.flight import MeasuredMotion, PlaybackFlight
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings

PERIOD, STEP = 0.0025, 4
"""Of the files, and every which sample is taken: 100 Hz."""

MASS, INERTIA = 0.772, (2.5e-3, 2.1e-3, 4.3e-3)
THRUST_FACTOR, TORQUE_OVER_THRUST = 1.5625e-6, 0.022
# The files do not say which rotor is which. In a regression of torque on the squared speeds, torque of the motion and
# of BEM+NN alike, each column pulls about roll and pitch like a rotor in one of the corners, and about yaw like these.
HUBS = (((-0.075, -0.1), -1), ((0.075, -0.1), 1), ((-0.075, 0.1), 1), ((0.075, 0.1), -1))
_FACTORS = {"thrust_factor_n_s2": THRUST_FACTOR, "drag_factor_n_m_s2": TORQUE_OVER_THRUST * THRUST_FACTOR}
VEHICLE = VehicleSettings(
    mass_kg=MASS,
    inertia_kg_m2=INERTIA,
    rotor_speed_max_rad_s=4000.0,
    rotors=tuple(RotorSettings(position_m=(*hub, 0.0), spin=spin, **_FACTORS) for hub, spin in HUBS),
)
NAMES = {
    "20210218170320seg2": "Figure_8_1",
    "20210218171908seg2": "Race_track_1",
    "20210218172600seg1": "Race_track_2",
    "20210223104803seg2": "Figure_8_2",
    "20210223114138seg3": "Melon_1",
    "20210223172724seg2": "Figure_8_4",
}
"""The segments that are measured on, by the names that the repository gives them; it lists seven more."""

_COLUMNS = 35
_ACCELERATION, _RATE, _QUATERNION = slice(1, 4), slice(4, 7), slice(7, 11)
_SPECIFIC_FORCE, _VELOCITY, _POSITION, _SPEED = slice(11, 14), slice(14, 17), slice(17, 20), slice(20, 24)
_FORCE, _TORQUE = slice(29, 32), slice(32, 35)


@dataclass(frozen=True)
class Segment:
    """A segment; what its motion takes by the stated mass and inertia, without weight, and what BEM+NN gives.

    Torque and force, shape (time, 6), N m and N, body frame. BEM+NN is given the measured state at every sample.
    """

    flight: PlaybackFlight
    wrench: Array
    hybrid: Array


def segments(folder: Path) -> list[Segment]:
    """Find and read the six segments in a folder and the folders below it, in order of their time."""
    found = {path.stem.removeprefix("bemnn"): path for path in folder.rglob("bemnn*.mat")}
    missing = [f"bemnn{key}.mat" for key in NAMES if key not in found]
    if missing:
        raise InputError(f"{folder}: {', '.join(missing)} neither in the folder nor below it")
    return [segment(found[key], name) for key, name in NAMES.items()]


def segment(path: Path, name: str) -> Segment:
    """Read a segment, every fourth sample."""
    values = [value for name, value in loadmat(path).items() if not name.startswith("_")]
    if len(values) != 1 or values[0].ndim != 2 or max(values[0].shape) < STEP or min(values[0].shape) < _COLUMNS:
        raise InputError(f"{path}: expected one matrix with {_COLUMNS} or more columns")
    table = np.array(values[0] if len(values[0]) > values[0].shape[1] else values[0].T, dtype=float)
    if np.any(np.abs(np.diff(table[:, 0]) - PERIOD) > 0.1 * PERIOD):
        raise InputError(f"{path}: expected a sample every {PERIOD} s")
    table = table[::STEP]
    attitude, rate = Rotation.from_quat(table[:, _QUATERNION]), np.ascontiguousarray(table[:, _RATE])
    motion = MeasuredMotion(
        np.ascontiguousarray(table[:, _POSITION]),
        np.ascontiguousarray(attitude.apply(table[:, _VELOCITY])),
        attitude.as_matrix(),
        rate,
        STEP * PERIOD,
    )
    speed = np.ascontiguousarray(table[:, _SPEED])
    inertia = np.array(INERTIA)
    torque = inertia * table[:, _ACCELERATION] + np.cross(rate, inertia * rate)
    return Segment(
        PlaybackFlight(name=name, motion=motion, speed=speed, hold="linear", stretches=(slice(0, len(speed)),)),
        np.hstack([torque, MASS * table[:, _SPECIFIC_FORCE]]),
        np.hstack([table[:, _TORQUE], table[:, _FORCE]]),
    )
