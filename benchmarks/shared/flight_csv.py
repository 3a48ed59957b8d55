"""Flights that a benchmark has prepared, as CSV for `cpfls gap` and `cpfls vehicle`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from cpfls_cli.arrays import Array
from cpfls_cli.playback.flight import PlaybackFlight

_COLUMNS = (
    *("t", "x", "y", "z", "vx", "vy", "vz", "qx", "qy", "qz", "qw", "wx", "wy", "wz"),
    *("om1", "om2", "om3", "om4"),
)
_SENSED = ("sfx", "sfy", "sfz")


def write_flight(folder: Path, flight: PlaybackFlight, specific_force: Array | None = None) -> None:
    """Write a flight in SI: world ENU, body FLU, the quaternion from body to world, rotor speeds, and what is felt."""
    motion = flight.motion
    quaternion = Rotation.from_matrix(motion.rotation).as_quat()
    # One sign throughout: q and -q are the same rotation.
    quaternion *= np.cumprod(np.append(1.0, np.where((quaternion[1:] * quaternion[:-1]).sum(axis=1) < 0, -1.0, 1.0)))[
        :, None
    ]
    time = motion.period * np.arange(len(flight.speed))
    columns = [time[:, None], motion.position, motion.velocity, quaternion, motion.rate, flight.speed]
    names = _COLUMNS if specific_force is None else (*_COLUMNS, *_SENSED)
    table = np.hstack(columns if specific_force is None else [*columns, specific_force])
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{flight.name}.csv"
    np.savetxt(path, table, fmt="%.9g", delimiter=",", header=",".join(names), comments="")
    print(path)
