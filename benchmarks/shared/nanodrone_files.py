"""The nano-drone benchmark: its raw flights, prepared by the steps of its own notebook, and its vehicle.

The steps are those of `processing/csv_to_processed.ipynb` in idsia-robotics/nanodrone-sysid-benchmark, branch
model_export. Square flights are published there as prepared files, which are taken as they are; the third of them is
what these steps give. Filters run forward and backward: they know the future, as the benchmark's do.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet
from scipy.signal import butter, correlate, sosfiltfilt
from scipy.spatial.transform import Rotation

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.playback.flight import MeasuredMotion, PlaybackFlight
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings

TRAINING = (
    *(f"square_20251017_run{run}" for run in (1, 2, 3)),
    *(f"{kind}_20251017_run{run}" for kind in ("multisine", "random2", "random1") for run in (1, 2, 3, 4)),
)
TEST = tuple(f"melon_20251017_run{run}" for run in (1, 4, 5))
WHERE = ("data/real/raw/parquets", "data/sim", "data/sim/old", "")
WHERE_PREPARED = ("data/real/processed/train", "")
PLANS = {"multisine": "chirp", "random2": "random"}
"""Kinds of flight whose simulated path, which the clock is aligned with, has another name."""

PERIOD = 0.01
POSITION_HZ, ATTITUDE_HZ, VELOCITY_HZ, ROTOR_HZ = 10.0, 12.0, 18.0, 20.0
"""Cut-offs of the low-pass filters; that of the velocity is that of the rates as well."""

MASS, ARM, THRUST_FACTOR, STATED_DRAG_FACTOR = 0.045, 0.0353, 3.72e-8, 7.74e-12
# The stated one is a lever of 0.2 mm between thrust and reaction torque, a hundredth of what propellers have.
DRAG_FACTOR = 0.024 * THRUST_FACTOR
# The benchmark writes Izz = 3.2347e-6, less than a sixth of Ixx + Iyy. A body this flat has nearly the sum of the
# two, so that it can only mean e-5.
INERTIA = (2.3951e-5, 2.3951e-5, 3.2347e-5)
# Its mixer: roll torque k a ((3 + 4) - (1 + 2)), pitch torque k a ((2 + 3) - (1 + 4)), of squared speeds. Its yaw
# torque follows (1 + 3) - (2 + 4); on every training flight the motion says the opposite, which is what stands here.
HUBS = (((ARM, -ARM), 1), ((-ARM, -ARM), -1), ((-ARM, ARM), 1), ((ARM, ARM), -1))


def _vehicle(drag_factor: float, yaw: int) -> VehicleSettings:
    factors = {"thrust_factor_n_s2": THRUST_FACTOR, "drag_factor_n_m_s2": drag_factor}
    rotors = tuple(RotorSettings(position_m=(*hub, 0.0), spin=yaw * spin, **factors) for hub, spin in HUBS)
    return VehicleSettings(mass_kg=MASS, inertia_kg_m2=INERTIA, rotor_speed_max_rad_s=3500.0, rotors=rotors)


STATED = _vehicle(STATED_DRAG_FACTOR, -1)
"""As the benchmark states it, but for Izz."""
VEHICLE = _vehicle(DRAG_FACTOR, 1)
"""Where a fit starts."""

_POLE_PAIRS = 6.0
_JUMP, _LARGEST = 1e5, 3e5
_MOTORS, _SPIKY = ("m1", "m2", "m3", "m4"), ("erpm", "thrust")
_STATE = ("x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz", "qx", "qy", "qz", "qw")
_SMALL = 1e-6
PREPARED_SPEED = tuple(f"{motor}_rads" for motor in _MOTORS)
NUMBERS = ("double", "float", "int64", "int32")


def flights(folder: Path, names: Iterable[str]) -> list[PlaybackFlight]:
    """Read flights that are published prepared, or prepare them; see `TRAINING` and `TEST`."""
    return [flight(folder, name) for name in names]


def flight(folder: Path, name: str) -> PlaybackFlight:
    """Read one flight of the repository, or of a folder with all its files."""
    ready = _path(folder, WHERE_PREPARED, f"{name}.csv")
    if ready is not None:
        return published(name, ready)
    kind, day, _ = name.split("_")
    return prepared(name, columns(folder, name), columns(folder, f"{PLANS.get(kind, kind)}_{day}"))


def columns(folder: Path, name: str) -> dict[str, Array]:
    """Read the columns of a Parquet file by name."""
    found = _path(folder, WHERE, f"{name}.parquet")
    if found is None:
        raise InputError(
            f"{folder}: no {name}.parquet, neither in {WHERE[0]} nor in {WHERE[1]} nor in the folder itself"
        )
    table = parquet.read_table(found)
    numbers = [name for name, kind in zip(table.column_names, table.schema.types, strict=True) if str(kind) in NUMBERS]
    return {name: np.array(table.column(name).to_numpy(), dtype=float) for name in numbers}


def published(name: str, path: Path) -> PlaybackFlight:
    """Read a prepared flight."""
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    state, speed = (np.array([[float(row[c]) for c in part] for row in rows]) for part in (_STATE, PREPARED_SPEED))
    position, velocity, rate, quaternion = (np.ascontiguousarray(part) for part in np.split(state, (3, 6, 9), axis=1))
    return _flight(name, position, velocity, rate, quaternion, speed)


def _path(folder: Path, inside: Iterable[str], name: str) -> Path | None:
    return next((path for place in inside if (path := folder / place / name).is_file()), None)


def prepared(name: str, raw: Mapping[str, Array], planned: Mapping[str, Array]) -> PlaybackFlight:
    """Make a flight of raw columns and of its simulated path: no spikes, clocks aligned, cut, no offsets, filtered."""
    logged = {column: backfilled(values) for column, values in raw.items()}
    speed = rotor_speed(logged)
    speed = shifted(speed, lag_of(_thrust_felt(logged), (speed**2).sum(axis=1)))
    inside = _overlap(logged, planned)
    state = {column: without_offset(logged[column][inside], planned.get(column)) for column in _STATE}
    position, velocity, rate, quaternion = (
        np.stack([state[column] for column in part], axis=1)
        for part in (_STATE[:3], _STATE[3:6], _STATE[6:9], _STATE[9:])
    )
    return _flight(
        name,
        low_pass(position, POSITION_HZ),
        low_pass(velocity, VELOCITY_HZ),
        low_pass(rate, VELOCITY_HZ),
        filtered_quaternion(quaternion),
        low_pass(forward_filled(backfilled(speed[inside])), ROTOR_HZ),
    )


def _flight(
    name: str, position: Array, velocity: Array, rate: Array, quaternion: Array, speed: Array
) -> PlaybackFlight:
    rotation = Rotation.from_quat(quaternion).as_matrix()
    motion = MeasuredMotion(position, velocity, rotation, rate, PERIOD)
    # Up to a step the benchmark gives a model the rotor speeds of the sample before it.
    return PlaybackFlight(name=name, motion=motion, speed=speed, hold="previous", stretches=(slice(0, len(speed)),))


def rotor_speed(logged: Mapping[str, Array]) -> Array:
    """Convert electric revolutions per minute to rad/s, with samples next to a spike taken from the next, (time, 4)."""
    spikes = np.zeros(len(logged["m1_erpm"]), dtype=bool)
    for values in (logged[name] for motor in _MOTORS for kind in _SPIKY if (name := f"{motor}_{kind}") in logged):
        around = (np.flatnonzero(np.abs(np.diff(values)) > _JUMP)[:, None] + [-1, 0, 1]).ravel()
        spikes[around[around >= 0]] = True
        spikes |= np.abs(values) > _LARGEST
    electric = np.stack([logged[f"{motor}_erpm"] for motor in _MOTORS], axis=1)
    electric[spikes] = np.nan
    return forward_filled(backfilled(electric)) * 2 * np.pi / (_POLE_PAIRS * 60)


def _thrust_felt(logged: Mapping[str, Array]) -> Array:
    quaternion = np.stack([logged[column] for column in _STATE[9:]], axis=1)
    acceleration = np.stack([logged[column] for column in ("ax", "ay", "az")], axis=1)
    return np.asarray(Rotation.from_quat(quaternion).inv().apply(acceleration)[:, 2])


def lag_of(reference: Array, other: Array) -> int:
    """Find how many samples later the reference is than the other, by their correlation."""
    first, second = ((values - values.mean()) / values.std() for values in (reference, other))
    return int(np.argmax(correlate(first, second, mode="full"))) - len(other) + 1


def shifted(values: Array, lag: int) -> Array:
    """Shift by samples, later where the lag is positive; NaN where nothing is known."""
    moved = np.roll(values, lag, axis=0)
    if lag > 0:
        moved[:lag] = np.nan
    elif lag < 0:
        moved[lag:] = np.nan
    return moved


def _overlap(logged: Mapping[str, Array], planned: Mapping[str, Array]) -> Array:
    """Tell which samples lie within the planned path, once both set points of x have been laid over each other."""
    lag = lag_of(planned["x_r"], logged["x_r"])
    time = logged["t"] + lag * np.mean(np.diff(planned["t"]))
    return np.asarray((time >= planned["t"].min()) & (time <= planned["t"].max()))


def without_offset(values: Array, planned: Array | None) -> Array:
    """Subtract the mean difference from the simulated signal, sample by sample: quaternions too, as they do."""
    if planned is None:
        return values
    both = min(len(values), len(planned))
    return np.asarray(values - np.mean(values[:both] - planned[:both]))


def low_pass(values: Array, cutoff_hz: float) -> Array:
    """Filter by a Butterworth filter of fourth order, forward and backward."""
    sections = butter(4, cutoff_hz, btype="low", fs=1 / PERIOD, output="sos")
    return np.ascontiguousarray(sosfiltfilt(sections, values, axis=0))


def filtered_quaternion(quaternion: Array) -> Array:
    """Filter the rotation vectors of quaternions x, y, z, w, with their small numbers against division by zero."""
    vector, scalar = quaternion[:, :3], quaternion[:, 3:]
    length = np.linalg.norm(vector, axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(length, np.clip(scalar, -1.0 + _SMALL, 1.0 - _SMALL))
    turned = low_pass(angle / (length + _SMALL) * vector, ATTITUDE_HZ)
    angle = np.linalg.norm(turned, axis=1, keepdims=True)
    return np.hstack([np.sin(0.5 * angle) / (angle + _SMALL) * turned, np.cos(0.5 * angle)])


def backfilled(values: Array) -> Array:
    """Put the next known value where one is missing."""
    missing = np.isnan(values)
    index = np.where(missing, len(values), np.indices(values.shape)[0])
    following = np.minimum.accumulate(index[::-1], axis=0)[::-1]
    known = np.minimum(following, len(values) - 1)
    filled = np.take_along_axis(values, known, axis=0)
    return np.asarray(np.where(following < len(values), filled, values))


def forward_filled(values: Array) -> Array:
    """Put the last known value where one is missing."""
    return backfilled(values[::-1])[::-1]
