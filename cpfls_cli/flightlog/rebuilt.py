"""Commands of the rotors rebuilt from what the autopilot allocates, which is often logged faster than they are.

A log may hold the commands of the rotors 10 times a second and what they are mixed from 50 times and more. They are
mixed again (`autopilots.allocation`) and compared with the logged ones sample by sample: only what reproduces those is
used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.autopilots.allocation import Allocation, Limits, Spread, factor_mix, px4_mix
from cpfls_cli.autopilots.motors import ThrustCurve
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.flightlog.airframe import stated_airframe, usual_airframe
from cpfls_cli.flightlog.conversion import as_mapped
from cpfls_cli.flightlog.layouts import Parameters, lifting_rotors
from cpfls_cli.flightlog.names import column_groups, is_of, named_signals
from cpfls_cli.flightlog.recognised import LogTable, holding_values
from cpfls_cli.flightlog.rotor_columns import FASTER, RotorColumns, RotorGuess, find_rotors, too_slow
from cpfls_cli.flightlog.settings import ImportSettings, SignalMap
from cpfls_cli.flightlog.topics import REBUILT, STAMP, Topics, logged_hz
from cpfls_cli.result import about, result

_PX4_NEW: Final = tuple(f"vehicle_{name}_setpoint.xyz[{axis}]" for name in ("torque", "thrust") for axis in range(3))
_PX4_OLD: Final = tuple(f"actuator_controls_0.control[{axis}]" for axis in range(4))
_RATE: Final = ("RATE.ROut", "RATE.POut", "RATE.YOut", "RATE.AOut")
_BATTERY: Final = ("MOTB.LiftMax", "MOTB.BatVolt", "BARO.Press", "BARO.Alt", "BARO.GndTemp")
_OUTPUTS: Final = tuple(
    f"{name}[{motor}]" for name in ("actuator_motors.control", "actuator_outputs.output") for motor in range(16)
)
SOURCES: Final = (
    *(*_PX4_NEW, *_PX4_OLD, *_RATE, *_BATTERY, *_OUTPUTS),
    *(f"actuator_outputs[1].output[{motor}]" for motor in range(16)),
    *(f"RCOU.{name}{motor}" for name in ("C", "Ch") for motor in range(1, 17)),
)
"""All columns that rebuilding reads."""

# What rebuilt commands have to reach: share of what turns about each axis, lag, scale, and error of the mean, share of
# full. docs/import.md has the study.
_LEAST_EXPLAINED, _MOST_LAG_S, _SCALES, _MOST_OFFSET = 0.9, 0.01, (0.9, 1.1), 0.01
# Root mean square of commands about an axis, share of full, below which the resolution of outputs hides them; lag up to
# which the logged ones are on time; and how far apart stamps are that are of one step of the autopilot, s.
_SMALLEST, _ON_TIME_S, _AT_ONCE_S = 2e-3, 5e-3, 1e-3
# Age that outputs may have that ArduPilot reads back from another processor, and the rate of what is mixed from which
# on the moment of each of them can be found.
_READ_BACK_S, _OFTEN_HZ = 0.08, 100.0
_NOTHING: Final = "it lacks logged commands to compare with, what they are mixed from, or its frame"
_FEWEST: Final = 30  # Logged samples in flight that are compared.
_FLIES: Final = 0.35  # Share of the usual mean command from which on the vehicle flies.
_LEAST_COMMAND: Final = 0.03
_SHIFTS_S: Final = np.arange(-30, 31) * 2e-3
# Of the standard atmosphere as ArduPilot has it: kg/m^3, J/(kg K), K, K/m.
_DENSITY_AT_SEA, _GAS, _KELVIN, _LAPSE = 1.225, 287.26, 273.15, 0.0065


@result
class Rebuilt:
    """Commands of the rotors that are rebuilt, and how well they reproduce the logged ones."""

    time: Array = about("stamps of the log", "rebuilt_time", unit="s", brief=False)
    commands: Array = about("of the rotors, shares of full, as they are logged", "rebuilt_time", "rotor", brief=False)
    limited: Array = about("whether the autopilot had to change what it mixed", "rebuilt_time", brief=False)
    source: str = about("what they are rebuilt from")
    rate_hz: float = about("rebuilt commands in a second", unit="Hz")
    logged_hz: float = about("logged commands in a second", unit="Hz")
    samples: int = about("logged samples in flight that were compared")
    differences: float = about("share of what differs between the rotors that is explained", gaps=True)
    by_axis: Array = about("the same of what turns about roll, pitch and yaw", "axis", gaps=True)
    common: float = about("share of the variance of the rotors' mean that is explained", gaps=True)
    lag: float = about("by which the logged ones come after the rebuilt ones", unit="s", gaps=True)
    scale: float = about("logged differences between rotors over rebuilt ones", gaps=True)
    error: float = about("root mean square of rebuilt less logged, share of full", gaps=True)
    offset: float = about("root mean square of the error of the rotors' mean, share of full", gaps=True)
    refused: str = about("why they are not used; empty where they are good", default="")

    @property
    def faster(self) -> bool:
        """Whether they are good and come more often than the logged ones."""
        return not self.refused and self.rate_hz > FASTER * self.logged_hz

    @property
    def topic(self) -> dict[str, Array]:
        """The columns of the derived topic."""
        return {STAMP: self.time} | {f"rotor[{index}]": own for index, own in enumerate(self.commands.T)}

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the derived columns."""
        return tuple(f"{REBUILT}.rotor[{index}]" for index in range(self.commands.shape[1]))

    @property
    def sentence(self) -> str:
        """Say how they come about and how good they are."""
        return (
            f"rotor commands are rebuilt from {self.source}: {self.rate_hz:.3g} Hz instead of {self.logged_hz:.3g};"
            f" they explain {100 * min(self.differences, 0.999):.3g} % of what was logged between the rotors, within"
            f" {100 * max(self.error, 1e-4):.2g} % of full"
        )


