"""Which columns drive the rotors or say how fast they turn, in which unit, and which of them are connected."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.airframe import Parameters
from cpfls_cli.flightlog.log_table import LogTable
from cpfls_cli.flightlog.logging_rates import log_faster
from cpfls_cli.flightlog.names import Named
from cpfls_cli.flightlog.recognised import Guess, KeyChoice, Rival, Sure
from cpfls_cli.flightlog.settings import SignalMap
from cpfls_cli.flightlog.vocabulary import ASKED, RANGES
from cpfls_cli.units import SPEED_UNITS, UnitName

_FEWEST = 3
"""Rotors of a multirotor."""

_MUCH_FASTER = 2.0
"""Times as often that commands have to come to be preferred to measured speeds."""

_SLOW_HZ = 25.0
"""Two samples in the 50 ms within which motors follow, and a half."""

_USUAL_POLE_PAIRS = 7
_RPM_FROM = 4000.0
"""Faster than rotors turn in rad/s; the smallest reach 3000."""

_FEWEST_SAMPLES = 20
"""For medians and rates."""

_MIXED = ("controller.cmd_thrust", "controller.cmd_roll", "controller.cmd_pitch", "controller.cmd_yaw")
_CRAZYFLIE_MIXER = ((1.0, -0.5, 0.5, 1.0), (1.0, -0.5, -0.5, -1.0), (1.0, 0.5, -0.5, 1.0), (1.0, 0.5, 0.5, -1.0))
"""Of M1 to M4 the factors of these columns: power_distribution_quadrotor.c of the firmware."""

_SAME = 0.02
"""Part of the largest one's spread below which an output is not connected to a motor."""


class _Unit(NamedTuple):
    """The unit of columns with scale and offset, and what tells it."""

    unit: UnitName
    scale: float
    offset: float
    reason: str
    sure: Sure
    rivals: tuple[Rival, ...] = ()


@dataclass(frozen=True)
class RotorGuess:
    """A signal of the rotors.

    Attributes
    ----------
    kind : str
        Kind of log that is known for such columns; empty where none is.
    """

    guess: Guess
    rate_hz: float
    kind: str

    @property
    def columns(self) -> SignalMap:
        """Columns, unit, scale and offset."""
        return self.guess.columns


@dataclass(frozen=True, kw_only=True)
class RotorColumns:
    """All that a log says of its rotors.

    Attributes
    ----------
    command_is : Choice or None
        What a command of unit 1 is a share of; None without one.
    """

    speed: RotorGuess | None
    command: RotorGuess | None
    command_is: KeyChoice | None
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
    # Electric speeds, whose pole pairs have to be known, come behind mechanical ones.
    speeds = sorted(found["rotor_speed"], key=lambda entry: _is_electric(entry[0]))
    speed, command = (
        next((guess for own in candidates if (guess := _guess(own, parameters)) is not None), None)
        for candidates in (speeds, found["rotor_command"])
    )
    left_out = []
    if speed is not None and command is not None:
        counts = [len(guess.columns.columns) for guess in (speed, command)]
        if speed.rate_hz * _MUCH_FASTER < command.rate_hz:
            left_out.append(
                f"{speed.columns.columns[0]} and the columns with it: rotor speeds at {speed.rate_hz:.3g} Hz; the"
                f" commands come at {command.rate_hz:.3g} Hz"
            )
            speed = None
        elif counts[0] != counts[1]:
            left_out.append(
                f"{command.columns.columns[0]} and the columns with it: {counts[1]} commands, {counts[0]} rotors"
            )
            command = None
    warnings = [warning for guess in (speed, command) if guess is not None for warning in _too_slow(guess, system)]
    if speed is None and command is None:
        warnings += [warning for own in found["rotor_command"] for warning in _beyond_commands(own, parameters)][:1]
    shares = command is not None and command.columns.unit == "1"
    return RotorColumns(
        speed=speed,
        command=command,
        command_is=_meaning(command, parameters, system) if command is not None and shares else None,
        left_out=tuple(left_out),
        warnings=tuple(warnings),
    )


