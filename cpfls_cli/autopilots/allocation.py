"""From commands of thrust and turning to those of rotors as autopilots allocate them, for many samples at once.

Body axes are forward, right, down: roll to the right, pitch nose up and yaw clockwise are positive. Written from the
public descriptions and sources of PX4 (control allocation with sequential desaturation) and ArduPilot
(AP_MotorsMatrix); where all fits between no and full thrust, both are one product of matrices.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.autopilots.motors import MixerRule, ThrustCurve, inverse_mix

_ZERO = 1e-7
"""Share of a rotor below which it has no part in an axis."""
_YAW_ROOM = 0.15
"""Of PX4: the share above full up to which yaw may go before thrust gives way."""
_WEAK = 0.05
"""Of PX4: effect of rotors along an axis up to which the axis is not controlled."""
_BEST_THROTTLE = 0.5
"""Of ArduPilot: throttle with most room for turning."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """How an autopilot keeps rotors between no and full thrust.

    Attributes
    ----------
    by : {"px4", "ardupilot"}
    airmode : int
        MC_AIRMODE of PX4 (0 none, 1 for roll and pitch, 2 for yaw too).
    yaw_headroom : float
        Share of yaw that ArduPilot keeps (MOT_YAW_HEADROOM).
    throttle_mean : float
        Of ArduPilot, to which the mean thrust may be raised to keep turning: half of what hovers.
    """

    by: Literal["px4", "ardupilot"]
    airmode: int = 0
    yaw_headroom: float = 0.2
    throttle_mean: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Allocation:
    """The allocation of one vehicle.

    Attributes
    ----------
    mix : array, shape (rotor, 4)
        Share of a rotor's full thrust for full thrust, roll, pitch and yaw.
    curve : ThrustCurve
        From shares of full thrust to what is sent to the motors.
    """

    mix: Array
    limits: Limits
    curve: ThrustCurve = field(default_factory=ThrustCurve)

    def thrusts(self, thrust: Array, turning: Array) -> Array:
        """Allocate, shape (sample, rotor), shares of full thrust.

        Parameters
        ----------
        thrust : array, shape (sample,)
            Share of full.
        turning : array, shape (sample, 3)
            Roll, pitch and yaw, shares of the full command.
        """
        limit = {"px4": _as_px4, "ardupilot": _as_ardupilot}[self.limits.by]
        return np.asarray(np.clip(limit(self.mix, np.asarray(thrust), np.asarray(turning), self.limits), 0.0, 1.0))

    def commands(self, thrust: Array, turning: Array, battery: Array | float = 1.0) -> Array:
        """Give what is sent to the motors, shape (sample, rotor), shares of full; `battery` as in `ThrustCurve`."""
        return np.asarray(self.curve.signal(self.thrusts(thrust, turning), battery))


def px4_mix(rule: MixerRule, parameters: Mapping[str, float | str], rotors: list[int]) -> Array:
    """Build the mixer of PX4 from its CA_ROTOR*, shape (rotor, 4).

    Parameters
    ----------
    rotors : list of int
        Those that carry the vehicle, from 0.
    """

    def of(rotor: int, *names: str) -> Array:
        usual = {"AZ": -1.0, "CT": 6.5, "KM": 0.05}
        return np.array([float(parameters.get(f"CA_ROTOR{rotor}_{name}", usual.get(name, 0.0))) for name in names])

    columns = []
    for rotor in rotors:
        axis, place = of(rotor, "AX", "AY", "AZ"), of(rotor, "PX", "PY", "PZ")
        factor, ratio = of(rotor, "CT", "KM")
        force = factor * axis / np.linalg.norm(axis)
        turning = np.cross(place, force) - ratio * force
        columns.append([-force[2], *turning, force[0], force[1]])
    rows = np.array(columns).T
    return inverse_mix(rule, np.where((np.abs(rows) > _WEAK).any(axis=1, keepdims=True), rows, 0.0))


def factor_mix(rule: MixerRule, places: Array, spins: Array, *, inverse: bool) -> Array:
    """Build a mixer from the places of the rotors, shape (rotor, 4).

    Parameters
    ----------
    places : array, shape (rotor, 2)
        Forward and right, in any unit.
    spins : array, shape (rotor,)
        1 for counter-clockwise seen from above.
    inverse : bool
        Whether the autopilot inverts what the rotors do, as PX4 does; others take it itself, each axis by its peak.
    """
    arm = np.abs(places).max()
    rows = np.array([np.ones(len(spins)), -places[:, 1] / arm, places[:, 0] / arm, spins])
    if inverse:
        return inverse_mix(rule, rows)
    scale = np.array([1.0, rule.tilt, rule.tilt, rule.yaw])
    return np.asarray(rows.T * scale / np.abs(rows).max(axis=1))


def _as_px4(mix: Array, thrust: Array, turning: Array, limits: Limits) -> Array:
    """Give way along thrust, then along what matters less, each as far as it helps."""
    lift, roll, pitch, yaw = mix.T
    tilted = np.outer(thrust, lift) + turning[:, :2] @ mix[:, 1:3].T
    yawing = np.outer(turning[:, 2], yaw)
    if limits.airmode == 2:
        return _given_way(_given_way(tilted + yawing, lift), yaw)
    if limits.airmode == 1:
        shares = _given_way(tilted, lift)
    else:
        shares = _given_way(tilted, lift, only_down=True)
        shares = _given_way(_given_way(shares, roll), pitch)
    shares = _given_way(shares + yawing, yaw, most=1 + _YAW_ROOM)
    return _given_way(shares, lift, only_down=True)


def _given_way(shares: Array, along: Array, *, most: float = 1.0, only_down: bool = False) -> Array:
    """Move shares along an axis until those beyond either end are as near as they come."""
    first = _way(shares, along, most)
    moves = first <= 0.0 if only_down else np.ones(len(first), dtype=bool)
    moved = shares + np.outer(np.where(moves, first, 0.0), along)
    second = _way(moved, along, most)
    return np.asarray(moved + np.outer(np.where(moves, 0.5 * second, 0.0), along))


def _way(shares: Array, along: Array, most: float) -> Array:
    used = np.abs(along) > _ZERO
    beyond = np.where(shares < 0.0, -shares, np.where(shares > most, most - shares, 0.0))
    ways = beyond[:, used] / along[used]
    return np.asarray(np.minimum(ways.min(axis=1), 0.0) + np.maximum(ways.max(axis=1), 0.0))


def _as_ardupilot(mix: Array, thrust: Array, turning: Array, limits: Limits) -> Array:
    """Cut yaw to its room, scale what is wider than the range, and move thrust as far as it fits."""
    thrust = np.clip(thrust, 0.0, 1.0)
    mean = np.clip(limits.throttle_mean, thrust, 1.0)
    tilted = turning[:, :2] @ mix[:, 1:3].T
    yaw = mix[:, 3]
    used = np.abs(yaw) > _ZERO
    there = np.minimum(_BEST_THROTTLE, mean)[:, None] + tilted[:, used]
    upward = turning[:, 2:] * yaw[used] > 0
    room = np.maximum(np.where(upward, 1.0 - there, there), 0.0) / np.abs(yaw[used])
    allowed = np.maximum(np.minimum(room.min(axis=1), 1.0), limits.yaw_headroom)
    turned = tilted + np.outer(np.clip(turning[:, 2], -allowed, allowed), yaw)
    low, high = turned.min(axis=1), turned.max(axis=1)
    scale = 1.0 / np.maximum(high - low, 1.0)
    scale = np.where(mean + low < 0, np.minimum(scale, mean / np.maximum(-low, _ZERO)), scale)
    low, high = low * scale, high * scale
    base = np.where(scale < 1.0, -low, np.clip(thrust, -low, 1.0 - high))
    return np.asarray(base[:, None] + scale[:, None] * turned)