@dataclass(frozen=True, kw_only=True)
class _Mixed:
    """What an autopilot mixes: commands on their clock, and how."""

    time: Array
    thrust: Array
    turning: Array
    allocation: Allocation
    source: str
    battery: Array | float = 1.0
    late_s: float = 0.0


class _CannotRebuildError(Exception):
    """Something that rebuilding needs is missing."""


def rebuilt_rotors(topics: Topics, parameters: Parameters, system: str) -> Rebuilt | None:
    """Rebuild the commands of the rotors of a log of PX4, ArduPilot or Betaflight.

    Parameters
    ----------
    topics : mapping from topic to mapping from field to array, shape (sample,)
        As a reader gives them; of `SOURCES` what the log holds is enough.

    Returns
    -------
    Rebuilt or None
        None where the log holds nothing to rebuild from, or no commands to compare with; `refused` says what
        speaks against the others.
    """
    held = {topic: {name: own for name, own in fields.items() if len(own)} for topic, fields in topics.items()}
    try:
        log = LogTable({topic: fields for topic, fields in held.items() if fields}, {})
    except InputError:
        return None
    named = holding_values(log, named_signals(column_groups(log.names), system)).get("rotor_command", [])
    found = [(own, *log.values(own.group.columns)) for own in named]
    command = find_rotors({"rotor_speed": [], "rotor_command": found}, parameters, system).command
    return None if command is None else _rebuilt(log, command, parameters, system)


def with_topic(
    topics: Topics, parameters: Parameters, system: str, settings: ImportSettings
) -> tuple[Topics, tuple[str, ...]]:
    """Add the columns that a config asks for and that no log holds, and say how good they are."""
    rebuilt = rebuilt_rotors(topics, parameters, system)
    command = settings.signals.get("rotor_command")
    others = command is not None and any(choice.columns[0].partition(".")[0] in topics for choice in command.otherwise)
    if rebuilt is not None and not rebuilt.refused and (rebuilt.faster or not others):
        return {**topics, REBUILT: rebuilt.topic}, (rebuilt.sentence,)
    if others:
        return topics, ()
    why = _NOTHING if rebuilt is None else rebuilt.refused
    raise InputError(
        f"{REBUILT}.rotor: cannot be rebuilt from this log ({why}); name the logged commands in import.signals"
    )


