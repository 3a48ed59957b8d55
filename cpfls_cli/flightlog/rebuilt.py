"""Commands of the rotors rebuilt from what the autopilot allocates, which is often logged faster than they are.

A log may hold the commands of the rotors 10 times a second and what they are mixed from 50 times and more. They are
mixed again (`autopilots.motors`) and compared with the logged ones sample by sample: only what reproduces those is
used.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.autopilots.motors import Allocation, Limits, ThrustCurve, factor_mix, px4_mix
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.flightlog.airframe import stated_airframe, usual_airframe
from cpfls_cli.flightlog.conversion import as_mapped
from cpfls_cli.flightlog.names import column_groups, is_of, named_signals
from cpfls_cli.flightlog.recognised import Guess, LogTable, holding_values
from cpfls_cli.flightlog.rotor_columns import FASTER, RotorColumns, find_rotors, left_for_commands, too_slow
from cpfls_cli.flightlog.settings import ImportSettings, SignalMap
from cpfls_cli.flightlog.stated_vehicle import Parameters, lifting_rotors
from cpfls_cli.flightlog.topics import REBUILT, STAMP, Topics, logged_hz
from cpfls_cli.flightlog.vocabulary import ARDUPILOT, PX4
from cpfls_cli.lag import fit_delay

_PX4_NEW: Final = tuple(f"vehicle_{name}_setpoint.xyz[{axis}]" for name in ("torque", "thrust") for axis in range(3))
_PX4_OLD: Final = tuple(f"actuator_controls_0.control[{axis}]" for axis in range(4))
_RATE: Final = ("RATE.ROut", "RATE.POut", "RATE.YOut", "RATE.AOut")
_BATTERY: Final = ("MOTB.LiftMax", "MOTB.BatVolt")
_AIR: Final = ("BARO.Press", "BARO.Alt", "BARO.GndTemp")

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
_SHIFTS_S: Final = np.arange(-30.0, 31.0) * 2e-3
# Of the standard atmosphere as ArduPilot has it: kg/m^3, J/(kg K), K, K/m.
_DENSITY_AT_SEA, _GAS, _KELVIN, _LAPSE = 1.225, 287.26, 273.15, 0.0065


class Rebuilt(NamedTuple):
    """Commands of the rotors that are rebuilt, and how well they reproduce the logged ones; NaN where none do."""

    time: Array  # Stamps of the log, s.
    commands: Array  # Shape (time, rotor), shares of full, as they are logged.
    source: str
    rate_hz: float
    logged_hz: float
    samples: int = 0  # Logged ones in flight that were compared.
    differences: float = np.nan  # Share of what differs between the rotors that is explained.
    by_axis: Array = np.full(3, np.nan)  # The same of what turns about roll, pitch and yaw.
    common: float = np.nan  # Share of the variance of the rotors' mean that is explained.
    lag: float = np.nan  # By which the logged ones come after the rebuilt ones, s.
    scale: float = np.nan  # Logged differences between rotors over rebuilt ones.
    error: float = np.nan  # Root mean square of rebuilt less logged, and of that of the rotors' mean, shares of full.
    offset: float = np.nan
    refused: str = ""  # Why they are not used; empty where they are good.

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


class _Mixed(NamedTuple):
    """What an autopilot mixes: commands on their clock, and how."""

    source: str
    time: Array
    thrust: Array
    turning: Array
    allocation: Allocation
    battery: Array | float = 1.0
    late_s: float = 0.0


def rebuilt_rotors(topics: Topics, parameters: Parameters, system: str) -> Rebuilt | None:
    """Rebuild the commands of the rotors of a log of PX4 or ArduPilot, as its reader gives it.

    None where the log holds nothing to rebuild from, or no commands to compare with; `refused` says what speaks against
    the others.
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
        return log, rotors._replace(warnings=(*rotors.warnings, why)), None
    logged, speed = rotors.command, rotors.speed
    kept = f"{', '.join(logged.columns.columns)}: the logged commands; name them in the config to use them instead"
    columns, left_out = SignalMap(columns=rebuilt.columns, unit="1"), (*rotors.left_out, kept)
    command = replace(logged, columns=columns, reason=rebuilt.sentence, rate_hz=rebuilt.rate_hz)
    if speed is not None and speed.rate_hz * FASTER < command.rate_hz:
        left_out, speed = (*left_out, left_for_commands(speed)), None
    slow = (each for own in (speed, command) if own for each in too_slow(own, system, parameters))
    found = rotors._replace(speed=speed, command=command, left_out=left_out, warnings=(rebuilt.sentence, *slow))
    return log.with_topic(REBUILT, rebuilt.topic), found, rebuilt