def find_mixed(log: LogTable) -> RotorColumns | None:
    """Take what goes into the mixer of a Crazyflie for the commands of its motors; None where a log lacks it.

    Parameters
    ----------
    log : LogTable
        Without columns of rotors.
    """
    ending = _MIXED[0]
    begin = next((name.removesuffix(ending) for name in log.names if name.endswith(ending)), None)
    columns = tuple(f"{begin}{name}" for name in _MIXED)
    if begin is None or not set(columns) <= {*log.names}:
        return None
    time, values = log.values(columns)
    if len(time) < _FEWEST_SAMPLES or not np.ptp(values, axis=0).max() > 0:
        return None
    reason = (
        "the input of a Crazyflie's mixer, 16 bits; the firmware makes each motor's command from it: thrust, half of"
        " roll and pitch, and yaw, with the signs of its place"
    )
    mapped = SignalMap(columns=columns, unit="1", scale=1 / 65536, mixer=_CRAZYFLIE_MIXER)
    guess = Guess(signal="rotor_command", columns=mapped, reason=reason, sure="named")
    older = Rival("rotor_command_is: speed", "before 2022 the firmware passed what it had mixed to the motors")
    said = "a Crazyflie mixes thrusts, before it compensates for the battery"
    command = RotorGuess(guess, 1 / float(np.median(np.diff(time))), "Crazyflie")
    command_is = KeyChoice("rotor_command_is", "thrust", said, "named", (older,))
    return RotorColumns(
        speed=None, command=command, command_is=command_is, warnings=tuple(_too_slow(command, "Crazyflie"))
    )


def _too_slow(guess: RotorGuess, system: str) -> Iterator[str]:
    if guess.rate_hz < _SLOW_HZ:
        yield (
            f"the rotors are logged at {guess.rate_hz:.3g} Hz ({guess.columns.columns[0]}): too slow for motors that"
            f" respond within some 50 ms; log them at 100 Hz or more ({log_faster(system)})"
        )


def _beyond_commands(found: Found, parameters: Parameters) -> Iterator[str]:
    """Say where columns that are else commands of rotors hold numbers that no command is."""
    named, time, values = found
    beyond = (values < min(own.low for own in RANGES)) | (values > max(own.high for own in RANGES))
    kept = ~beyond.any(axis=1)
    if kept.all() or kept.sum() < _FEWEST_SAMPLES or _guess((named, time[kept], values[kept]), parameters) is None:
        return
    row = int(np.argmin(kept))
    index = int(np.argmax(np.abs(values).max(axis=0)))
    yield (
        f"{', '.join(named.group.columns)} look like commands of rotors except {named.group.columns[index]}, which"
        f" reaches {values[np.argmax(np.abs(values[:, index])), index]:.3g}: no command is that large, from"
        f" {time[row] - time[0]:.4g} s after the first stamp on; cut the log there, and run cpfls init again"
    )


def _is_electric(named: Named) -> bool:
    return "erpm" in named.group.pattern.lower()


def _guess(found: Found, parameters: Parameters) -> RotorGuess | None:
    """Take columns that are connected in the unit that is stated or fits; None where none does."""
    named, time, values = found
    chosen = _connected(named, values, parameters)
    if len(chosen) < _FEWEST:
        return None
    columns, values = tuple(named.group.columns[index] for index in chosen), values[:, chosen]
    is_speed = named.signal == "rotor_speed"
    taken = _speed_unit(named, values, parameters) if is_speed else _command_unit(named, values, parameters)
    if taken is None:
        return None
    sure, rivals = taken.sure, taken.rivals
    if len(chosen) == _FEWEST < len(named.group.columns):
        every = ", ".join(named.group.columns)
        left = ", ".join(column for column in named.group.columns if column not in columns)
        sure, rivals = "guess", (*rivals, Rival(f"columns: [{every}]", f"if {left}, which never changes, is a rotor's"))
    sign = tuple(float(value) for value in np.where(np.median(values, axis=0) < 0, -1.0, 1.0))
    guess = Guess(
        signal=named.signal,
        columns=SignalMap(
            columns=columns,
            unit=taken.unit,
            scale=taken.scale,
            offset=taken.offset,
            sign=sign if is_speed and min(sign) < 0 else None,
        ),
        reason=taken.reason,
        sure=sure,
        rivals=rivals,
    )
    return RotorGuess(guess, 1 / float(np.median(np.diff(time))), named.known)


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