def with_rebuilt(
    log: LogTable, rotors: RotorColumns, parameters: Parameters, system: str
) -> tuple[LogTable, RotorColumns, Rebuilt | None]:
    """Let rebuilt commands take the place of logged ones that are slower; say why where they cannot."""
    rebuilt = None if log.flat or rotors.command is None else _rebuilt(log, rotors.command, parameters, system)
    if rebuilt is None or rotors.command is None or rebuilt.rate_hz <= FASTER * rebuilt.logged_hz:
        return log, rotors, None
    if rebuilt.refused:
        why = f"rotor commands are not rebuilt from {rebuilt.source}: {rebuilt.refused}"
        return log, replace(rotors, warnings=(*rotors.warnings, why)), None
    logged = rotors.command.guess
    kept = f"{', '.join(logged.columns.columns)}: the logged commands; name them in the config to use them instead"
    columns = SignalMap(columns=rebuilt.columns, unit="1")
    guess = replace(logged, columns=columns, reason=rebuilt.sentence)
    command = RotorGuess(guess, rebuilt.rate_hz, rotors.command.kind, rotors.command.left_out)
    speed, left_out = rotors.speed, (*rotors.left_out, kept)
    if speed is not None and speed.rate_hz * FASTER < command.rate_hz:
        left_out = (
            *left_out,
            f"{speed.columns.columns[0]} and the columns with it: rotor speeds at {speed.rate_hz:.3g} Hz",
        )
        speed = None
    slow = (each for own in (speed, command) if own for each in too_slow(own, system, parameters))
    more = log.with_topic(REBUILT, rebuilt.topic)
    found = replace(rotors, speed=speed, command=command, left_out=left_out, warnings=(rebuilt.sentence, *slow))
    return more, found, rebuilt


def _rebuilt(log: LogTable, command: RotorGuess, parameters: Parameters, system: str) -> Rebuilt | None:
    columns = command.columns
    if columns.unit != "1" or columns.mixer is not None:
        return None
    slow, values = log.values(columns.columns)
    logged = as_mapped(values, columns)
    try:
        mixed = _mixed(log, columns, parameters, system)
    except (_CannotRebuildError, ComputationError, InputError):
        return None
    if mixed is None or len(mixed.time) < _FEWEST:
        return None
    commands = mixed.allocation.commands(mixed.thrust, mixed.turning, mixed.battery)
    compared = _compared(mixed, commands, slow, logged)
    return Rebuilt(
        time=mixed.time,
        commands=commands,
        limited=mixed.allocation.limited(mixed.thrust, mixed.turning),
        source=mixed.source,
        rate_hz=logged_hz(mixed.time),
        logged_hz=logged_hz(slow),
        **compared._asdict(),
        refused=_refusal(compared, mixed.late_s),
    )


def _mixed(log: LogTable, columns: SignalMap, parameters: Parameters, system: str) -> _Mixed | None:
    names = {*log.names}
    if is_of(system, "PX4"):
        outputs = "output" in columns.columns[0]
        new = {*_PX4_NEW} <= names
        if new or {*_PX4_OLD} <= names:
            return _of_px4(log, columns, parameters, new=new, outputs=outputs)
    if is_of(system, "ArduPilot") and {*_RATE} <= names:
        return _of_ardupilot(log, columns, parameters)
    if is_of(system, "Betaflight") and {"axisP[0]", "rcCommand[3]"} <= names:
        return _of_betaflight(log, columns, parameters)
    return None


