"""The first leg of a path: its derivatives along the line that it flies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.store import Artifact

DERIVATIVES = ("pop", "crackle", "snap", "jerk", "acceleration", "velocity", "displacement")
UNITS = ("m/s⁶", "m/s⁵", "m/s⁴", "m/s³", "m/s²", "m/s", "m")


@dataclass(frozen=True)
class FirstLeg:
    """Motion along the line of the first leg.

    Attributes
    ----------
    time : array, shape (samples,), s
    curves : dict of str to array, shape (samples,)
        By name of the derivative, signed along the leg.
    """

    time: Array
    curves: dict[str, Array]


def first_leg(trajectory: Artifact) -> FirstLeg:
    """Take the first leg of a path, from rest to rest."""
    time, position = trajectory.array("time"), trajectory.array("position")
    part, direction = _first(trajectory)
    curves = {name: trajectory.array(name)[part] @ direction for name in DERIVATIVES[:-1]}
    return FirstLeg(time[part], curves | {"displacement": (position[part] - position[0]) @ direction})


def _first(trajectory: Artifact) -> tuple[slice, Array]:
    """Find samples and direction of the first leg; of the whole path where the file does not say what its legs are."""
    if "leg/begin" in trajectory.data:
        begin, end = (float(trajectory.array(f"leg/{which}")[0]) for which in ("begin", "end"))
        first, last = np.searchsorted(trajectory.array("time"), [begin, end])
        along = trajectory.array("leg/displacement")[0]
        # Divided by the largest component first: the square of a tiny one is zero.
        along = along / np.abs(along).max()
        return slice(int(first), int(last) + 1), along / np.linalg.norm(along)
    away = trajectory.array("position") - trajectory.array("position")[0]
    farthest = away[np.argmax(np.linalg.norm(away, axis=1))]
    return slice(None), farthest / (np.linalg.norm(farthest) or 1.0)


def peaks(trajectory: Artifact) -> dict[str, float]:
    """Find the largest length of every derivative over the whole path, at its samples."""
    lengths = {name: float(np.linalg.norm(trajectory.array(name), axis=1).max()) for name in DERIVATIVES[:-1]}
    away = trajectory.array("position") - trajectory.array("position")[0]
    return lengths | {"displacement": float(np.linalg.norm(away, axis=1).max())}
