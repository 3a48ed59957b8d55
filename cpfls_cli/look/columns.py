"""Signals that only `look` asks of a log: what moves the vehicle, its filters, its battery. One row a column."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from math import pi
from typing import Final, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.log_table import LogTable
from cpfls_cli.flightlog.names import is_of
from cpfls_cli.flightlog.smoothing import low_pass
from cpfls_cli.flightlog.topics import STAMP, Topics
from cpfls_cli.look.flight import Samples

_TABLE: Final = """
    # What, whose, columns, factor to SI, signs in axes forward, right, down; the first that a log holds is taken
    rate      PX4         vehicle_angular_velocity.xyz[{0,1,2}]   1        +++
    rate      PX4         vehicle_attitude.{roll,pitch,yaw}speed  1        +++
    rate      ArduPilot   RATE.{R,P,Y}                            deg      +++
    rate      ArduPilot   RATE.{Rll,Pit,Yaw}                      deg      +++
    raw       PX4         sensor_gyro.{x,y,z}                     1        +++
    raw       PX4         sensor_combined.gyro_rad[{0,1,2}]       1        +++
    raw       ArduPilot   GYR.Gyr{X,Y,Z}                          1        +++
    raw       Betaflight  gyroUnfilt[{0,1,2}]                     deg      +--
    output    PX4         vehicle_torque_setpoint.xyz[{0,1,2}]    1        +++
    output    PX4         actuator_controls_0.control[{0,1,2}]    1        +++
    output    ArduPilot   RATE.{R,P,Y}Out                         1        +++
    output    ArduPilot   RATE.{Rll,Pit,Yaw}Out                   1        +++
    # A pitch is positive with the nose up here, unlike in the gyroscope's axes.
    output    Crazyflie   controller.cmd_{roll,pitch,yaw}         1/65536  +++
    thrust    PX4         vehicle_thrust_setpoint.xyz[{2}]        1        -
    thrust    PX4         actuator_controls_0.control[{3}]        1        +
    thrust    ArduPilot   RATE.{AOut}                             1        +
    thrust    ArduPilot   CTUN.{ThO}                              1        +
    thrust    ArduPilot   CTUN.{ThrOut}                           1/1000   +
    thrust    Crazyflie   controller.{cmd_thrust}                 1/65536  +
    setpoint  PX4         vehicle_rates_setpoint.{roll,pitch,yaw} 1        +++
    setpoint  ArduPilot   RATE.{R,P,Y}Des                         deg      +++
    setpoint  ArduPilot   RATE.{Rll,Pit,Yaw}Des                   deg      +++
    setpoint  Betaflight  setpoint[{0,1,2}]                       deg      +--
    setpoint  Betaflight  axisRate[{0,1,2}]                       deg      +--
    current   PX4         battery_status.{current_a}              1        +
    current   ArduPilot   BAT.{Curr}                              1        +
    current   ArduPilot   CURR.{Curr}                             1        +
    current   Betaflight  {amperageLatest}                        1/100    +
    current   Betaflight  {amperage}                              1/100    +
    voltage   PX4         battery_status.{voltage_filtered_v}     1        +
    voltage   ArduPilot   CURR.{Volt}                             1        +
    height    ArduPilot   CTUN.{Alt}                              1        +
    height    ArduPilot   BARO.{Alt}                              1        +
    height    ArduPilot   CTUN.{BAlt}                             1        +
    height    ArduPilot   CTUN.{BarAlt}                           1        +
    height    Betaflight  {baroAlt}                               1/100    +
"""
FRD: Final = np.array([1.0, -1.0, -1.0])
"""Signs that make axes forward, right, down of forward, left, up, and the other way round."""

_AHEAD_S: Final = 0.1
"""By which a sample is taken before the message that holds it is stamped, at most."""

_THINNED, _PASSED = 1.5, 0.4
"""Times as fast as a clock from which on a signal is filtered before it is put on it, and up to which share of the
clock's rate it passes."""

_SLOW_HZ: Final = 5.0
"""Below which two sensors of one motion, and what follows it, are compared."""

_BRIDGED_STEPS, _BRIDGED_S = 5.0, 0.25
"""Steps of a signal, and s, up to which it is known between two samples."""


class Row(NamedTuple):
    """Columns in which a kind of log has a signal."""

    what: str
    system: str
    columns: tuple[str, ...]
    factor: float
    sign: tuple[float, ...]


def _row(text: str) -> Row:
    what, system, pattern, factor, signs = text.split()
    before, _, rest = pattern.partition("{")
    axes, _, after = rest.partition("}")
    columns = tuple(f"{before}{axis}{after}" for axis in axes.split(","))
    own = pi / 180 if factor == "deg" else float(Fraction(factor))
    return Row(what, system, columns, own, tuple(1.0 if sign == "+" else -1.0 for sign in signs))