def _of_px4(log: LogTable, columns: SignalMap, parameters: Parameters, *, new: bool, outputs: bool) -> _Mixed:
    rule, count = AUTOPILOTS["px4"].mixer, len(columns.columns)
    lifting = lifting_rotors(parameters)
    if lifting and len(lifting) != count:
        raise _CannotRebuildError
    mix = px4_mix(rule, parameters, lifting) if lifting else _frame_mix("px4", parameters, count, "PX4")
    if new:
        time, turning = log.values(_PX4_NEW[:3])
        of_thrust, thrusts = log.values(_PX4_NEW[3:])
        thrust = np.interp(time, of_thrust, -thrusts[:, 2])
        source = "vehicle_torque_setpoint"
    else:
        time, values = log.values(_PX4_OLD)
        turning, thrust, source = values[:, :3], values[:, 3], "actuator_controls_0"
    # The curve lies between the allocation and the outputs.
    expo = float(parameters.get("THR_MDL_FAC", 0.0)) if outputs else 0.0
    limits = Limits(by="px4", airmode=int(float(parameters.get("MC_AIRMODE", 0))))
    allocation = Allocation(mix=mix, limits=limits, curve=ThrustCurve(expo))
    by = "CA_ROTOR*" if lifting else "the frame"
    return _Mixed(time=time, thrust=thrust, turning=turning, allocation=allocation, source=f"{source} and {by}")


def _of_ardupilot(log: LogTable, columns: SignalMap, parameters: Parameters) -> _Mixed:
    def of(name: str, usual: float) -> float:
        return float(parameters.get(f"MOT_{name}", parameters.get(f"Q_M_{name}", usual)))

    if "MOT_SPIN_MIN" not in parameters and "Q_M_SPIN_MIN" not in parameters:
        # Before 3.4 throttle was mixed in other units.
        raise _CannotRebuildError
    mix = _frame_mix("ardupilot", parameters, len(columns.columns), "ArduPilot")
    time, values = log.values(_RATE)
    gain, battery = np.ones(len(time)), np.ones((len(time), 1))
    if {*_BATTERY[:2]} <= {*log.names}:
        at, (lift, volts) = _on(log, _BATTERY[:2])
        if len(at):
            held = np.interp(time, at, np.where(volts > 0, volts, 1.0))
            gain, battery = 1 / np.interp(time, at, np.where(lift > 0, lift, 1.0)), held[:, None]
    gain = gain / _air_density(log, time)
    limits = Limits(
        by="ardupilot", yaw_headroom=1e-3 * of("YAW_HEADROOM", 200.0), throttle_mean=0.5 * of("THST_HOVER", 0.35)
    )
    curve = ThrustCurve(of("THST_EXPO", 0.65), of("SPIN_MIN", 0.15), of("SPIN_MAX", 0.95))
    return _Mixed(
        time=time,
        thrust=gain * values[:, 3],
        turning=gain[:, None] * values[:, :3],
        allocation=Allocation(mix=mix, limits=limits, curve=curve),
        source="RATE and the frame",
        battery=battery,
        late_s=_READ_BACK_S if logged_hz(time) >= _OFTEN_HZ else 0.0,
    )


def _air_density(log: LogTable, time: Array) -> Array:
    """Give the density of the air over that at sea level, by which ArduPilot divides what it asks for."""
    names = _BATTERY[2:]
    if not {*names} <= {*log.names}:
        return np.ones(len(time))
    at, (pressure, height, ground) = _on(log, names)
    if not len(at):
        return np.ones(len(time))
    density = pressure / (_GAS * (ground + _KELVIN - _LAPSE * height)) / _DENSITY_AT_SEA
    return np.asarray(np.clip(np.interp(time, at, density), 0.5, 1.25))


def _on(log: LogTable, names: tuple[str, ...]) -> tuple[Array, Array]:
    time, values = log.values(names)
    return time, values.T


