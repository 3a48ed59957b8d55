"""The first leg of a path: its derivatives along the line that it flies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.records import Artifact

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
    """Take the first leg of a path, from its start to where it is farthest from it for the first time.

    Parameters
    ----------
    trajectory : Artifact

    Returns
    -------
    FirstLeg
    """
    away = trajectory.array("position") - trajectory.array("position")[0]
    distance = np.linalg.norm(away, axis=1)
    end = _end(distance, np.linalg.norm(trajectory.array("jerk"), axis=1))
    direction = away[end] / (distance[end] or 1.0)
    part = slice(0, end + 1)
    curves = {name: trajectory.array(name)[part] @ direction for name in DERIVATIVES[:-1]}
    return FirstLeg(trajectory.array("time")[part], curves | {"displacement": away[part] @ direction})


def _end(distance: Array, jerk: Array) -> int:
    """Find the last sample of the leg; a path comes to rest so softly that distance alone would end it early."""
    end = int(np.argmax(distance >= distance.max() * (1 - 1e-9)))
    at_rest = (jerk <= 1e-9 * jerk.max()) | (np.diff(distance, append=-np.inf) < 0)
    return end + int(np.argmax(at_rest[end:]))


def peaks(trajectory: Artifact) -> dict[str, float]:
    """Find the largest length of every derivative over the whole path, at its samples.

    Parameters
    ----------
    trajectory : Artifact

    Returns
    -------
    dict of str to float
    """
    lengths = {name: float(np.linalg.norm(trajectory.array(name), axis=1).max()) for name in DERIVATIVES[:-1]}
    away = trajectory.array("position") - trajectory.array("position")[0]
    return lengths | {"displacement": float(np.linalg.norm(away, axis=1).max())}