def _rebuilt(log: LogTable, command: Guess, parameters: Parameters, system: str) -> Rebuilt | None:
    columns, names = command.columns, {*log.names}
    if columns.unit != "1" or columns.mixer is not None:
        return None
    try:
        if is_of(system, PX4) and any({*own} <= names for own in (_PX4_NEW, _PX4_OLD)):
            mixed = _of_px4(log, columns, parameters, new={*_PX4_NEW} <= names)
        elif is_of(system, ARDUPILOT) and {*_RATE} <= names:
            mixed = _of_ardupilot(log, columns, parameters)
        else:
            return None
    except (ComputationError, InputError):
        return None
    if len(mixed.time) < _FEWEST:
        return None
    slow, values = log.values(columns.columns)
    commands = mixed.allocation.commands(mixed.thrust, mixed.turning, mixed.battery)
    found = Rebuilt(mixed.time, commands, mixed.source, logged_hz(mixed.time), logged_hz(slow))
    found = _compared(found, mixed, slow, as_mapped(values, columns))
    return found._replace(refused=_refusal(found, mixed.late_s))


def _of_px4(log: LogTable, columns: SignalMap, parameters: Parameters, *, new: bool) -> _Mixed:
    rule, count = AUTOPILOTS["px4"].mixer, len(columns.columns)
    lifting = lifting_rotors(parameters)
    if lifting and len(lifting) != count:
        raise ComputationError(_NOTHING)
    mix = px4_mix(rule, parameters, lifting) if lifting else _frame_mix("px4", parameters, count, PX4)
    if new:
        time, turning = log.values(_PX4_NEW[:3])
        of_thrust, thrusts = log.values(_PX4_NEW[3:])
        thrust = np.interp(time, of_thrust, -thrusts[:, 2])
        source = "vehicle_torque_setpoint"
    else:
        time, values = log.values(_PX4_OLD)
        turning, thrust, source = values[:, :3], values[:, 3], "actuator_controls_0"
    # The curve lies between the allocation and the outputs.
    expo = float(parameters.get("THR_MDL_FAC", 0.0)) if "output" in columns.columns[0] else 0.0
    limits = Limits(by="px4", airmode=int(float(parameters.get("MC_AIRMODE", 0))))
    allocation = Allocation(mix=mix, limits=limits, curve=ThrustCurve(expo))
    by = "CA_ROTOR*" if lifting else "the frame"
    return _Mixed(f"{source} and {by}", time, thrust, turning, allocation)


def _of_ardupilot(log: LogTable, columns: SignalMap, parameters: Parameters) -> _Mixed:
    def of(name: str, usual: float) -> float:
        return float(parameters.get(f"MOT_{name}", parameters.get(f"Q_M_{name}", usual)))

    if "MOT_SPIN_MIN" not in parameters and "Q_M_SPIN_MIN" not in parameters:
        # Before 3.4 throttle was mixed in other units.
        raise ComputationError(_NOTHING)
    mix = _frame_mix("ardupilot", parameters, len(columns.columns), ARDUPILOT)
    time, values = log.values(_RATE)
    gain, battery = np.ones(len(time)), np.ones((len(time), 1))
    at, held = log.values(_BATTERY) if {*_BATTERY} <= {*log.names} else (np.empty(0), np.empty((0, 2)))
    if len(at):
        lift, volts = (np.interp(time, at, np.where(own > 0, own, 1.0)) for own in held.T)
        gain, battery = 1 / lift, volts[:, None]
    at, air = log.values(_AIR) if {*_AIR} <= {*log.names} else (np.empty(0), np.empty((0, 3)))
    if len(at):
        # By the density of the air over that at sea level ArduPilot divides what it asks for.
        pressure, height, ground = air.T
        density = pressure / (_GAS * (ground + _KELVIN - _LAPSE * height)) / _DENSITY_AT_SEA
        gain = gain / np.clip(np.interp(time, at, density), 0.5, 1.25)
    limits = Limits(
        by="ardupilot", yaw_headroom=1e-3 * of("YAW_HEADROOM", 200.0), throttle_mean=0.5 * of("THST_HOVER", 0.35)
    )
    curve = ThrustCurve(of("THST_EXPO", 0.65), of("SPIN_MIN", 0.15), of("SPIN_MAX", 0.95))
    allocation = Allocation(mix=mix, limits=limits, curve=curve)
    late_s = _READ_BACK_S if logged_hz(time) >= _OFTEN_HZ else 0.0
    thrust, turning = gain * values[:, 3], gain[:, None] * values[:, :3]
    return _Mixed("RATE and the frame", time, thrust, turning, allocation, battery, late_s)