def _of_betaflight(log: LogTable, columns: SignalMap, parameters: Parameters) -> _Mixed:
    own = AUTOPILOTS["betaflight"]
    terms = [[f"axis{term}[{axis}]" for term in "PIDFS" if f"axis{term}[{axis}]" in log.names] for axis in range(3)]
    time, values = log.values([name for names in terms for name in names])
    ends = np.cumsum([0, *map(len, terms)])
    sums = np.column_stack([values[:, begin:end].sum(axis=1) for begin, end in pairwise(ends)])
    limit = [
        float(parameters.get(name, usual)) for name, usual in (("pidsum_limit", 500.0), ("pidsum_limit_yaw", 400.0))
    ]
    asked = np.clip(sums, -np.array(limit)[[0, 0, 1]], np.array(limit)[[0, 0, 1]]) / 1000.0
    throttle = "setpoint[3]" if "setpoint[3]" in log.names else "rcCommand[3]"
    thrust = log.values([throttle])[1][:, 0] / 1000.0 - (throttle == "rcCommand[3]")
    mix = _frame_mix("betaflight", {}, len(columns.columns), "Betaflight")
    # Its pitch is positive nose down, its yaw counter-clockwise.
    turning = asked * (1.0, -1.0, -1.0)
    motors = as_mapped(log.values(columns.columns)[1], columns)
    yaw = (motors - motors.mean(axis=1, keepdims=True)) @ mix[:, 3]
    if len(yaw) == len(turning) and float(yaw @ turning[:, 2]) < 0:
        # Rotors that turn the other way round, which no header states.
        mix = mix * (1.0, 1.0, 1.0, -1.0)
    spread: Spread = _SPREADS.get(str(parameters.get("mixer_type", "")), "none")
    limits = Limits(by="betaflight", airmode=1, spread=spread)
    curve = ThrustCurve(0.01 * float(parameters.get("thrust_linear", 0.0)), series=own.series)
    allocation = Allocation(mix=mix, limits=limits, curve=curve)
    return _Mixed(time=time, thrust=thrust, turning=turning, allocation=allocation, source="axisP, axisI, axisD, axisF")


_SPREADS: Final[Mapping[str, Spread]] = {"LINEAR": "linear", "DYNAMIC": "dynamic"}


def _frame_mix(autopilot: str, parameters: Parameters, count: int, kind: str) -> Array:
    airframe = stated_airframe(parameters, count) or usual_airframe(kind, count)
    if airframe is None or len(airframe.rotors) != count:
        raise _CannotRebuildError
    places = np.array([(rotor.direction[0], -rotor.direction[1]) for rotor in airframe.rotors])
    spins = np.array([float(rotor.spin) for rotor in airframe.rotors])
    return factor_mix(AUTOPILOTS[autopilot].mixer, places, spins, inverse=autopilot == "px4")


class _Compared(NamedTuple):
    samples: int
    differences: float = np.nan
    by_axis: Array = np.full(3, np.nan)
    common: float = np.nan
    lag: float = np.nan
    scale: float = np.nan
    error: float = np.nan
    offset: float = np.nan

    @property
    def least(self) -> float:
        """The least of the shares about axes about which it turns."""
        return float(np.fmin.reduce(self.by_axis))


