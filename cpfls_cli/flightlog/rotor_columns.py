"""Which columns drive the rotors or say how fast they turn, in which unit, and which of them are connected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.airframe import Parameters
from cpfls_cli.flightlog.names import Named
from cpfls_cli.flightlog.recognised import Sure
from cpfls_cli.flightlog.settings import SignalMap
from cpfls_cli.units import UnitName

_FEWEST = 3
_MUCH_FASTER = 2.0
_SLOW_HZ = 25.0
_USUAL_POLE_PAIRS = 7
_RPM_FROM = 4000.0
_SAME = 0.02
"""Part of the largest one's spread below which an output is not connected to a motor."""


@dataclass(frozen=True, kw_only=True)
class RotorGuess:
    """A signal of the rotors.

    Attributes
    ----------
    kind : str
        Kind of log that is known for such columns; empty where none is.
    rivals : tuple of (str, str)
        What would stand in the config, and why it is not ruled out.
    """

    signal: Literal["rotor_speed", "rotor_command"]
    columns: SignalMap
    reason: str
    sure: Sure
    rate_hz: float
    kind: str
    rivals: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, kw_only=True)
class RotorColumns:
    """All that a log says of its rotors.

    Attributes
    ----------
    speed, command : RotorGuess or None
    command_is : {"speed", "thrust"}
        What a command of unit 1 is a share of.
    left_out, warnings : tuple of str
    """

    speed: RotorGuess | None
    command: RotorGuess | None
    command_is: str = "speed"
    command_reason: str = ""
    command_sure: Sure = "guess"
    command_rivals: tuple[tuple[str, str], ...] = ()
    left_out: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


Found = tuple[Named, Array, Array]
"""A candidate, its stamps in s and its values, shape (sample, rotor)."""


def find_rotors(found: Mapping[str, Sequence[Found]], parameters: Parameters, system: str) -> RotorColumns:
    """Choose the columns of rotor speeds and of rotor commands.

    Parameters
    ----------
    found : mapping
        Candidates for ``rotor_speed`` and ``rotor_command``, the best first.
    parameters : mapping
        Of the autopilot, or of a header.
    """
    speed = next((g for f in _in_preference(found["rotor_speed"]) if (g := _speed(f, parameters)) is not None), None)
    command = next((g for f in found["rotor_command"] if (g := _command(f, parameters)) is not None), None)
    left_out = []
    if speed is not None and command is not None:
        counts = [len(guess.columns.columns) for guess in (speed, command)]
        if speed.rate_hz * _MUCH_FASTER < command.rate_hz:
            left_out.append(
                f"{speed.columns.columns[0]} and those beside it: rotor speeds at {speed.rate_hz:.3g} Hz, and the"
                f" commands come at {command.rate_hz:.3g} Hz"
            )
            speed = None
        elif counts[0] != counts[1]:
            left_out.append(
                f"{command.columns.columns[0]} and those beside it: {counts[1]} commands, {counts[0]} rotors"
            )
            command = None
    warnings = [
        f"the rotors are logged at {guess.rate_hz:.3g} Hz ({guess.columns.columns[0]}): too slow for motors that follow"
        " within some 50 ms; log them at 100 Hz or more"
        for guess in (speed, command)
        if guess is not None and guess.rate_hz < _SLOW_HZ
    ]
    meaning, reason, sure, rivals = _meaning(command, parameters, system)
    return RotorColumns(
        speed=speed,
        command=command,
        command_is=meaning,
        command_reason=reason,
        command_sure=sure,
        command_rivals=rivals,
        left_out=tuple(left_out),
        warnings=tuple(warnings),
    )


def _in_preference(found: Sequence[Found]) -> list[Found]:
    """Put electric speeds, whose pole pairs have to be known, behind mechanical ones."""
    return sorted(found, key=lambda entry: "erpm" in entry[0].group.pattern.lower())