def _speed_unit(named: Named, values: Array, parameters: Parameters) -> _Unit:
    size = np.abs(values)
    level = float(np.median(size[size > 0.3 * float(size.max())]))
    called = f"called {named.group.pattern}, {level:.4g} in flight"
    if _is_electric(named):
        factor = 100.0 if named.known == "Betaflight" else 1.0
        poles = float(parameters.get("motor_poles", 0) or 0)
        if poles:
            reason = f"{called}: electrical speed, divided by motor_poles {poles:.0f} / 2 of the header"
            return _Unit("rpm", factor / (poles / 2), 0.0, reason, "named")
        rival = Rival(f"scale: {factor / 6:.6g}", "six pole pairs; the log does not say how many the motors have")
        reason = f"{called}: electrical speed, divided by 7 pole pairs, a usual number"
        return _Unit("rpm", factor / _USUAL_POLE_PAIRS, 0.0, reason, "guess", (rival,))
    if named.unit is not None:
        return _Unit(named.unit, named.scale, 0.0, f"{called}: {named.unit} by its name", "named")
    if level > _RPM_FROM:
        return _Unit("rpm", 1.0, 0.0, f"{called}: faster than any rotor in rad/s", "data")
    rival = Rival("unit: rpm", f"a level of {level:.4g} fits both")
    return _Unit("rad/s", 1.0, 0.0, called, "guess", (rival,))


def _command_unit(named: Named, values: Array, parameters: Parameters) -> _Unit | None:
    """Tell the unit of commands: parameters and the name first, then the first of `RANGES` that holds the numbers."""
    low, high = float(values.min()), float(np.quantile(values, 0.999))
    called = f"called {named.group.pattern}, up to {high:.4g}"
    stated = _stated_range(named, parameters)
    if stated is not None:
        begin, end, where = stated
        reason = f"{called}: {begin:g} to {end:g} by {where}"
        return _Unit("1", 1 / (end - begin), -begin / (end - begin), reason, "named")
    if named.known == "Crazyflie":
        return _Unit("1", named.scale, 0.0, f"{called}: 16 bits, as on a Crazyflie", "named")
    words = {*named.group.words}
    if named.unit in SPEED_UNITS or words & {"om", "omega", "omcmd", "rpm", "rads", "speed", "rad"}:
        unit = named.unit or ("rpm" if high > _RPM_FROM else "rad/s")
        rivals = () if named.unit or unit == "rpm" else (Rival("unit: rpm", "its size fits both"),)
        reason = f"{called}: a commanded speed"
        return _Unit(unit, named.scale, 0.0, reason, "guess" if rivals else "named", rivals)
    if named.unit == "1" and named.scale != 1.0:
        return _Unit("1", named.scale, 0.0, f"{called}: per cent by its name", "named")
    for own in RANGES:
        if low >= own.low and own.high_from < high <= own.high:
            told = own.tells == "always" or (own.tells == "of commands" and bool(words & ASKED))
            others = [Rival(*rival) for rival in own.rivals]
            if not (told or named.unit == "us" or "pwm" in words):
                others += [Rival(f"unit: {unit}", f"if it is a speed, up to {high:.4g}") for unit in ("rad/s", "rpm")]
            reason = f"{called}: {own.words}"
            return _Unit("1", own.scale, own.offset, reason, "data" if told else "guess", tuple(others))
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


def _meaning(command: RotorGuess, parameters: Parameters, system: str) -> KeyChoice:
    """Tell whether a command is a share of thrust or of speed."""

    def choose(value: str, reason: str, *rivals: Rival, sure: Sure = "named") -> KeyChoice:
        return KeyChoice("rotor_command_is", value, reason, sure, rivals)

    if command.kind == "Crazyflie":
        if "motor.m" in command.columns.columns[0]:
            older = Rival("rotor_command_is: speed", "before 2022 the firmware logged what the motors got")
            return choose("thrust", "motor.m* of a Crazyflie are thrusts, before it compensates for the battery", older)
        return choose("speed", "pwm.* of a Crazyflie is what the motors get")
    factor = parameters.get("THR_MDL_FAC")
    if factor is not None:
        value = float(factor)
        if value >= 0.9:
            return choose("thrust", f"THR_MDL_FAC is {value:g}: the autopilot treats commands as shares of thrust")
        if value <= 0.1:
            return choose("speed", f"THR_MDL_FAC is {value:g}: the autopilot passes commands on as they are")
        rival = Rival("rotor_command_is: thrust", f"THR_MDL_FAC is {value:g}, which lies between the two")
        return choose("speed", f"THR_MDL_FAC is {value:g}, between speed (0) and thrust (1)", rival, sure="guess")
    if "MOT_THST_EXPO" in parameters or system.startswith("Ardu"):
        return choose("speed", "RCOU is what the motors get, after the autopilot's own thrust curve")
    rival = Rival("rotor_command_is: thrust", "the log does not say which")
    reason = f"as with most motor controllers{f' ({system})' if system else ''}"
    return choose("speed", reason, rival, sure="guess")