def _compared(mixed: _Mixed, commands: Array, slow: Array, logged: Array) -> _Compared:
    """Hold rebuilt commands against logged ones in flight, at the stamps of these.

    Where each of the logged ones may be late by itself and they are not explained at their stamps, the best moment of
    each is taken, one number for all rotors.
    """
    time, late_s, axes = mixed.time, mixed.late_s, np.asarray(np.linalg.pinv(mixed.allocation.mix), dtype=float)[1:]
    reach = max(float(_SHIFTS_S[-1]), late_s)
    mean = logged.mean(axis=1)
    driven = mean[mean > _LEAST_COMMAND]
    least = _FLIES * float(np.median(driven)) if len(driven) else np.inf
    flies = (mean > least) & (slow >= time[0] + reach) & (slow <= time[-1] - reach)
    at, own = slow[flies], logged[flies]
    if len(at) < _FEWEST:
        return _Compared(len(at))

    def off(shift_s: float) -> Array:
        return np.asarray(np.column_stack([np.interp(at - shift_s, time, column) for column in commands.T]) - own)

    lost = [float((_between(off(shift)) ** 2).sum()) for shift in _SHIFTS_S]
    error = off(0.0)
    # Whether they are right is seen where both were logged at once; how near they come is that of all.
    near = np.abs(time[np.searchsorted(0.5 * (time[1:] + time[:-1]), at)] - at) <= _AT_ONCE_S
    near = near if near.sum() >= _FEWEST else np.ones(len(at), dtype=bool)
    found = _explained(axes, own[near], error[near], _lowest(lost))
    found = found._replace(samples=len(at), error=float(np.sqrt((error**2).mean())))
    if not late_s or (found.least >= _LEAST_EXPLAINED and abs(found.lag) < _ON_TIME_S):
        return found
    shifts = np.arange(0.0, late_s + 1e-9, 0.5 / _OFTEN_HZ)
    each = np.array([off(shift) for shift in shifts])
    best = (each**2).sum(axis=2).argmin(axis=0)
    return _explained(axes, own, each[best, np.arange(len(at))], float(np.median(shifts[best])))


def _explained(axes: Array, own: Array, error: Array, lag_s: float) -> _Compared:
    """Sum up errors of rebuilt commands, shape (sample, rotor), against logged ones."""
    turns, off = own @ axes.T, error @ axes.T
    size = ((turns - turns.mean(axis=0)) ** 2).mean(axis=0)
    seen = size > _SMALLEST**2
    by_axis = 1 - np.divide((off**2).mean(axis=0), size, out=np.full(3, np.nan), where=seen)
    between, mean = _between(own), own.mean(axis=1)
    total, whole = float(((between - between.mean(axis=0)) ** 2).sum()), float(((mean - mean.mean()) ** 2).sum())
    mine = _between(own + error)
    return _Compared(
        samples=len(own),
        differences=1 - float((_between(error) ** 2).sum()) / total if total > 0 else np.nan,
        by_axis=by_axis,
        common=1 - float((error.mean(axis=1) ** 2).sum()) / whole if whole > 0 else np.nan,
        lag=lag_s,
        scale=float((between * mine).sum() / (mine**2).sum()) if mine.any() else np.nan,
        error=float(np.sqrt((error**2).mean())),
        offset=float(np.sqrt((error.mean(axis=1) ** 2).mean())),
    )


def _between(values: Array) -> Array:
    return np.asarray(values - values.mean(axis=1, keepdims=True))


def _lowest(lost: list[float]) -> float:
    """Find the shift with the least error, between those that were tried by a parabola, s."""
    best = int(np.argmin(lost))
    if not 0 < best < len(lost) - 1:
        return float(_SHIFTS_S[best])
    before, least, after = lost[best - 1 : best + 2]
    bend = before - 2 * least + after
    step = 0.5 * (before - after) / bend if bend > 0 else 0.0
    return float(_SHIFTS_S[best] + step * (_SHIFTS_S[1] - _SHIFTS_S[0]))


def _refusal(found: _Compared, late_s: float) -> str:
    if found.samples < _FEWEST:
        return f"only {found.samples} logged samples in flight to compare them with, {_FEWEST} are needed"
    if not found.least >= _LEAST_EXPLAINED:
        axis = ("roll", "pitch", "yaw")[int(np.nanargmin(found.by_axis))] if np.isfinite(found.least) else "any axis"
        return f"they explain {100 * max(found.least, 0.0):.3g} % of what was logged about {axis}"
    if not _SCALES[0] <= found.scale <= _SCALES[1]:
        return f"what was logged between the rotors is {found.scale:.3g} times as large"
    if not (found.common >= _LEAST_EXPLAINED or found.offset <= _MOST_OFFSET):
        return f"their mean is {100 * found.offset:.2g} % of full off the logged one"
    if not -_MOST_LAG_S <= found.lag <= _MOST_LAG_S + late_s:
        return f"the logged ones come {1e3 * found.lag:.3g} ms later"
    return ""
