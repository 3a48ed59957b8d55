"""What the names of a log's columns say: columns that belong together, what they may hold, in which unit."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final, Literal

from cpfls_cli.flightlog.settings import SignalName
from cpfls_cli.units import UnitName

Kind = Literal["xyz", "wxyz", "angles", "numbers", "one"]


@dataclass(frozen=True)
class ColumnGroup:
    """Columns whose names differ in an axis or a number alone.

    Attributes
    ----------
    pattern : str
        The name with ``*`` in place of the axis or the number.
    kind : {"xyz", "wxyz", "angles", "numbers", "one"}
        What tells the columns apart.
    columns : tuple of str
        In the order of axes or numbers, of a quaternion w, x, y, z.
    """

    pattern: str
    kind: Kind
    columns: tuple[str, ...]

    @property
    def topic(self) -> str:
        """What stands before the first dot; empty where the columns are of no topic."""
        return self.columns[0].partition(".")[0] if "." in self.columns[0] else ""

    @property
    def unit(self) -> str:
        """Unit at the end of the name, such as ``rad_s``; empty where there is none."""
        return next((ending for ending in _UNITS_BY_ENDING if self.pattern.endswith(f"_{ending}")), "")

    @property
    def words(self) -> tuple[str, ...]:
        """Words of the pattern in lower case, without numbers and without the unit at its end."""
        named = self.pattern.removesuffix(f"_{self.unit}") if self.unit else self.pattern
        return tuple(word for word in _words(named) if not word.isdecimal())


@dataclass(frozen=True)
class Named:
    """Columns that may be a signal, by their name.

    Attributes
    ----------
    rank : float
        Smaller ones come first.
    unit : UnitName or None
        That the name or the kind of log states.
    scale : float
        Factor on the logged numbers, which makes them this unit.
    frame : {"FLU", "FRD", "ENU", "NED"} or None
        Axes that the kind of log is known for.
    sign : tuple of float or None
        Of each column in that frame; None for +1 everywhere.
    known : str
        The kind of log whose documentation says so; empty where only words of the name do.
    """

    signal: SignalName
    group: ColumnGroup
    rank: float
    unit: UnitName | None = None
    scale: float = 1.0
    frame: str | None = None
    known: str = ""
    sign: tuple[float, ...] | None = None


BY_HAND: Final = "rename them as many logs do (gyro_x, roll, rpm_1), or write import.signals of a config by hand"
"""What to do where names do not tell what columns hold."""

_ANGLES: Final = (
    ("roll", "pitch", "yaw"),
    ("phi", "theta", "psi"),
    ("Roll", "Pitch", "Yaw"),
    ("R", "P", "Y"),
    ("p", "q", "r"),
)
_AXES: Final = (("x", "y", "z"), ("X", "Y", "Z"), ("N", "E", "D"))
_QUATERNIONS: Final = (("w", "x", "y", "z"), ("W", "X", "Y", "Z"))
_SHORTEST_NUMBERED, _LONGEST_NUMBERED = 3, 16
_UNITS_BY_ENDING: Final[Mapping[str, Mapping[SignalName, UnitName]]] = {
    "rad_s": {"body_rate": "rad/s", "rotor_speed": "rad/s", "rotor_command": "rad/s"},
    "deg_s": {"body_rate": "deg/s"},
    "m_s2": {"acceleration": "m/s^2"},
    "m_s": {"velocity": "m/s"},
    "m": {"position": "m"},
}
"""Units as keys of a config end in them, and the signals that have them."""


def column_groups(names: Mapping[str, object] | tuple[str, ...]) -> tuple[ColumnGroup, ...]:
    """Find columns whose names differ in an axis or a number alone, and leave every other one as its own group."""
    known = dict.fromkeys(names)
    # roll, pitch, yaw and p, q, r have one pattern, a star alone, and are two groups.
    found: dict[tuple[str, Kind, tuple[str, ...]], ColumnGroup] = {}
    for group in (*_of_axes(known), *_numbered(known)):
        found.setdefault((group.pattern, group.kind, group.columns), group)
    single = tuple(ColumnGroup(name, "one", (name,)) for name in known)
    return (*found.values(), *single)


def _of_axes(names: Mapping[str, None]) -> Iterator[ColumnGroup]:
    families: tuple[tuple[Kind, tuple[tuple[str, ...], ...]], ...] = (
        ("wxyz", _QUATERNIONS),
        ("xyz", _AXES),
        ("angles", _ANGLES),
    )
    for name in names:
        for kind, family in families:
            for axes in family:
                yield from _from_first(name, names, kind, axes)


def _from_first(name: str, names: Mapping[str, None], kind: Kind, axes: tuple[str, ...]) -> Iterator[ColumnGroup]:
    """Look for the columns of the other axes wherever the first one stands in a name."""
    for found in re.finditer(re.escape(axes[0]), name):
        before, after = name[: found.start()], name[found.end() :]
        # An axis ends a word; a single letter of the angles is a word of its own.
        ends = not after or not after[0].islower()
        alone = not before or not before[-1].isalpha()
        if not ends and kind != "angles":
            continue
        if kind == "angles" and len(axes[0]) == 1 and not (alone and ends):
            continue
        columns = tuple(f"{before}{axis}{after}" for axis in axes)
        if all(column in names for column in columns):
            yield ColumnGroup(f"{before}*{after}", kind, columns)


def _numbered(names: Mapping[str, None]) -> Iterator[ColumnGroup]:
    groups: dict[str, dict[int, str]] = {}
    for name in names:
        topic, dot, rest = name.partition(".")
        if dot and f"{topic}[1].{rest}" in names:
            # The first instance of a topic bears no number.
            groups.setdefault(f"{topic}[*].{rest}", {})[0] = name
        for found in re.finditer(r"\d+", name):
            groups.setdefault(f"{name[: found.start()]}*{name[found.end() :]}", {})[int(found.group())] = name
    for pattern, columns in groups.items():
        numbers = sorted(columns)
        unbroken = numbers == list(range(numbers[0], numbers[0] + len(numbers)))
        if unbroken and numbers[0] in (0, 1) and _SHORTEST_NUMBERED <= len(numbers) <= _LONGEST_NUMBERED:
            yield ColumnGroup(pattern, "numbers", tuple(columns[number] for number in numbers))


def _words(name: str) -> list[str]:
    parts = re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+", name.replace("*", " "))
    return [part.lower() for part in parts]


@dataclass(frozen=True)
class _Known:
    """Columns that a kind of log is known for, in the order in which they are preferred."""

    system: str
    signal: SignalName
    pattern: str
    unit: UnitName | None
    frame: str | None = None
    scale: float = 1.0
    sign: tuple[float, ...] | None = None


_PX4, _ARDUPILOT, _BETAFLIGHT, _CRAZYFLIE = "PX4", "ArduPilot", "Betaflight", "Crazyflie"
_KIN: Final = {_ARDUPILOT: ("Ardu",), _BETAFLIGHT: ("INAV", "Cleanflight", "EmuFlight")}
_KNOWN: Final = (
    _Known(_PX4, "quaternion", "vehicle_attitude.q[*]", "1", "FRD"),
    _Known(_PX4, "body_rate", "vehicle_angular_velocity.xyz[*]", "rad/s", "FRD"),
    _Known(_PX4, "body_rate", "sensor_combined.gyro_rad[*]", "rad/s", "FRD"),
    _Known(_PX4, "body_rate", "vehicle_attitude.*speed", "rad/s", "FRD"),
    _Known(_PX4, "acceleration", "sensor_combined.accelerometer_m_s2[*]", "m/s^2", "FRD"),
    _Known(_PX4, "acceleration", "vehicle_acceleration.xyz[*]", "m/s^2", "FRD"),
    _Known(_PX4, "position", "vehicle_local_position.*", "m", "NED"),
    _Known(_PX4, "velocity", "vehicle_local_position.v*", "m/s", "NED"),
    _Known(_PX4, "rotor_speed", "esc_status.esc[*].esc_rpm", "rpm"),
    _Known(_PX4, "rotor_command", "actuator_motors.control[*]", "1"),
    _Known(_PX4, "rotor_command", "actuator_outputs.output[*]", None),
    _Known(_PX4, "voltage", "battery_status.voltage_v", "V"),
    _Known(_ARDUPILOT, "attitude", "ATT.*", "deg", "FRD"),
    _Known(_ARDUPILOT, "body_rate", "IMU.Gyr*", "rad/s", "FRD"),
    _Known(_ARDUPILOT, "body_rate", "RATE.*", "deg/s", "FRD"),
    _Known(_ARDUPILOT, "acceleration", "IMU.Acc*", "m/s^2", "FRD"),
    _Known(_ARDUPILOT, "position", "XKF1.P*", "m", "NED"),
    _Known(_ARDUPILOT, "position", "NKF1.P*", "m", "NED"),
    _Known(_ARDUPILOT, "velocity", "XKF1.V*", "m/s", "NED"),
    _Known(_ARDUPILOT, "velocity", "NKF1.V*", "m/s", "NED"),
    _Known(_ARDUPILOT, "rotor_command", "RCOU.C*", None),
    _Known(_ARDUPILOT, "rotor_speed", "ESC[*].RPM", "rpm"),
    _Known(_ARDUPILOT, "voltage", "BAT.Volt", "V"),
    _Known(_BETAFLIGHT, "body_rate", "gyroADC[*]", "deg/s", "FLU"),
    _Known(_BETAFLIGHT, "acceleration", "accSmooth[*]", None, "FLU"),
    _Known(_BETAFLIGHT, "rotor_command", "motor[*]", None),
    _Known(_BETAFLIGHT, "rotor_speed", "rpm[*]", "rpm"),
    _Known(_BETAFLIGHT, "rotor_speed", "eRPM[*]", None),
    _Known(_BETAFLIGHT, "voltage", "vbatLatest", "V"),
    _Known(_CRAZYFLIE, "quaternion", "stateEstimate.q*", "1", "FLU"),
    _Known(_CRAZYFLIE, "attitude", "stabilizer.*", "deg", "FLU"),
    _Known(_CRAZYFLIE, "attitude", "stateEstimate.*", "deg", "FLU"),
    _Known(_CRAZYFLIE, "body_rate", "gyro.*", "deg/s", "FLU"),
    # The controller takes a pitch for positive with the nose up: r_pitch = -gyro.y in the firmware.
    _Known(_CRAZYFLIE, "body_rate", "controller.r_*", None, "FLU", sign=(1.0, -1.0, 1.0)),
    _Known(_CRAZYFLIE, "acceleration", "acc.*", "g", "FLU"),
    _Known(_CRAZYFLIE, "acceleration", "stateEstimate.a*", "g", "ENU"),
    _Known(_CRAZYFLIE, "position", "stateEstimate.*", "m", "ENU"),
    _Known(_CRAZYFLIE, "velocity", "stateEstimate.v*", "m/s", "ENU"),
    # The compressed state counts in thousandths.
    _Known(_CRAZYFLIE, "position", "stateEstimateZ.*", "mm", "ENU"),
    _Known(_CRAZYFLIE, "velocity", "stateEstimateZ.v*", "mm/s", "ENU"),
    _Known(_CRAZYFLIE, "rotor_speed", "rpm.m*", "rpm"),
    # The pwm columns are these after the firmware's compensation of the battery.
    _Known(_CRAZYFLIE, "rotor_command", "motor.m*", "1", scale=1 / 65536),
    _Known(_CRAZYFLIE, "rotor_command", "pwm.m*_pwm", "1", scale=1 / 65536),
    _Known(_CRAZYFLIE, "voltage", "pm.vbat", "V"),
    _Known(_CRAZYFLIE, "voltage", "pm.vbatMV", "V", scale=1e-3),
)
_SUFFICIENT_COLUMNS: Final = {"quaternion": {4}, "thrust": {1}, "voltage": {1}}
_ROTOR_SIGNALS = ("rotor_speed", "rotor_command")
_FEWEST_ROTORS = 3
_AXES_OF_A_BODY = 3
_BY_WORDS = 100.0
_OF_OTHER_INSTANCE = 50.0
_WORDS: Final = {
    "position": {
        "pos",
        "position",
        "p",
        "translation",
        "point",
        "poses",
        "pose",
        "mocap",
        "local",
        "state",
        "estimate",
        "v",
    },
    "velocity": {"vel", "velocity", "v", "linear", "twist"},
    "acceleration": {"acc", "accel", "accelerometer", "acceleration", "a", "sf", "f", "imu"},
    "body_rate": {"gyro", "gyr", "gyroscope", "gyros", "omega", "om", "w", "rate", "rates", "angular", "angvel", "pqr"},
    "body_torque": {"torque", "tau", "moment"},
    "attitude": {"rpy", "euler", "attitude", "att", "angle", "angles", "ypr"},
    "quaternion": {"q", "quat", "quaternion", "orientation", "att", "attitude", "pose"},
    "rotor_speed": {"rpm", "erpm", "rads", "rotor", "om", "omega", "speed", "w"},
    "rotor_command": {"motor", "m", "cmd", "command", "pwm", "u", "control", "output", "throttle", "omcmd", "esc"},
    "thrust": {"thrust", "lift"},
    "voltage": {"voltage", "vbat", "volt", "vbatt", "battery", "batt"},
}
_FAST: Final = frozenset({"rpm", "erpm", "rads", "rotor", "om", "omega", "speed", "speeds", "velocities", "angular"})
_ASKED: Final = frozenset(
    {"cmd", "command", "commands", "pwm", "u", "control", "output", "throttle", "omcmd", "ref", "des", "d", "r"}
)
_NOT_MEASURED: Final = frozenset(
    [
        "des",
        "desired",
        "d",
        "sp",
        "setpoint",
        "ref",
        "reference",
        "target",
        "goal",
        "r",
        "cmd",
        "command",
        "ctrltarget",
        "controller",
        "cov",
        "covariance",
        "var",
        "variance",
        "bias",
        "noise",
        "std",
        "err",
        "error",
        "integral",
        "reset",
        "delta",
        "innov",
        "innovation",
        "offset",
        "mag",
        "magnetometer",
        "rc",
        "gps",
        "status",
        "temperature",
        "current",
        "thrust",
        "thrusts",
        "jerk",
        "snap",
        "stamp",
        "timestamp",
        "counter",
        "padding",
        "derivative",
        "test",
        "ratio",
        "ratios",
        "clip",
    ]
)
_SECOND_HAND: Final = frozenset(
    {"raw", "groundtruth", "mocap", "poses", "estimator", "filtered", "filt", "unfilt", "backup"}
)
_ALLOWED_OF_ROTORS: Final = frozenset({"cmd", "command", "status", "r", "ref", "des", "d"})


def named_signals(groups: tuple[ColumnGroup, ...], system: str = "") -> tuple[Named, ...]:
    """List what groups of columns may be by their names, what a kind of log is known for first.

    Parameters
    ----------
    system : str
        Kind of log, as its reader names it; empty where any may be meant.
    """
    found = [named for group in groups for named in (*_known(group, system), *_by_words(group))]
    if any(_is_of(system, known) for known in (_PX4, _ARDUPILOT, _BETAFLIGHT)):
        # Of these logs all that drives rotors is in the list; words would find parameters and allocations.
        found = [named for named in found if named.known or named.signal not in (*_ROTOR_SIGNALS, "voltage")]
    best: dict[tuple[SignalName, tuple[str, ...]], Named] = {}
    for named in sorted(found, key=lambda named: named.rank):
        best.setdefault((named.signal, named.group.columns), named)
    return tuple(best.values())


def _is_of(system: str, known: str) -> bool:
    """Tell whether a log was written by a program or its kin."""
    return system.startswith((known, *_KIN.get(known, ())))


def _known(group: ColumnGroup, system: str) -> Iterator[Named]:
    for rank, known in enumerate(_KNOWN):
        of_other = system and not _is_of(system, known.system)
        angles = known.signal != "attitude" or group.kind == "angles"
        # On its card a Crazyflie puts the name of an event before that of a variable.
        patterns = (group.pattern, group.pattern.partition(".")[2] if system.startswith(_CRAZYFLIE) else "")
        if not of_other and angles and known.pattern in patterns and _suits(known.signal, group):
            yield Named(
                known.signal, group, float(rank), known.unit, known.scale, known.frame, known.system, known.sign
            )


def _suits(signal: SignalName, group: ColumnGroup) -> bool:
    if signal in _ROTOR_SIGNALS:
        return group.kind == "numbers" and len(group.columns) >= _FEWEST_ROTORS
    if signal == "quaternion":
        return group.kind == "wxyz" or (group.kind == "numbers" and len(group.columns) == 4)
    if signal in ("voltage", "thrust"):
        return group.kind == "one"
    if signal in ("position", "velocity", "acceleration"):
        return group.kind in ("xyz", "numbers") and len(group.columns) == 3
    return group.kind in ("xyz", "angles", "numbers") and len(group.columns) == 3


def _by_words(group: ColumnGroup) -> Iterator[Named]:
    """List what the words of a name suggest; words that speak of no measurement rule it out."""
    words = list(group.words)
    rank = _BY_WORDS + len(words) + 10 * sum(word in _SECOND_HAND for word in words)
    rank += _OF_OTHER_INSTANCE * bool(re.search(r"\[\d+\]\.", group.pattern))
    for signal, meant in _WORDS.items():
        name: SignalName = signal  # type: ignore[assignment]
        if re.search(r"[a-z]2($|_)", group.pattern.replace("*", "")) and signal in _ROTOR_SIGNALS:
            # A square.
            continue
        allowed = frozenset({"thrust"}) if signal == "thrust" else frozenset()
        excluded = _NOT_MEASURED - allowed - (_ALLOWED_OF_ROTORS if signal in _ROTOR_SIGNALS else frozenset())
        ending = _UNITS_BY_ENDING.get(group.unit)
        if not _suits(name, group) or excluded & set(words) or (ending is not None and name not in ending):
            continue
        if _means(name, group, words, meant):
            yield Named(name, group, rank, _unit(name, words) if ending is None else ending[name])


def _means(signal: SignalName, group: ColumnGroup, words: list[str], meant: set[str]) -> bool:
    if signal == "position":
        return _means_position(group, words, meant)
    if signal == "attitude" and group.kind == "angles":
        return not set(words) & (_WORDS["body_rate"] | _WORDS["body_torque"] | {"speed"})
    if signal == "body_rate" and group.kind == "angles":
        return bool(set(words) & (meant | {"speed"})) or _axes_of(group) == ("p", "q", "r")
    if signal in _ROTOR_SIGNALS:
        return _means_rotors(signal, group, words)
    if signal == "quaternion" and group.kind == "numbers":
        return words[-1:] in (["q"], ["quat"], ["quaternion"], ["orientation"])
    if signal == "acceleration":
        return words[-1:] != [] and bool(set(words[-2:]) & meant - {"imu"}) and not set(words) & {"angular"}
    if signal == "velocity":
        return bool(set(words[-2:]) & meant) and not set(words) & {"angular", "acc", "acceleration", "a"}
    return bool(set(words) & meant)


def _axes_of(group: ColumnGroup) -> tuple[str, ...]:
    return tuple(column.removesuffix(f"_{group.unit}") for column in group.columns)


def _means_position(group: ColumnGroup, words: list[str], meant: set[str]) -> bool:
    """Tell a position by its name, or by axes that stand alone beside words of nothing else."""
    others = set().union(*(_WORDS[name] for name in _WORDS if name != "position")) - meant
    alone = re.search(r"(^|[^A-Za-z])\*($|[^A-Za-z])", group.pattern) is not None
    return group.kind == "xyz" and alone and not set(words) & (others | {"home", "global"})


def _means_rotors(signal: SignalName, group: ColumnGroup, words: list[str]) -> bool:
    """Tell speeds from commands: what is asked for is none that was measured, and a motor alone is driven."""
    if {"squared", "sq"} & set(words):
        return False
    asked = bool(set(words) & _ASKED)
    # Three of the letter w are the axes of a gyroscope.
    fast = bool(set(words) & _FAST) or (words == ["w"] and len(group.columns) > _AXES_OF_A_BODY)
    if signal == "rotor_speed":
        return fast and not asked
    motors = words == ["m"] or bool({"motor", "motors"} & set(words))
    return asked or (motors and not fast)


_UNITS_BY_WORD: Final = {
    "deg": {"attitude": "deg", "body_rate": "deg/s"},
    "degs": {"attitude": "deg", "body_rate": "deg/s"},
    "dps": {"body_rate": "deg/s"},
    "rad": {"attitude": "rad", "body_rate": "rad/s", "rotor_speed": "rad/s", "rotor_command": "rad/s"},
    "rads": {"body_rate": "rad/s", "rotor_speed": "rad/s", "rotor_command": "rad/s"},
    "rpm": {"rotor_speed": "rpm", "rotor_command": "rpm"},
    "mm": {"position": "mm", "velocity": "mm/s"},
    "g": {"acceleration": "g"},
    # An angular frequency by its letter.
    "w": {"body_rate": "rad/s"},
    "om": {"rotor_speed": "rad/s", "body_rate": "rad/s", "rotor_command": "rad/s"},
    "omcmd": {"rotor_command": "rad/s"},
    "omega": {"rotor_speed": "rad/s", "body_rate": "rad/s", "rotor_command": "rad/s"},
}


def _unit(signal: SignalName, words: list[str]) -> UnitName | None:
    for word in words:
        unit = _UNITS_BY_WORD.get(word, {}).get(signal)
        if unit is not None:
            return unit  # type: ignore[return-value]
    return "1" if signal == "quaternion" else None