ROWS: Final = tuple(_row(text) for text in _TABLE.splitlines() if text.strip() and "#" not in text)


class LookedLog:
    """A log by columns, times of samples in s from its first stamp."""

    def __init__(self, topics: Topics, units: Mapping[str, str], system: str) -> None:
        self.table = LogTable({name: _stamped_as_sampled(fields) for name, fields in topics.items()}, units)
        self.system, self.names = system, frozenset(self.table.names)

    def samples(self, columns: Sequence[str]) -> Samples | None:
        """Give columns as they were logged; None where one is absent, or fewer than two rows hold a value."""
        if not self.names.issuperset(columns):
            return None
        time, values = self.table.values(columns)
        return Samples(time - self.table.origin, values, in_words(columns)) if len(time) > 1 else None

    def found(self, what: str) -> Iterator[Samples]:
        """Give what the rows of a kind name, in SI and in axes forward, right, down, the first row first."""
        for row in ROWS:
            if row.what == what and is_of(self.system, row.system):
                samples = self.samples(row.columns)
                if samples is not None:
                    yield samples._replace(values=row.factor * np.array(row.sign) * samples.values)


def in_words(columns: Sequence[str]) -> str:
    """Name columns: the topic once, where they are of one."""
    topic, dot, _ = columns[0].partition(".")
    same = dot and all(name.startswith(f"{topic}.") for name in columns)
    return f"{topic}.{', '.join(name.partition('.')[2] for name in columns)}" if same else ", ".join(columns)


def _stamped_as_sampled(fields: Mapping[str, Array]) -> Mapping[str, Array]:
    """Stamp the rows of a topic with when their sample was taken, where it says so."""
    taken, stamp = fields.get(f"{STAMP}_sample"), fields.get(STAMP)
    if taken is None or stamp is None or len(taken) != len(stamp) or not len(stamp):
        return fields
    ahead = np.asarray(stamp - taken, dtype=float)
    return {**fields, STAMP: taken} if bool(((ahead >= 0) & (ahead < _AHEAD_S)).all()) else fields


def on_clock(samples: Samples | None, clock: Array, channels: int, *, cubic: bool = False) -> Array:
    """Put a signal on a uniform clock, shape (time, channel): linear between samples, NaN where there are none.

    What comes faster than the clock is filtered first, without shift of phase, so that no vibration is folded into
    the band of the clock.

    Parameters
    ----------
    cubic : bool
        By cubic splines where every sample is known: lines weaken what moves at a tenth of the samples' rate by 3 %.
    """
    if samples is None:
        return np.full((len(clock), channels), np.nan)
    time, values = samples.time, samples.values.reshape(len(samples.time), -1)
    step, rate_hz = float(np.median(np.diff(time))), 1 / float(clock[1] - clock[0])
    if samples.rate_hz > _THINNED * rate_hz:
        values = low_pass(values, samples.rate_hz, _PASSED * rate_hz, 4)
    if cubic and len(time) > 1 and np.isfinite(values).all():
        from scipy.interpolate import CubicSpline

        own = CubicSpline(time, values)(clock)
        own[(clock < time[0]) | (clock > time[-1])] = np.nan
    else:
        own = np.column_stack([np.interp(clock, time, channel, left=np.nan, right=np.nan) for channel in values.T])
    after = np.clip(np.searchsorted(time, clock), 1, len(time) - 1)
    own[(time[after] - time[after - 1]) > max(_BRIDGED_STEPS * step, _BRIDGED_S)] = np.nan
    return own


def compared(one: Samples, other: Samples) -> tuple[Array, Array]:
    """Give slow parts of two signals on one clock, shape (time, channel), their means left out."""
    hz = min(4 * _SLOW_HZ, one.rate_hz, other.rate_hz)
    begin, end = max(one.time[0], other.time[0]), min(one.time[-1], other.time[-1])
    clock = np.arange(begin, max(end, begin + 3 / hz), 1 / hz)
    pair = [on_clock(own, clock, own.values.shape[1]) for own in (one, other)]
    known = np.isfinite(np.hstack(pair)).all(axis=1)
    first, second = (own[known] - own[known].mean(axis=0) for own in pair)
    return first, second


def along_each(one: Samples, other: Samples) -> tuple[Array, Array]:
    """Correlate two signals, and give the factor that makes the second of the first, each axis by itself."""
    first, second = compared(one, other)
    own, crossed, others = ((a * b).sum(axis=0) for a, b in ((first, first), (first, second), (second, second)))
    still = (own <= 0) | (others <= 0)
    size = np.where(still, 1.0, np.sqrt(own * others))
    return np.where(still, 0.0, crossed / size), np.where(still, 0.0, crossed / np.where(own > 0, own, 1.0))
