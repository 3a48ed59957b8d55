"""Settings of the section `import`: how the columns of a log map to signals, and how these become a flight."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Annotated, Final, Literal

from annotated_types import Ge, Gt, Le, MinLen
from typing_extensions import Doc

from cpfls_cli.errors import SettingError
from cpfls_cli.settings import Settings
from cpfls_cli.units import KNOWN_UNITS, UnitName

SignalName = Literal[
    "attitude",
    "quaternion",
    "body_rate",
    "attitude_rate",
    "position",
    "velocity",
    "acceleration",
    "torque",
    "body_torque",
    "thrust",
    "rotor_speed",
    "rotor_command",
    "voltage",
    "setpoint_position",
    "setpoint_velocity",
    "setpoint_attitude",
    "setpoint_body_rate",
    "setpoint_thrust",
    "sticks",
]
_UNITS: Final = """
    attitude: rad           quaternion: 1             body_rate: rad/s            attitude_rate: rad/s
    position: m             velocity: m/s             acceleration: m/s^2         voltage: V or 1
    torque: N m             body_torque: N m          thrust: N                   setpoint_thrust: N or 1
    rotor_speed: rad/s      rotor_command: 1 or s or rad/s                        sticks: 1
    setpoint_position: m    setpoint_velocity: m/s    setpoint_body_rate: rad/s   setpoint_attitude: rad or 1
