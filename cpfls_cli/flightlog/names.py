"""What the names of a log's columns say: columns that belong together, what they may hold, in which unit.

Three tables say it: `KNOWN`, what kinds of logs call their columns; `MEANINGS`, the words for each signal; and
`SPELLINGS`, the ways to write a unit into a name. A new log usually takes one row more.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import tau
from typing import Final, Literal, NamedTuple

from cpfls_cli.flightlog.settings import UNITS_OF_SIGNAL, SignalName
from cpfls_cli.units import KNOWN_UNITS, UnitName

Kind = Literal["xyz", "wxyz", "angles", "numbers", "one"]


def _each(words: str) -> frozenset[str]:
    return frozenset(words.split())


class Spelling(NamedTuple):
    """A unit, the factor that makes it of what is written, and how names write it."""

    unit: UnitName
    scale: float
    written: str


SPELLINGS: Final = (
    # "_" and "per" are read as "/", and words in full as their symbols.
    Spelling("rad/s", 1.0, "rad/s rads radps rads-1"),
    Spelling("rad/s", 1e-3, "mrad/s mrads mradps"),
    Spelling("deg/s", 1.0, "deg/s degs degps dps degs-1"),
    Spelling("deg/s", 1e-3, "mdeg/s mdps"),
    Spelling("rpm", 1.0, "rpm"),
    Spelling("rpm", 1e3, "krpm"),
    Spelling("rad/s", tau, "hz rps rev/s"),
    Spelling("rad", 1.0, "rad"),
    Spelling("rad", 1e-3, "mrad"),
    Spelling("deg", 1.0, "deg"),
    Spelling("deg", 1e-2, "cdeg centideg"),
    Spelling("m/s^2", 1.0, "m/s2 m/s/s mps2 ms2 ms-2"),
    Spelling("g", 1.0, "g"),
    Spelling("g", 1e-3, "mg"),
    Spelling("m/s", 1.0, "m/s mps ms-1"),
    Spelling("mm/s", 1.0, "mm/s mmps"),
    Spelling("m/s", 1e-2, "cm/s cmps"),
    Spelling("m/s", 1 / 3.6, "km/h kmh kph"),
    Spelling("m", 1.0, "m"),
    Spelling("mm", 1.0, "mm"),
    Spelling("m", 1e-2, "cm"),
    Spelling("m", 0.3048, "ft feet"),
    Spelling("N m", 1.0, "nm n/m"),
    Spelling("N mm", 1.0, "nmm n/mm"),
    Spelling("N", 1.0, "n"),
    Spelling("V", 1.0, "v"),
    Spelling("V", 1e-3, "mv"),
    Spelling("1", 1e-2, "pct percent %"),
    Spelling("us", 1.0, "us usec"),
)
_WRITTEN: Final = {text: own for own in SPELLINGS for text in own.written.split()}
_IN_FULL: Final = {"radians?": "rad", "degrees?": "deg", "met(er|re)s?": "m", "sec(onds?)?": "s", "volts?": "v"}
_A_WORD: Final = _each("rad rads deg degs dps rpm mm g radps degps mps rads-1")
"""Spellings that state a unit wherever they stand as a word of a name."""

_IN_RADIANS: Final[Mapping[str, tuple[SignalName, ...]]] = {
    # An angular frequency by its letter.
    "w": ("body_rate",),
    "om": ("body_rate", "rotor_speed", "rotor_command"),
    "omega": ("body_rate", "rotor_speed", "rotor_command"),
    "omcmd": ("rotor_command",),
}


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
    def ending(self) -> str:
        """The unit at the end of the name or in brackets, as it is written; empty where there is none."""
        before, star, after = self.pattern.partition("*")
        bracket = re.search(r"[\[(]([^\[\]()*]*[A-Za-z%][^\[\]()*]*)[\])]$", after if star else before)
        if bracket:
            return bracket[0] if _symbols(bracket[1]) in _WRITTEN else ""
        name = after if any(letter.isalnum() for letter in after) else before.rstrip("[(")
        # The axis stands before what follows the star, and a letter that stands before the star may be a name.
        starts = [found.start() for found in re.finditer(r"[_ ]|(?<=[a-z])(?=[A-Z])|^", name)]
        for start in starts if name is after else starts[1:]:
            text = name[start:].strip("_ ")
            if _symbols(text) in _WRITTEN and (name is after or len(text) > 1):
                return name[start:]
        return ""

    @property
    def words(self) -> tuple[str, ...]:
        """Words of the pattern in lower case, without numbers and without the unit at its end."""
        before, _, after = self.pattern.rpartition(self.ending) if self.ending else (self.pattern, "", "")
        parts = re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+", f"{before} {after}".replace("*", " "))
        return tuple(part.lower() for part in parts if not part.isdecimal())


def _symbols(text: str) -> str:
    """Write a unit as `SPELLINGS` do, such as rad/s for rad_per_sec."""
    text = re.sub(r"([a-z]{2})([A-Z])", r"\1_\2", text.strip("[]()_ ")).lower().replace("²", "2")
    parts = re.split(r"[/_ .·^]+|(?<=[a-z])per(?=[a-z])", text)
    for full, symbol in _IN_FULL.items():
        parts = [symbol if re.fullmatch(full, part) else part for part in parts]
    joined = "/".join(part for part in parts if part not in ("", "per"))
    return joined.replace("s/2", "s2").replace("s/-", "s-")


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

_FAMILIES: Final[tuple[tuple[Kind, tuple[str, ...]], ...]] = (
    ("wxyz", ("w", "x", "y", "z")),
    ("wxyz", ("W", "X", "Y", "Z")),
    ("xyz", ("x", "y", "z")),
    ("xyz", ("X", "Y", "Z")),
    ("xyz", ("N", "E", "D")),
    ("angles", ("roll", "pitch", "yaw")),
    ("angles", ("phi", "theta", "psi")),
    ("angles", ("Roll", "Pitch", "Yaw")),
    ("angles", ("R", "P", "Y")),
    ("angles", ("p", "q", "r")),
)
_SHORTEST_NUMBERED, _LONGEST_NUMBERED = 3, 16


def column_groups(names: Mapping[str, object] | tuple[str, ...]) -> tuple[ColumnGroup, ...]:
    """Find columns whose names differ in an axis or a number alone, and leave every other one as its own group."""
    known = dict.fromkeys(names)
    # roll, pitch, yaw and p, q, r have one pattern, a star alone, and are two groups.
    found: dict[tuple[str, Kind, tuple[str, ...]], ColumnGroup] = {}
    of_axes = (group for name in known for kind, axes in _FAMILIES for group in _from_first(name, known, kind, axes))
    for group in (*of_axes, *_numbered(known)):
        found.setdefault((group.pattern, group.kind, group.columns), group)
    single = tuple(ColumnGroup(name, "one", (name,)) for name in known)
    return (*found.values(), *single)


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


class Known(NamedTuple):
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
KNOWN: Final = (
    Known(_PX4, "quaternion", "vehicle_attitude.q[*]", "1", "FRD"),
    Known(_PX4, "body_rate", "vehicle_angular_velocity.xyz[*]", "rad/s", "FRD"),
    Known(_PX4, "body_rate", "sensor_combined.gyro_rad[*]", "rad/s", "FRD"),
    Known(_PX4, "body_rate", "vehicle_attitude.*speed", "rad/s", "FRD"),
    Known(_PX4, "acceleration", "sensor_combined.accelerometer_m_s2[*]", "m/s^2", "FRD"),
    Known(_PX4, "acceleration", "vehicle_acceleration.xyz[*]", "m/s^2", "FRD"),
    Known(_PX4, "position", "vehicle_local_position.*", "m", "NED"),
    Known(_PX4, "velocity", "vehicle_local_position.v*", "m/s", "NED"),
    Known(_PX4, "rotor_speed", "esc_status.esc[*].esc_rpm", "rpm"),
    Known(_PX4, "rotor_command", "actuator_motors.control[*]", "1"),
    Known(_PX4, "rotor_command", "actuator_outputs.output[*]", None),
    Known(_PX4, "voltage", "battery_status.voltage_v", "V"),
    Known(_ARDUPILOT, "attitude", "ATT.*", "deg", "FRD"),
    Known(_ARDUPILOT, "body_rate", "IMU.Gyr*", "rad/s", "FRD"),
    Known(_ARDUPILOT, "body_rate", "RATE.*", "deg/s", "FRD"),
    Known(_ARDUPILOT, "acceleration", "IMU.Acc*", "m/s^2", "FRD"),
    Known(_ARDUPILOT, "position", "XKF1.P*", "m", "NED"),
    Known(_ARDUPILOT, "position", "NKF1.P*", "m", "NED"),
    Known(_ARDUPILOT, "velocity", "XKF1.V*", "m/s", "NED"),
    Known(_ARDUPILOT, "velocity", "NKF1.V*", "m/s", "NED"),
    Known(_ARDUPILOT, "rotor_command", "RCOU.C*", None),
    Known(_ARDUPILOT, "rotor_speed", "ESC[*].RPM", "rpm"),
    Known(_ARDUPILOT, "voltage", "BAT.Volt", "V"),
    Known(_BETAFLIGHT, "body_rate", "gyroADC[*]", "deg/s", "FLU"),
    Known(_BETAFLIGHT, "acceleration", "accSmooth[*]", None, "FLU"),
    Known(_BETAFLIGHT, "rotor_command", "motor[*]", None),
    Known(_BETAFLIGHT, "rotor_speed", "rpm[*]", "rpm"),
    Known(_BETAFLIGHT, "rotor_speed", "eRPM[*]", None),
    Known(_BETAFLIGHT, "voltage", "vbatLatest", "V"),
    Known(_CRAZYFLIE, "quaternion", "stateEstimate.q*", "1", "FLU"),
    Known(_CRAZYFLIE, "attitude", "stabilizer.*", "deg", "FLU"),
    Known(_CRAZYFLIE, "attitude", "stateEstimate.*", "deg", "FLU"),
    Known(_CRAZYFLIE, "body_rate", "gyro.*", "deg/s", "FLU"),
    # The controller takes a pitch for positive with the nose up: r_pitch = -gyro.y in the firmware.
    Known(_CRAZYFLIE, "body_rate", "controller.r_*", None, "FLU", sign=(1.0, -1.0, 1.0)),
    Known(_CRAZYFLIE, "acceleration", "acc.*", "g", "FLU"),
    Known(_CRAZYFLIE, "acceleration", "stateEstimate.a*", "g", "ENU"),
    Known(_CRAZYFLIE, "position", "stateEstimate.*", "m", "ENU"),
    Known(_CRAZYFLIE, "velocity", "stateEstimate.v*", "m/s", "ENU"),
    # The compressed state counts in thousandths.
    Known(_CRAZYFLIE, "position", "stateEstimateZ.*", "mm", "ENU"),
    Known(_CRAZYFLIE, "velocity", "stateEstimateZ.v*", "mm/s", "ENU"),
    Known(_CRAZYFLIE, "rotor_speed", "rpm.m*", "rpm"),
    # The pwm columns are these after the firmware's compensation of the battery.
    Known(_CRAZYFLIE, "rotor_command", "motor.m*", "1", scale=1 / 65536),
    Known(_CRAZYFLIE, "rotor_command", "pwm.m*_pwm", "1", scale=1 / 65536),
    Known(_CRAZYFLIE, "voltage", "pm.vbat", "V"),
    Known(_CRAZYFLIE, "voltage", "pm.vbatMV", "V", scale=1e-3),
)


class Meaning(NamedTuple):
    """What words of a name mean a signal.

    Attributes
    ----------
    words : str
        One of them has to stand in the name.
    kinds, number : str, int
        How its columns are told apart, and how many there are; of rotors at least.
    last : int
        Only so many words at the end of the name count; 0: all of them.
    never : str
        Words that rule it out, beside those of `NOT_MEASURED`.
    """

    signal: SignalName
    words: str
    kinds: str
    number: int
    last: int = 0
    never: str = ""


_RATE_WORDS: Final = "gyro gyr gyroscope gyros omega om w rate rates angular angvel pqr"
MEANINGS: Final = (
    Meaning(
        "position",
        "pos position p translation point poses pose mocap local state estimate v",
        "xyz",
        3,
        never="vel velocity linear twist acc accel accelerometer acceleration a sf f imu torque tau moment rpy euler"
        " attitude att angle angles ypr q quat quaternion orientation rpm erpm rads rotor speed motor m cmd command"
        " pwm u control output throttle omcmd esc thrust lift voltage vbat volt vbatt battery batt home global"
        f" {_RATE_WORDS}",
    ),
    Meaning("velocity", "vel velocity v linear twist", "xyz numbers", 3, 2, "angular acc acceleration a"),
    Meaning("acceleration", "acc accel accelerometer acceleration a sf f", "xyz numbers", 3, 2, "angular"),
    Meaning("body_rate", _RATE_WORDS, "xyz angles numbers", 3),
    Meaning("body_torque", "torque tau moment", "xyz angles numbers", 3),
    Meaning("attitude", "rpy euler attitude att angle angles ypr", "xyz angles numbers", 3),
    Meaning("quaternion", "q quat quaternion orientation att attitude pose", "wxyz", 4),
    Meaning("quaternion", "q quat quaternion orientation", "numbers", 4, 1),
    Meaning("rotor_speed", "", "numbers", 3),
    Meaning("rotor_command", "", "numbers", 3),
    Meaning("thrust", "thrust lift", "one", 1),
    Meaning("voltage", "voltage vbat volt vbatt battery batt", "one", 1),
)
_ROTOR_SIGNALS: Final = ("rotor_speed", "rotor_command")
_FAST: Final = _each("rpm erpm rads rotor om omega speed speeds velocities angular")
ASKED: Final = _each("cmd command commands pwm u control output throttle omcmd ref des d r")
NOT_MEASURED: Final = _each(
    "des desired d sp setpoint ref reference target goal r cmd command ctrltarget controller cov covariance var"
    " variance bias noise std err error integral reset delta innov innovation offset mag magnetometer rc gps status"
    " temperature current thrust thrusts jerk snap stamp timestamp counter padding derivative test ratio ratios clip"
)
"""Words of what is wished, estimated of a sensor or something else; a name with one of them is no measurement."""

_SECOND_HAND: Final = _each("raw groundtruth mocap poses estimator filtered filt unfilt backup")
_ALLOWED: Final = {
    "thrust": frozenset({"thrust"}),
    **dict.fromkeys(_ROTOR_SIGNALS, _each("cmd command status r ref des d")),
}
_BY_WORDS, _OF_OTHER_INSTANCE = 100.0, 50.0
_AXES_OF_A_BODY = 3


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
    for rank, known in enumerate(KNOWN):
        of_other = system and not _is_of(system, known.system)
        angles = known.signal != "attitude" or group.kind == "angles"
        # On its card a Crazyflie puts the name of an event before that of a variable.
        patterns = (group.pattern, group.pattern.partition(".")[2] if system.startswith(_CRAZYFLIE) else "")
        suits = any(own.signal == known.signal and _suits(own, group) for own in MEANINGS)
        if not of_other and angles and known.pattern in patterns and suits:
            yield Named(
                known.signal, group, float(rank), known.unit, known.scale, known.frame, known.system, known.sign
            )


def _suits(meaning: Meaning, group: ColumnGroup) -> bool:
    count = len(group.columns)
    enough = count >= meaning.number if meaning.signal in _ROTOR_SIGNALS else count == meaning.number
    return enough and group.kind in meaning.kinds.split()


def _by_words(group: ColumnGroup) -> Iterator[Named]:
    """List what the words of a name and a unit in it suggest; words that speak of no measurement rule it out."""
    words = group.words
    rank = _BY_WORDS + len(words) + 10 * sum(word in _SECOND_HAND for word in words)
    rank += _OF_OTHER_INSTANCE * bool(re.search(r"\[\d+\]\.", group.pattern))
    for meaning in MEANINGS:
        signal = meaning.signal
        squared = bool(re.search(r"[a-z]2($|_)", group.pattern.replace("*", ""))) or bool({"squared", "sq"} & {*words})
        if (squared and signal in _ROTOR_SIGNALS) or not _suits(meaning, group):
            continue
        stated = stated_unit(group, signal)
        of_other = group.ending and stated is None and (len(group.ending.strip("_ ")) > 1 or group.ending == "_m")
        if of_other or (NOT_MEASURED - _ALLOWED.get(signal, frozenset())) & {*words}:
            continue
        if _means(meaning, group, words):
            unit, scale = stated or _usual_unit(signal, words)
            yield Named(signal, group, rank, unit, scale)


def stated_unit(group: ColumnGroup, signal: SignalName) -> tuple[UnitName, float] | None:
    """Give the unit that a name states for a signal, at its end or as a word, and the factor that makes it."""
    words = (_symbols(word) for word in group.words if word in _A_WORD)
    for text in (_symbols(group.ending), *words):
        for own in (_WRITTEN.get(text), _WRITTEN.get(f"{text}/s")):
            # Of a rate "deg" is deg/s.
            if own is not None and KNOWN_UNITS[own.unit].si in UNITS_OF_SIGNAL[signal]:
                return own.unit, own.scale
    return None


def _usual_unit(signal: SignalName, words: tuple[str, ...]) -> tuple[UnitName | None, float]:
    if any(signal in _IN_RADIANS.get(word, ()) for word in words):
        return "rad/s", 1.0
    return ("1" if signal == "quaternion" else None), 1.0


def _means(meaning: Meaning, group: ColumnGroup, words: tuple[str, ...]) -> bool:
    """Tell whether words mean a signal; positions, rotors and angles have ways of their own."""
    own, signal = {*words}, meaning.signal
    # A name that ends in the unit of a rate or of a speed is one.
    ending = _WRITTEN.get(_symbols(group.ending))
    ends_in_speed = ending is not None and KNOWN_UNITS[ending.unit].si == "rad/s"
    if own & set(meaning.never.split()):
        return False
    if signal in _ROTOR_SIGNALS:
        # Three columns of the letter w, or in the unit of a rate, are the axes of a gyroscope.
        many = len(group.columns) > _AXES_OF_A_BODY
        fast = bool(own & _FAST) or (many and (words == ("w",) or ends_in_speed))
        motors = words == ("m",) or bool({"motor", "motors"} & own)
        return (fast and not own & ASKED) if signal == "rotor_speed" else bool(own & ASKED) or (motors and not fast)
    if signal == "position":
        return re.search(r"(^|[^A-Za-z])\*($|[^A-Za-z])", group.pattern) is not None
    if group.kind == "angles" and signal in ("attitude", "body_rate"):
        pqr = group.columns[0].removesuffix(group.ending) == "p"
        turns = pqr or ends_in_speed or bool(own & {*_RATE_WORDS.split(), "speed"})
        return turns if signal == "body_rate" else not turns and not own & {"torque", "tau", "moment"}
    return bool({*words[-meaning.last :]} & set(meaning.words.split()))
