"""The planned attitude at the instants of control."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil

import numpy as np
from scipy.interpolate import BPoly

from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError, SettingError

VERTICAL = 0.1
"""Smallest |cos(pitch)| of a plan: nearer to a vertical pitch, Euler angles do not tell which way to turn."""

_ROUNDING = 1e-6
_SIGNALS = ("attitude", "attitude_rate", "attitude_acceleration")


@dataclass(frozen=True)
class Plan:
    """What controllers follow.

    Attributes
    ----------
    time : array, shape (control,), s
        Instants of control: every sample, and equal parts between.
    parts : int
        Instants from sample to sample.
    period : float, s
    attitude, rate, acceleration : array, shape (control, 3), rad and s
        Euler angles and their derivatives.
    """

    time: Array
    parts: int
    period: float
    attitude: Array
    rate: Array
    acceleration: Array

    def __len__(self) -> int:
        """Count the instants of control."""
        return len(self.time)


def plan_of(time: Array, planned: Mapping[str, Array], control_rate: float) -> Plan:
    """Bring a planned attitude to the instants of control.

    Between samples it is the polynomial of fifth order that has their angles, rates and accelerations.

    Parameters
    ----------
    time : array, shape (samples,), s
    planned : mapping of str to array
        `attitude`, `attitude_rate`, `attitude_acceleration`, shape (samples, 3) each.
    control_rate : float, Hz
        Raised to the next multiple of the rate of the samples.

    Raises
    ------
    SettingError
        If the control rate is lower than the rate of the samples.
    ComputationError
        If there are fewer than two samples, they are not uniform, or the pitch comes near +-90 degrees.
    """
    if len(time) < 2 or np.ptp(np.diff(time)) > _ROUNDING * (time[1] - time[0]):
        raise ComputationError("attitude control needs a trajectory of two or more samples at one rate")
    sample = float(time[-1] - time[0]) / (len(time) - 1)
    if control_rate * sample < 1 - _ROUNDING:
        slow = f"lower than the {1 / sample:.6g} samples in a second of the trajectory"
        raise SettingError(
            "computed_torque.control_rate_hz", f"{slow}; set it to {ceil(1 / sample - _ROUNDING)} or more"
        )
    parts = ceil(control_rate * sample - _ROUNDING)
    q, qd, qdd = (planned[name] for name in _SIGNALS)
    at = time
    if parts > 1:
        at = np.append((time[:-1, None] + sample * np.arange(parts) / parts).ravel(), time[-1])
        between = BPoly.from_derivatives(time, np.stack([q, qd, qdd], axis=1))
        q, qd, qdd = (between(at, nu=order) for order in range(3))
    _refuse_vertical(at, q[:, 1])
    return Plan(at, parts, sample / parts, q, qd, qdd)


def _refuse_vertical(time: Array, pitch: Array) -> None:
    steep = np.flatnonzero(np.abs(np.cos(pitch)) < VERTICAL)
    # A path that turns fast may leap over the vertical between two instants.
    leaps = np.flatnonzero(np.diff(np.sign(np.cos(pitch))))
    if steep.size or leaps.size:
        first = min([*steep[:1], *leaps[:1]])
        raise ComputationError(
            f"the planned pitch comes within {np.degrees(np.arcsin(VERTICAL)):.1f} degrees of the vertical at "
            f"t = {time[first]:g} s ({np.degrees(pitch[first]):.1f} degrees), where Euler angles are singular and no "
            "torque follows from a model in them; follow a trajectory with less pitch, such as trajectory.path: "
            "cube-diagonal"
        )