def _connected(named: Named, values: Array, parameters: Parameters) -> list[int]:
    """List the outputs that move together with the most moving one; a count that is stated wins."""
    count = int(float(parameters.get("CA_ROTOR_COUNT", 0) or 0))
    functions = {
        int(float(parameters[f"SERVO{output}_FUNCTION"])): output - 1
        for output in range(1, values.shape[1] + 1)
        if f"SERVO{output}_FUNCTION" in parameters
    }
    # ArduPilot numbers its motors 33 to 40 and on; which output each has is free.
    motors = [functions[number] for number in range(33, 41) if number in functions]
    if named.known == "ArduPilot" and len(motors) >= _FEWEST:
        return motors
    if named.known == "PX4" and _FEWEST <= count <= values.shape[1] and "output" not in named.group.pattern:
        return list(range(count))
    spread = values.std(axis=0)
    return [index for index, own in enumerate(spread) if own > _SAME * float(spread.max()) > 0]


def _speed(found: Found, parameters: Parameters) -> RotorGuess | None:
    named, time, values = found
    chosen = _connected(named, values, parameters)
    if len(chosen) < _FEWEST:
        return None
    columns, values = tuple(named.group.columns[index] for index in chosen), values[:, chosen]
    level = float(np.median(np.abs(values)[np.abs(values) > 0.3 * float(np.abs(values).max())]))
    sign = tuple(float(value) for value in np.where(np.median(values, axis=0) < 0, -1.0, 1.0))
    unit, scale, reason, sure, rivals = _speed_unit(named, level, parameters)
    return RotorGuess(
        signal="rotor_speed",
        columns=SignalMap(columns=columns, unit=unit, scale=scale, sign=None if min(sign) > 0 else sign),
        reason=reason,
        sure=sure,
        rate_hz=1 / float(np.median(np.diff(time))),
        kind=named.known,
        rivals=rivals,
    )


Unit = tuple[UnitName, float, str, Sure, tuple[tuple[str, str], ...]]


def _speed_unit(named: Named, level: float, parameters: Parameters) -> Unit:
    called = f"called {named.group.pattern}, {level:.4g} in flight"
    if "erpm" in named.group.pattern.lower():
        factor = 100.0 if named.known == "Betaflight" else 1.0
        poles = float(parameters.get("motor_poles", 0) or 0)
        if poles:
            pairs = poles / 2
            return (
                "rpm",
                factor / pairs,
                f"{called}: electric, over motor_poles {poles:.0f} / 2 of the header",
                "named",
                (),
            )
        rivals = ((f"scale: {factor / 6:.6g}", "six pole pairs; the log does not say how many the motors have"),)
        return (
            "rpm",
            factor / _USUAL_POLE_PAIRS,
            f"{called}: electric, over 7 pole pairs, a usual number",
            "guess",
            rivals,
        )
    if named.unit is not None:
        return named.unit, named.scale, f"{called}: {named.unit} by its name", "named", ()
    if level > _RPM_FROM:
        return "rpm", 1.0, f"{called}: faster than rotors turn in rad/s", "data", ()
    return "rad/s", 1.0, f"{called}", "guess", (("unit: rpm", f"a level of {level:.4g} is possible in both"),)


def _command(found: Found, parameters: Parameters) -> RotorGuess | None:
    named, time, values = found
    chosen = _connected(named, values, parameters)
    if len(chosen) < _FEWEST:
        return None
    columns, values = tuple(named.group.columns[index] for index in chosen), values[:, chosen]
    taken = _command_unit(named, values, parameters)
    if taken is None:
        return None
    unit, scale, offset, reason, sure, rivals = taken
    return RotorGuess(
        signal="rotor_command",
        columns=SignalMap(columns=columns, unit=unit, scale=scale, offset=offset),
        reason=reason,
        sure=sure,
        rate_hz=1 / float(np.median(np.diff(time))),
        kind=named.known,
        rivals=rivals,
    )


Command = tuple[UnitName, float, float, str, Sure, tuple[tuple[str, str], ...]]
_SPEED_WORDS: Final = {"om", "omega", "omcmd", "rpm", "rads", "speed", "rad"}