def _frame_mix(autopilot: str, parameters: Parameters, count: int, kind: str) -> Array:
    airframe = stated_airframe(parameters, count) or usual_airframe(kind, count)
    if airframe is None or len(airframe.rotors) != count:
        raise ComputationError(_NOTHING)
    places = np.array([(rotor.direction[0], -rotor.direction[1]) for rotor in airframe.rotors])
    spins = np.array([float(rotor.spin) for rotor in airframe.rotors])
    return factor_mix(AUTOPILOTS[autopilot].mixer, places, spins, inverse=autopilot == "px4")


def _compared(found: Rebuilt, mixed: _Mixed, slow: Array, logged: Array) -> Rebuilt:
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
        return found._replace(samples=len(at))

    def off(shift_s: float) -> Array:
        return np.asarray(np.column_stack([np.interp(at - shift_s, time, column) for column in found.commands.T]) - own)

    def moved(shift_s: float) -> tuple[Array, Array]:
        return _between(off(shift_s) + own)[..., None], _between(own)

    lag = fit_delay(_SHIFTS_S, moved, np.zeros(len(at), dtype=np.int64), pooled=True).delay
    error = off(0.0)
    # Whether they are right is seen where both were logged at once; how near they come is that of all.
    near = np.abs(time[np.searchsorted(0.5 * (time[1:] + time[:-1]), at)] - at) <= _AT_ONCE_S
    near = near if near.sum() >= _FEWEST else np.ones(len(at), dtype=bool)
    at_stamps = _explained(found, axes, own[near], error[near], float(lag))
    at_stamps = at_stamps._replace(samples=len(at), error=float(np.sqrt((error**2).mean())))
    if not late_s or (np.fmin.reduce(at_stamps.by_axis) >= _LEAST_EXPLAINED and abs(at_stamps.lag) < _ON_TIME_S):
        return at_stamps
    shifts = np.arange(0.0, late_s + 1e-9, 0.5 / _OFTEN_HZ)
    each = np.array([off(shift) for shift in shifts])
    best = (each**2).sum(axis=2).argmin(axis=0)
    return _explained(found, axes, own, each[best, np.arange(len(at))], float(np.median(shifts[best])))


def _explained(found: Rebuilt, axes: Array, own: Array, error: Array, lag_s: float) -> Rebuilt:
    """Sum up errors of rebuilt commands, shape (sample, rotor), against logged ones."""
    turns, off = own @ axes.T, error @ axes.T
    size = ((turns - turns.mean(axis=0)) ** 2).mean(axis=0)
    between, mean = _between(own), own.mean(axis=1)
    total, whole = float(((between - between.mean(axis=0)) ** 2).sum()), float(((mean - mean.mean()) ** 2).sum())
    mine = _between(own + error)
    return found._replace(
        samples=len(own),
        differences=1 - float((_between(error) ** 2).sum()) / total if total > 0 else np.nan,
        by_axis=1 - np.divide((off**2).mean(axis=0), size, out=np.full(3, np.nan), where=size > _SMALLEST**2),
        common=1 - float((error.mean(axis=1) ** 2).sum()) / whole if whole > 0 else np.nan,
        lag=lag_s,
        scale=float((between * mine).sum() / (mine**2).sum()) if mine.any() else np.nan,
        error=float(np.sqrt((error**2).mean())),
        offset=float(np.sqrt((error.mean(axis=1) ** 2).mean())),
    )


def _between(values: Array) -> Array:
    return np.asarray(values - values.mean(axis=1, keepdims=True))


def _refusal(found: Rebuilt, late_s: float) -> str:
    least = float(np.fmin.reduce(found.by_axis))  # About axes about which it turns.
    if found.samples < _FEWEST:
        return f"only {found.samples} logged samples in flight to compare them with, {_FEWEST} are needed"
    if not least >= _LEAST_EXPLAINED:
        axis = ("roll", "pitch", "yaw")[int(np.nanargmin(found.by_axis))] if np.isfinite(least) else "any axis"
        return f"they explain {100 * max(least, 0.0):.3g} % of what was logged about {axis}"
    if not _SCALES[0] <= found.scale <= _SCALES[1]:
        return f"what was logged between the rotors is {found.scale:.3g} times as large"
    if not (found.common >= _LEAST_EXPLAINED or found.offset <= _MOST_OFFSET):
        return f"their mean is {100 * found.offset:.2g} % of full off the logged one"
    if not -_MOST_LAG_S <= found.lag <= _MOST_LAG_S + late_s:
        return f"the logged ones come {1e3 * found.lag:.3g} ms later"
    return ""
