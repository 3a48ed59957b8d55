"""From asked thrust and turning to the speeds of motors: mixer, limits, thrust curve."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import Any, Literal, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.errors import ComputationError
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.stepping import Machine
from cpfls_cli.vehicle.tracing import SYMBOLS
from cpfls_cli.vehicle.values import ARRAYS, Functions, Value, Vector

_CHANGE = 1e-4
"""Step of a derivative along a thrust curve."""
_HALVES = 40
"""Times that the range is halved to invert a thrust curve that only grows."""
_LEAST_YAW = 1e-12
"""Share of the thrust of a rotor, up to which yaw does not need it."""
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


def straightening(curve: ThrustCurve, linear: float, most: float) -> float:
    """Find the `expo` of a curve with which thrust comes nearest to a straight line of what is asked for.

    Parameters
    ----------
    linear : float
        l of what the motors give, ``signal^2 + l signal``.
    most : float
        Largest that may be found.
    """
    ends = np.array([curve.low, curve.high])
    least, full = ends**2 + linear * ends

    def bent(expo: float) -> float:
        signal = replace(curve, expo=expo).signal(_SHARES)
        given = (signal**2 + linear * signal - least) / (full - least)
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
        share: Value = 1.0
        # The part of the yaw command that fits between 0 and 1.
        for straight, turned in zip(upright, yaw, strict=True):
            size = functions.absolute(turned)
            room = functions.where(turned > 0.0, 1.0 - straight, straight) / functions.largest(size, _LEAST_YAW)
            share = functions.where(size > _LEAST_YAW, functions.smallest(room, share), share)
        share = functions.largest(share, 0.0)
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
        ends = min(max(share, _CHANGE), 1 - _CHANGE) + np.array([-_CHANGE, _CHANGE])
        low, high = self.curve.signal(ends)
        return float((high - low) / (2 * _CHANGE) * self.speed_max)