def _command_unit(named: Named, values: Array, parameters: Parameters) -> Command | None:
    low, high = float(values.min()), float(np.quantile(values, 0.999))
    called = f"called {named.group.pattern}, up to {high:.4g}"
    stated = _stated_range(named, parameters)
    if stated is not None:
        begin, end, where = stated
        return "1", 1 / (end - begin), -begin / (end - begin), f"{called}: {begin:g} to {end:g} by {where}", "named", ()
    if named.known == "Crazyflie":
        return "1", named.scale, 0.0, f"{called}: 16 bits, as a Crazyflie has them", "named", ()
    if set(named.group.words) & _SPEED_WORDS:
        unit: UnitName = named.unit if named.unit in ("rpm", "rad/s") else "rpm" if high > _RPM_FROM else "rad/s"
        rivals = () if named.unit or unit == "rpm" else (("unit: rpm", "its size is possible in both"),)
        return unit, 1.0, 0.0, f"{called}: a speed that is asked for", "named" if not rivals else "guess", rivals
    if high <= 1.05 and low >= -1.05:
        return "1", 1.0, 0.0, f"{called}: shares of the largest", "data", ()
    if low >= 0 and high <= 101:
        return "1", 0.01, 0.0, f"{called}: per cent", "data", ()
    if low >= 800 and high <= 2300:
        rivals = (("scale: 0.00114286, offset: -1.22857", "where the range is 1075 to 1950, as PX4 once had it"),)
        return "1", 1e-3, -1.0, f"{called}: pulses of 1000 to 2000 us", "guess", rivals
    if low >= 0 and high <= 65536 and high > 2300:
        return "1", 1 / 65536, 0.0, f"{called}: 16 bits", "data", ()
    if low >= 0 and high <= 2048:
        return "1", 1 / 2000, -48 / 2000, f"{called}: 48 to 2047 of DShot", "guess", ()
    return None


def _stated_range(named: Named, parameters: Parameters) -> tuple[float, float, str] | None:
    """Give the range of outputs that the log's parameters state."""
    if named.known == "Betaflight" and "motorOutput" in parameters:
        low, high = (float(part) for part in str(parameters["motorOutput"]).split(",")[:2])
        return low, high, "motorOutput of the header"
    for low_name, high_name in (
        ("MOT_PWM_MIN", "MOT_PWM_MAX"),
        ("PWM_MIN", "PWM_MAX"),
        ("PWM_MAIN_MIN", "PWM_MAIN_MAX"),
    ):
        low, high = (float(parameters.get(name, 0) or 0) for name in (low_name, high_name))
        if 500 < low < high and ("output" in named.group.pattern or named.known == "ArduPilot"):
            return low, high, f"{low_name} and {high_name} of the log"
    if named.known == "ArduPilot":
        return 1000.0, 2000.0, "the usual pulses, since MOT_PWM_MIN and MOT_PWM_MAX are not set"
    return None


def _meaning(
    command: RotorGuess | None, parameters: Parameters, system: str
) -> tuple[str, str, Sure, tuple[tuple[str, str], ...]]:
    """Tell whether a command is a share of thrust or of speed."""
    if command is None:
        return "speed", "", "guess", ()
    if command.kind == "Crazyflie":
        if "motor.m" in command.columns.columns[0]:
            older = (("rotor_command_is: speed", "before 2022 the firmware logged what the motors got"),)
            return "thrust", "motor.m* of a Crazyflie are thrusts, before the battery is compensated", "named", older
        return "speed", "pwm.* of a Crazyflie is what the motors get", "named", ()
    factor = parameters.get("THR_MDL_FAC")
    if factor is not None:
        value = float(factor)
        if value >= 0.9:
            return "thrust", f"THR_MDL_FAC is {value:g}: the autopilot makes commands shares of thrust", "named", ()
        if value <= 0.1:
            return "speed", f"THR_MDL_FAC is {value:g}: the autopilot hands commands on as they are", "named", ()
        rival = (("rotor_command_is: thrust", f"THR_MDL_FAC is {value:g}, which lies between the two"),)
        return "speed", f"THR_MDL_FAC is {value:g}, between speed (0) and thrust (1)", "guess", rival
    if "MOT_THST_EXPO" in parameters or system.startswith("Ardu"):
        return "speed", "RCOU is what the motors get, behind the autopilot's own thrust curve", "named", ()
    rival = (("rotor_command_is: thrust", "the log does not say which"),)
    return "speed", f"taken as most motor controllers have it{f' ({system})' if system else ''}", "guess", rival
