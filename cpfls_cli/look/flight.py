"""The signals of one log on one uniform clock, as all of `look` takes them, and what in them knows no gusts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, runs

NO_COMMAND = "what acts about the axis is not logged"
NO_SETPOINT = "no rate setpoint is logged"
NO_STICK = "no stick is logged that moves, so that setpoints may come from the state"
AT_REST = "the stick rests, so that setpoints may come from the state"
TOO_SLOW = "logged too slowly"
NOT_MOVED = "the instrument moves the vehicle too little"
NO_MODEL = "no model of a multirotor fits"
TOO_WIDE = "the interval is too wide"
_WINDOWS = 9.5
"""Length of a whole flight that has 18 windows overlapping by half: six blocks of three."""


def needed_s(window_s: float) -> float:
    """Give the usable seconds that windows of a length need."""
    return _WINDOWS * window_s


def too_little(usable: BoolArray, rate_hz: float, window_s: float) -> str:
    """Say how much of a log is usable in pieces that hold a window, and how much is needed; or that it moves little."""
    pieces = [(after - first) / rate_hz for first, after in runs(usable)]
    whole, needed = sum(piece for piece in pieces if piece >= window_s), needed_s(window_s)
    if whole >= needed:
        return NOT_MOVED
    return f"{whole:.0f} s are usable in pieces of at least {window_s:.0f} s; {needed:.0f} s are needed"


AXES = ("roll", "pitch", "yaw")


class Samples(NamedTuple):
    """A signal as it was logged, time first, on its own clock: strictly increasing, s from the first stamp of the log.

    `source`: columns of the log that it comes from.
    """

    time: Array
    values: Array
    source: str = ""

    @property
    def rate_hz(self) -> float:
        """Samples in a second, the median; 0 for fewer than two."""
        return float(1 / np.median(np.diff(self.time))) if len(self.time) > 1 else 0.0


@dataclass(frozen=True, kw_only=True)
class LogFlight:
    """One log of a multirotor.

    Body axes are forward, right, down, as autopilots have them: roll to the right, pitch nose up and yaw clockwise
    seen from above are positive. All times are s from the first stamp of the log. A signal on the common clock that
    the log lacks, or lacks for a while, is NaN.

    Attributes
    ----------
    name : str
        Of the file.
    autopilot : str
        A name of `cpfls_cli.autopilots.registry`; empty where it is another or unknown.
    system : str
        What wrote the log, and its version.
    parameters : mapping
        Of the autopilot, as the log states them.
    rate_hz : float
        Of the common clock: twice that of the slower of body rate and command, at most 1000.
    time : array, shape (time,), s
    body_rate : array, shape (time, 3), rad/s
        As the control law takes it: after the autopilot's filters where the log has both.
    command : array, shape (time, 3)
        What acts on the vehicle about each axis, share of the full command of the autopilot (1: the mixer moves each
        rotor by its full share), positive as the body rate that it causes.
    command_source : str
        How it is known: logged, or rebuilt from what.
    rate_setpoint : array, shape (time, 3), rad/s
    unfollowed : bool
        Whether rate setpoints are logged by name that the body rate does not follow; they are left out.
    stick : array, shape (time, 3)
        Of the pilot, -1 to 1, positive as the body rate.
    attitude_setpoint : array, shape (time, 3), rad
        Roll, pitch, yaw.
    attitude : array, shape (time, 3), rad
        Roll, pitch, yaw.
    collective : array, shape (time,)
        Mean command of the rotors, share of full.
    voltage : array, shape (time,), V
        Of the battery.
    current : array, shape (time,), A
    height : array, shape (time,), m
        Upward, from where it starts.
    climb_rate : array, shape (time,), m/s
    specific_force : array, shape (time, 3), m/s^2
    relative : bool
        Whether full is not known, and shares of it are shares of the largest that occurs.
    flown, usable : array of bool, shape (time,)
        Where it flies; and of that where signals are whole: no gap, no crash, not on the wing.
    rotors : Samples
        Commands of the rotors, shape (sample, rotor), share of full, as logged or rebuilt.
    rotors_source : str
        ``logged``, ``rebuilt``, or empty where neither is there.
    rotor_speed : Samples or None
        Shape (sample, rotor), rad/s.
    places : array, shape (rotor, 2), or None
        Forward and right, share of the arm.
    spins : array, shape (rotor,), or None
        1 for a rotor that turns counter-clockwise seen from above, -1 for one that turns clockwise.
    gyroscope : Samples
        Fastest logged body rate, shape (sample, 3), rad/s.
    gyroscope_unfiltered : Samples or None
        In front of the autopilot's filters.
    accelerometer : Samples or None
        Fastest logged specific force, shape (sample, 3), m/s^2.
    reads_at_rest : float
        What the accelerometer reads where it stands, in gravity; NaN where that is not known. Where it is wrong,
        `specific_force` is not known.
    gaps_s : array, shape (gap, 2), s
        Begin and end of each.
    gains : mapping from str to array, shape (3,)
        ``p``, ``i``, ``d``, ``ff`` of the rate loop as the autopilot's own parameters have them; empty where unknown.
    """

    name: str
    autopilot: str = ""
    system: str = ""
    parameters: Mapping[str, float | str] = field(default_factory=dict)
    rate_hz: float
    time: Array
    body_rate: Array
    command: Array
    command_source: str = ""
    rate_setpoint: Array
    unfollowed: bool = False
    stick: Array
    attitude_setpoint: Array
    attitude: Array
    collective: Array
    voltage: Array
    current: Array
    height: Array
    climb_rate: Array
    specific_force: Array
    relative: bool = False
    flown: BoolArray
    usable: BoolArray
    rotors: Samples
    rotors_source: str = ""
    rotor_speed: Samples | None = None
    places: Array | None = None
    spins: Array | None = None
    gyroscope: Samples
    gyroscope_unfiltered: Samples | None = None
    accelerometer: Samples | None = None
    reads_at_rest: float = np.nan
    gaps_s: Array
    gains: Mapping[str, Array] = field(default_factory=dict)


MADE_BY_STICKS = 0.95
"""Share of the variance of a setpoint that the stick explains, from which it is not fed by the state."""
_RATE_HZ = 25.0
_LAGS_S = (0.0, 0.04, 0.08, 0.12, 0.2, 0.32)
_SLOW_S = 2.0
"""Slower motion of a setpoint, such as trim and heading, is left out."""
_AT_REST = 0.01
"""Standard deviation of a stick, share of its full throw, below which it rests."""


class Exogenous(NamedTuple):
    """Instruments of one axis on the common clock, that nearest to the command first, or why there is none."""

    candidates: tuple[tuple[str, Array], ...]
    reason: str


def exogenous(flight: LogFlight, axis: int, usable: BoolArray) -> Exogenous:
    """List signals that are exogenous: the stick, and setpoints that follow it alone.

    A setpoint of an outer loop contains the measured state, and with it the gusts. The stick explains such a setpoint
    only as far as the state follows the stick; one that it explains all but wholly is its image.
    """
    stick, every = flight.stick[:, axis], usable & np.isfinite(flight.stick[:, axis])
    if every.sum() < needed_s(1.0) * flight.rate_hz:
        short = np.isfinite(stick).any()
        return Exogenous((), too_little(every, flight.rate_hz, 1.0) if short else NO_STICK)
    if float(np.std(stick[every])) < _AT_REST:
        return Exogenous((), AT_REST)
    found = [("stick", stick)]
    for name, values in (("attitude setpoint", flight.attitude_setpoint), ("rate setpoint", flight.rate_setpoint)):
        setpoint = values[:, axis]
        both = every & np.isfinite(setpoint)
        if both.sum() >= 0.5 * every.sum() and explained(setpoint, stick, both, flight.rate_hz) >= MADE_BY_STICKS:
            found.insert(0, (name, setpoint))
    return Exogenous(tuple(found), "")


def explained(setpoint: Array, stick: Array, usable: BoolArray, rate_hz: float) -> float:
    """Compute the share of a setpoint's variance that a stick explains by its values of the last third of a second.

    The smaller one of the setpoint and of its changes: what a slow stick asks for may hide faster answers to the state.
    """
    step = max(round(rate_hz / _RATE_HZ), 1)
    count = len(stick) // step
    good = usable[: count * step].reshape(count, step).all(axis=1)
    slow = np.ones(max(round(_SLOW_S * rate_hz / step), 3))

    def sampled(values: Array) -> Array:
        mean = np.where(usable, values, 0.0)[: count * step].reshape(count, step).mean(axis=1)
        weight = np.maximum(np.convolve(good, slow, "same"), 1.0)
        return np.asarray(np.where(good, mean - np.convolve(np.where(good, mean, 0.0), slow, "same") / weight, 0.0))

    shapes = [sampled(each) for each in (stick, stick * np.abs(stick), stick**3)]
    lags = [round(lag * rate_hz / step) for lag in _LAGS_S]
    columns = np.stack([np.roll(shape, lag) for lag in dict.fromkeys(lags) for shape in shapes], axis=1)
    whole = np.convolve(good, np.concatenate([np.zeros(max(lags)), np.ones(max(lags) + 1)]), "same") > max(lags)
    if whole.sum() < 2 * columns.shape[1]:
        return 0.0
    target, pairs = sampled(setpoint), whole & np.concatenate([[False], whole[:-1]])
    changes = [np.concatenate([[0.0], np.diff(target)]), np.diff(columns, axis=0, prepend=columns[:1])]
    return min(_share(target[whole], columns[whole]), _share(changes[0][pairs], changes[1][pairs]))


def _share(target: Array, columns: Array) -> float:
    rest = target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]
    power = float(target @ target)
    return 1.0 - float(rest @ rest) / power if power > 0 else 0.0