"""
UNITS_OF_SIGNAL: Final = MappingProxyType(
    {name: tuple(units.strip().split(" or ")) for name, units in re.findall(r"(\w+): (.+?)(?=  |\n)", _UNITS)}
)
SETPOINTS: Final[Mapping[SignalName, SignalName]] = MappingProxyType(
    {
        "setpoint_position": "position",
        "setpoint_velocity": "velocity",
        "setpoint_attitude": "attitude",
        "setpoint_body_rate": "body_rate",
        "setpoint_thrust": "thrust",
        "sticks": "sticks",
    }
)
"""Signals that say what was asked of the autopilot and of its loops, and the name of each among the setpoints."""
ROTORS: Final[tuple[SignalName, ...]] = ("rotor_speed", "rotor_command")  # Signals with a column for each rotor.
# Signals that are smooth in time.
MOTION: Final = ("position", "velocity", "attitude", "quaternion", "body_rate")
# Signals that keep their value until the next one.
COMMANDS: Final = ("torque", "body_torque", "thrust", "rotor_command")
_COLUMNS_OF_SIGNAL: Final[Mapping[str, int]] = MappingProxyType(
    {"quaternion": 4, "thrust": 1, "voltage": 1, "setpoint_thrust": 1}
)
_COLUMNS_OF_VECTOR = 3
_COLUMNS_OF_STICKS = (3, 4)  # Roll, pitch, yaw, and the throttle where it counts in the same way.


@dataclass(frozen=True, kw_only=True)
class ColumnMap(Settings):
    """Columns of a log and their unit: ``signal = mixer @ (sign * (scale * column + offset))`` in `unit`."""

    columns: Annotated[tuple[str, ...], MinLen(1), Doc("names of the columns, in the order of the axes")]
    unit: Annotated[UnitName, Doc("unit of the columns after scale and offset")]
    sign: Annotated[tuple[float, ...] | None, Doc("+1 or -1 for each column; null: all +1")] = None
    scale: Annotated[float, Doc("factor on the logged numbers")] = 1.0
    offset: Annotated[float, Doc("added after the factor, in the unit above")] = 0.0
    mixer: Annotated[
        tuple[tuple[float, ...], ...] | None,
        Doc("where the columns are not rotors but what is mixed for them: for each rotor a factor of each column"),
    ] = None

    def __post_init__(self) -> None:
        """Check the signs against the columns."""
        if len(set(self.columns)) < len(self.columns):
            raise SettingError("columns", "a column is named twice")
        if self.scale == 0:
            raise SettingError("scale", "must not be 0")
        if self.sign is not None and (len(self.sign) != len(self.columns) or {abs(s) for s in self.sign} != {1}):
            raise SettingError("sign", f"needs {len(self.columns)} numbers, one for each column, each +1 or -1")
        for row, factors in enumerate(self.mixer or ()):
            if len(factors) != len(self.columns):
                raise SettingError(f"mixer.{row}", f"needs {len(self.columns)} numbers, one for each column")

    @property
    def names(self) -> tuple[str, ...]:
        """What the numbers of a sample are called: columns, or rotors of a mixer."""
        return self.columns if self.mixer is None else tuple(f"M{1 + row}" for row in range(len(self.mixer)))


@dataclass(frozen=True, kw_only=True)
class SignalMap(ColumnMap):
    """One signal in the log: its columns, or those that stand in for them in other logs."""

    required: Annotated[bool, Doc("false: a log may lack these columns; the flight then lacks the signal")] = True
    otherwise: Annotated[
        tuple[ColumnMap, ...], Doc("other columns, tried in order where a log lacks one of these; units of one kind")
    ] = ()

    @property
    def choices(self) -> tuple[ColumnMap, ...]:
        """All maps in the order in which they are tried."""
        return (self, *self.otherwise)


def _check_signal(name: SignalName, signal: SignalMap) -> None:
    """Check the number of columns and the unit against the kind of signal."""
    given = len(signal.names)
    # An attitude that is asked for may be a quaternion, in unit 1.
    kind = "quaternion" if name == "setpoint_attitude" and signal.unit == "1" else name
    any_number = name in ROTORS or (name == "sticks" and given in _COLUMNS_OF_STICKS)
    expected = given if any_number else _COLUMNS_OF_SIGNAL.get(kind, _COLUMNS_OF_VECTOR)
    # A flight keeps one unit of a signal, whichever columns it came from.
    kinds = UNITS_OF_SIGNAL[name]
    for number, choice in enumerate(signal.choices):
        key = f"signals.{name}.otherwise.{number - 1}" if number else f"signals.{name}"
        if choice.mixer is not None and name not in ROTORS:
            raise SettingError(f"{key}.mixer", "mixes for rotors: it belongs to rotor_speed or rotor_command")
        if len(choice.names) != expected:
            words = f"{expected} columns" if expected > 1 else "1 column"
            raise SettingError(f"{key}.columns", f"needs {words}, got {len(choice.names)}")
        if KNOWN_UNITS[choice.unit].si not in kinds:
            wanted = [unit for unit, entry in KNOWN_UNITS.items() if entry.si in kinds]
            raise SettingError(f"{key}.unit", f"{choice.unit!r} is not a unit of it; use one of {', '.join(wanted)}")
        kinds = (KNOWN_UNITS[choice.unit].si,)


@dataclass(frozen=True, kw_only=True)
class ImportSettings(Settings):
    """Settings of the import of a flight log."""

    time_column: Annotated[
        str | None,
        Doc(
            "name of the column of time stamps, or row / 100 where 100 rows come in a second; null: those of the"
            " fastest mapped topic of a log of topics"
        ),
    ] = "t"
    time_unit: Annotated[Literal["s", "ms", "us", "ns"], Doc("unit of the time stamps")] = "s"
    signals: Annotated[
        Mapping[SignalName, SignalMap], Doc("for each signal of the log: its columns and their unit")
    ] = field(default_factory=dict)
    quaternion_order: Annotated[
        Literal["wxyz", "xyzw"], Doc("order of the columns of quaternion, and of setpoint_attitude where it is one")
    ] = "wxyz"
    body_frame: Annotated[Literal["FLU", "FRD"], Doc("body axes of the log; converted to FLU")] = "FLU"
    world_frame: Annotated[Literal["ENU", "NED"], Doc("world axes of the log; converted to ENU")] = "ENU"
    acceleration_frame: Annotated[
        Literal["world", "body-specific-force"],
        Doc("acceleration in the world, or what an accelerometer senses; the latter is kept as specific_force too"),
    ] = "world"
    rotor_command_is: Annotated[
        Literal["speed", "thrust"],
        Doc("what a rotor_command of unit 1 is a share of; of thrust, its root is kept, which is the share of speed"),
    ] = "speed"
    rotor_command_lag_s: Annotated[
        float, Ge(0), Doc("known time constant, s, with which the rotors follow rotor_command; what follows is kept")
    ] = 0.0
    torque_source: Annotated[
        Literal["column", "rotor-speed", "rotor-command"] | None,
        Doc(
            "column: torque or body_torque of the log; rotor-speed, rotor-command: of the vehicle's rotors, commands in"
            " 0..1 times vehicle.rotor_speed_max_rad_s, speeds as they are; null: no torque"
        ),
    ] = "column"
    crop_s: Annotated[
        tuple[float, float] | Literal["flown"] | None,
        Doc("begin and end that are kept, s from the first stamp; flown: the longest stretch that flies, of each log"),
    ] = None
    rate_hz: Annotated[
        Annotated[float, Gt(0)] | None, Doc("sampling rate of the flight, Hz; null: the log's median rate")
    ] = None
    lowpass_hz: Annotated[
        Annotated[float, Gt(0)] | None,
        Doc("cut-off (-6 dB) of the zero-phase low-pass filter of all signals, Hz; null: none"),
    ] = None
    lowpass_order: Annotated[int, Ge(1), Le(12), Doc("order of the Butterworth filter, run in both directions")] = 4
    gap_s: Annotated[float, Gt(0), Doc("longest gap that is interpolated, s")] = 0.1
    gap_rule: Annotated[
        Literal["stop", "longest-part"], Doc("at a longer gap: stop with a message, or keep the longest part")
    ] = "stop"
    spike_deviations: Annotated[
        Annotated[float, Gt(0)] | None,
        Doc(
            "departure from the running median, in robust standard deviations, from which a value is a spike and is"
            " interpolated; null: spikes beyond 10 are counted and warned of, and nothing is changed"
        ),
    ] = None
    spike_window_samples: Annotated[int, Ge(3), Le(101), Doc("window of the running median of the spike test")] = 7
    saturation_samples: Annotated[int, Ge(2), Doc("equal extreme values in a row that count as saturated")] = 20
    delay_s: Annotated[
        Annotated[float, Ge(0)] | Literal["estimate"], Doc("time from command to motion, s, or estimate")
    ] = 0.0
    delay_max_s: Annotated[float, Gt(0), Doc("longest delay that the estimate tries, s")] = 0.2

    def __post_init__(self) -> None:
        """Check the rules between keys."""
        if isinstance(self.crop_s, tuple) and not 0 <= self.crop_s[0] < self.crop_s[1]:
            raise SettingError("crop_s", "needs 0 <= begin < end")
        for name, signal in self.signals.items():
            _check_signal(name, signal)
        if self.signals and not self.signals.keys() - SETPOINTS.keys():
            raise SettingError("signals", "holds only setpoints; add measured signals, or rotor commands")
        if self.signals:
            _check_attitude(self)
            _check_torque(self)
            command = self.signals.get("rotor_command")
            if self.rotor_command_is == "thrust" and (command is None or command.unit != "1"):
                raise SettingError("rotor_command_is", "'thrust' needs the signal rotor_command in unit 1")

    @property
    def mapped_columns(self) -> tuple[str, ...]:
        """Columns of the log that may be used: the time stamps, then those of every signal."""
        named = () if self.time_column is None else (self.time_column,)
        choices = (choice for signal in self.signals.values() for choice in signal.choices)
        return (*named, *(column for choice in choices for column in choice.columns))


def _check_attitude(settings: ImportSettings) -> None:
    names = settings.signals.keys()
    for one, other in (("attitude", "quaternion"), ("body_rate", "attitude_rate"), ("torque", "body_torque")):
        if {one, other} <= names:
            raise SettingError("signals", f"{one} and {other} are both given; keep one")
    needing = [name for name in ("attitude_rate", "torque") if name in names]
    if needing and not {"attitude", "quaternion"} & names:
        raise SettingError("signals", f"{', '.join(needing)} needs attitude or quaternion to be converted")


def _check_torque(settings: ImportSettings) -> None:
    needed: dict[str | None, set[SignalName]] = {
        "column": {"torque", "body_torque"},
        "rotor-speed": {"rotor_speed"},
        "rotor-command": {"rotor_command"},
    }
    wanted = needed.get(settings.torque_source)
    if wanted is not None and not wanted & settings.signals.keys():
        missing = " or ".join(sorted(wanted))
        raise SettingError("torque_source", f"{settings.torque_source!r} needs the signal {missing}")
