"""From asked thrust and turning to the speeds of motors: mixer, limits, thrust curve.

Commands are allocated to rotors, for many samples at once, as autopilots do. Body axes are forward, right, down: roll
to the right, pitch nose up and yaw clockwise are positive. Written from the public descriptions and sources of PX4
(control allocation with sequential desaturation) and ArduPilot (AP_MotorsMatrix); where all fits between no and full
thrust, both are one product of matrices.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from typing import Any, Literal, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.errors import ComputationError
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.stepping import Machine
from cpfls_cli.vehicle.tracing import SYMBOLS
from cpfls_cli.vehicle.values import ARRAYS, Functions, Tangent, Value, Vector

_HALVES = 40
"""Times that the range is halved to invert a thrust curve that only grows."""
_LEAST_YAW = 1e-12
"""Share of the most that a rotor gives, up to which yaw does not need it: rounding."""
_SHARES, _TRIED = np.linspace(0.0, 1.0, 101), 1e-3
"""Shares of the full thrust along which a curve is to make thrust straight, and the step in which it is looked for."""


@dataclass(frozen=True)
class ThrustCurve:
    """What an autopilot takes thrust to be of the signal of a motor, both from 0 to 1.

    Attributes
    ----------
    expo : float
        e of ``thrust = e signal^2 + (1 - e) signal``; 0 for a straight line.
    low, high : float
        Signals at the ends of that range.
    series : bool
        Whether the inverse is ``thrust (1 + e (1 - thrust)^2)``, as Betaflight takes it.
    """

    expo: float = 0.0
    low: float = 0.0
    high: float = 1.0
    series: bool = False

    def signal(self, thrust: Value, battery: Array | float = 1.0, functions: Functions = ARRAYS) -> Any:
        """Give the signals for shares of the full thrust.

        Parameters
        ----------
        thrust : array, shape (..., rotor), or value by rotor
        battery : float or array, shape (..., 1)
            Voltage over that of the full battery, which the signals make good, as ArduPilot does; 1 where they do not.
        """
        share = _clipped(thrust, functions)
        if self.series:
            share = self._reached(share)
        else:
            # What the battery can still lift is the most that may be asked for.
            share = share * (self.expo * battery**2 + (1 - self.expo) * battery)
            if abs(self.expo) > 1e-9:
                straight = 1 - self.expo
                share = (functions.sqrt(straight**2 + 4 * self.expo * share) - straight) / (2 * self.expo)
            share = functions.smallest(share / battery, 1.0)
        return self.low + (self.high - self.low) * share

    def thrust(self, signal: Value, functions: Functions = ARRAYS) -> Any:
        """Give the shares of the full thrust that lead to signals, shape (rotor,)."""
        share = _clipped((signal - self.low) / (self.high - self.low), functions)
        if not self.series:
            return self.expo * share**2 + (1 - self.expo) * share
        low, high = 0.0 * share, 0.0 * share + 1.0
        for _ in range(_HALVES):
            middle = 0.5 * (low + high)
            beyond = self._reached(middle) > share
            low, high = functions.where(beyond, low, middle), functions.where(beyond, middle, high)
        return 0.5 * (low + high)

    def _reached(self, share: Value) -> Value:
        return share * (1 + self.expo * (1 - share) ** 2)


def _clipped(share: Value, functions: Functions) -> Value:
    return functions.smallest(functions.largest(share, 0.0), 1.0)


def straightening(curve: ThrustCurve, share: float, hover: float, most: float) -> float:
    """Find the `expo` of a curve with which thrust comes nearest to a straight line of what is asked for.

    Parameters
    ----------
    share, hover : float
        Of the thrust of the motors, how much is linear in the signal in hover, and the signal there.
    most : float
        Largest that may be found.
    """

    def thrust(signal: Array) -> Array:
        return (1 - share) * signal**2 + share * hover * signal

    least, full = thrust(np.array([curve.low, curve.high]))

    def bent(expo: float) -> float:
        given = (thrust(replace(curve, expo=expo).signal(_SHARES)) - least) / (full - least)
        return float(((given - _SHARES) ** 2).sum())

    tried = np.arange(0.0, most + 0.5 * _TRIED, _TRIED)
    return float(tried[np.argmin([bent(each) for each in tried])])


@dataclass(frozen=True)
class MixerRule:
    """How an autopilot scales the columns of its mixer, which follow the places and the spins of the rotors.

    Attributes
    ----------
    by : {"peak", "power"}
        ``peak``: the largest entry of a column is the given one. ``power``: roll and pitch by the root of twice their
        mean square, both by the larger of the two, as PX4's control allocation does; yaw by its peak.
    tilt, yaw : float
        Share of the full thrust of a motor for a full command.
    """

    by: Literal["peak", "power"]
    tilt: float
    yaw: float


def mixing(rule: MixerRule, vehicle: VehicleSettings) -> Array:
    """Build the mixer of a vehicle, shape (rotor, 4): shares of full thrust for thrust, roll, pitch and yaw.

    `ComputationError` where the rotors do not control all four.
    """
    places = np.array([rotor.position_m for rotor in vehicle.rotors])
    spins = np.array([rotor.spin for rotor in vehicle.rotors], dtype=float)
    arm = np.abs(places[:, :2]).max()
    return inverse_mix(rule, np.array([np.ones(len(spins)), places[:, 1] / arm, -places[:, 0] / arm, -spins]))


def inverse_mix(rule: MixerRule, rows: Array) -> Array:
    """Invert what rotors do and scale it as a rule says, shape (rotor, 4).

    `rows`: thrust, roll, pitch, yaw of each rotor at full; forces across behind them, which are to stay nothing.
    `ComputationError` where the rotors do not control all four.
    """
    if np.linalg.matrix_rank(rows[:4]) < 4:
        raise ComputationError("vehicle.rotors: they do not control thrust, roll, pitch and yaw, so no autopilot flies")
    columns = np.linalg.pinv(rows)[:, :4]
    columns[np.abs(columns) < 1e-9] = 0.0
    columns[:, 0] /= columns[:, 0].mean()
    peaks = np.abs(columns).max(axis=0)
    tilts = peaks[1:3]
    if rule.by == "power":
        used = (columns[:, 1:3] != 0).sum(axis=0)
        # One scale for both, so that equal commands give equal torque.
        tilts = np.full(2, np.sqrt((columns[:, 1:3] ** 2).sum(axis=0) / (used / 2)).max())
    columns[:, 1:3] *= rule.tilt / tilts
    columns[:, 3] *= rule.yaw / peaks[3]
    return np.asarray(columns)


class Mixed(NamedTuple):
    """What the mixer gives.

    Speeds asked of the rotors, rad/s; shares of the full thrust before any limit; whether roll, pitch, yaw are cut.
    """

    speed: Array
    wanted: Array
    saturated: BoolArray


def fitting_yaw(upright: Value, yaw: Value, limit: float) -> Value:
    """Give the part of a yaw command that fits, by rotor, between 0 and a limit together with all else; symbols."""
    functions, least, share = SYMBOLS, _LEAST_YAW * limit, 1.0
    for straight, turned in zip(upright, yaw, strict=True):
        size = functions.absolute(turned)
        room = functions.where(turned > 0.0, limit - straight, straight) / functions.largest(size, least)
        share = functions.where(size > least, functions.smallest(room, share), share)
    return functions.largest(share, 0.0)


@dataclass(frozen=True)
class Motors:
    """Mixer and motors of a vehicle.

    Where they cannot do all, yaw gives way first, then thrust, then roll and pitch. The rotors turn in proportion to
    the signal.

    Attributes
    ----------
    mix : array, shape (rotor, 4)
    speed_max : float, rad/s
        At a signal of 1.
    """

    mix: Array
    curve: ThrustCurve
    speed_max: float

    @classmethod
    def of(cls, rule: MixerRule, curve: ThrustCurve, vehicle: VehicleSettings) -> Motors:
        """Give those of a vehicle."""
        return cls(mixing(rule, vehicle), curve, vehicle.rotor_speed_max_rad_s)

    def speeds(self, thrust: float, turning: Array) -> Mixed:
        """Mix thrust, a share of the full one, and commands about the body axes, shape (3,)."""
        out, rotors = np.array(self._machine.advance((thrust, *turning))), len(self.mix)
        return Mixed(out[:rotors], out[rotors:-2], np.array([out[-2], out[-2], out[-1]]) > 0.0)

    @cached_property
    def _machine(self) -> Machine:
        return Machine.of(lambda _memory, given: self._mixed(given[0], given[1:]), 4)

    def _mixed(self, thrust: Value, turning: Vector) -> Vector:
        """Give speeds, shares of thrust wanted, and 1 where roll and pitch, and where yaw, are cut."""
        functions = SYMBOLS
        lift, roll, pitch, yawing = (functions.rotors(column) for column in self.mix.T.tolist())
        upright = lift * _clipped(thrust, functions) + roll * turning[0] + pitch * turning[1]
        yaw = yawing * turning[2]
        share = fitting_yaw(upright, yaw, 1.0)
        shares = upright + share * yaw
        largest, smallest = (reduce(choose, shares) for choose in (functions.largest, functions.smallest))
        # Where one end is exceeded the whole moves; where both are, roll and pitch are cut.
        both = largest - smallest > 1.0
        moved = functions.largest(0.0 - smallest, 0.0) - functions.largest(largest - 1.0, 0.0)
        speed = self.curve.signal(shares + functions.where(both, 0.0, moved), functions=functions) * self.speed_max
        cut = functions.where(both, 1.0, 0.0), functions.where(share < 1.0, 1.0, 0.0)
        return *speed, *(upright + yaw), *cut

    def share_of(self, speed: float) -> float:
        """Give the share of the full thrust that is asked for to turn all rotors at a speed, rad/s."""
        return float(self.curve.thrust(speed / self.speed_max))

    def speed_at(self, share: float) -> float:
        """Give the speed of rotors at a share of the full thrust, rad/s."""
        return float(self.curve.signal(np.array(share))) * self.speed_max

    def speed_slope(self, share: float) -> float:
        """Differentiate `speed_at`, rad/s for one unit of the share."""
        return float(self.curve.signal(Tangent(share, {0: 1.0})).by[0]) * self.speed_max


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
