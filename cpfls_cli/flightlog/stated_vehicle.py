"""What a log states: what flies, where its rotors are, which vehicle it is, and how its autopilot logs faster.

Frames, numbers and words of autopilots are those of `vehicles.toml`.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from math import cos, radians, sin
from pathlib import Path
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.topics import STAMP, Topics, previous_rows
from cpfls_cli.words import joined

Parameters = Mapping[str, float | str]
# x forward and y left, as shares of an arm, and 1 for what turns counter-clockwise seen from above, else -1.
Place = tuple[float, float, int]
TABLE: Final = tomllib.loads(Path(__file__).with_name("vehicles.toml").read_text("utf-8"))


def numbered(text: str) -> dict[int, str]:
    """Read numbers and what they stand for, ``1: X; 2: V``."""
    pairs = (each.split(":") for each in text.split(";"))
    return {int(number): words.strip() for number, words in pairs}


def spans(name: str) -> tuple[tuple[int, int, str], ...]:
    """Give rows of a first and a last number, and what the numbers between them stand for."""
    rows = (row.split(maxsplit=2) for row in TABLE[name].splitlines() if row)
    return tuple((int(first), int(last), what) for first, last, what in rows)


def _place(text: str) -> Place:
    spin = 1 if text[-1] == "+" else -1
    if "," in text:
        x, y = text[:-1].split(",")
        return float(x), float(y), spin
    angle = radians(float(text[:-1]))
    return round(cos(angle), 9) + 0.0, round(-sin(angle), 9) + 0.0, spin


def _layouts() -> Iterator[tuple[str, tuple[Place, ...]]]:
    for row in (row.split() for row in TABLE["layouts"].splitlines()):
        # The name of a frame has letters, the place of a motor ends in a sign.
        places = tuple(_place(word) for word in row if word[-1] in "+-")
        yield " ".join(row[: len(row) - len(places)]), places


LAYOUTS: Final = dict(own for own in _layouts() if own[1])
_CLASSES, _TYPES = numbered(TABLE["frame_class"]), numbered(TABLE["frame_type"])
_OF_CLASS, _OF_MAV_TYPE = (
    {number: int(count) for number, count in numbered(TABLE[f"motors_of_{name}"]).items()}
    for name in ("class", "mav_type")
)
# Motors of the frames that Copter had before FRAME_CLASS (to 3.4): FRAME is their form alone.
_COUNTS_OF_FORMS: Final = (8, 6, 4)
_AIRFRAMES: Final = spans("airframes")
_UPWARD: Final = -0.5  # Part of a rotor's axis along z, downward, from which on it carries the vehicle.
USUAL: Final[Mapping[str, Mapping[int, str]]] = {kind: numbered(own) for kind, own in TABLE["usual"].items()}


def whole(parameters: Parameters, *names: str) -> int | None:
    """Give a parameter that is a whole number, the first of some names that is there; None without one."""
    for name in names:
        try:
            return int(float(parameters[name]))
        except (KeyError, ValueError, OverflowError):
            continue
    return None


def stated_frame(parameters: Parameters, rotors: int) -> tuple[str, str] | None:
    """Give the frame that parameters state by its number, and the words for them; None where they state none.

    The log's columns show so many rotors; 0 where they show none.
    """
    kind = whole(parameters, "FRAME_CLASS", "Q_FRAME_CLASS")
    form = whole(parameters, "FRAME_TYPE", "Q_FRAME_TYPE")
    if kind is not None and kind in _CLASSES:
        word = _TYPES.get(-1 if form is None else form, "")
        # A Y6 of any type but two is wired in one way.
        frame = next((own for own in (f"{_CLASSES[kind]} {word}", _CLASSES[kind]) if own in LAYOUTS), None)
        prefix = "" if "FRAME_CLASS" in parameters else "Q_"
        return None if frame is None else (frame, f"{prefix}FRAME_CLASS and {prefix}FRAME_TYPE in the log: {frame}")
    old = whole(parameters, "FRAME")
    if old is not None and kind is None:
        word, count = _TYPES.get(old, ""), {4: "quad", 6: "hexa", 8: "octa"}.get(rotors, "")
        frame = "Y6 B" if old == 10 else f"{count} {word}"
        return (frame, f"FRAME = {old} in the log: {frame}") if frame in LAYOUTS else None
    number = whole(parameters, "SYS_AUTOSTART")
    found = next((name for first, last, name in _AIRFRAMES if first <= (number or 0) <= last), None)
    return None if found is None else (found, f"SYS_AUTOSTART = {number} in the log: {found}")


def is_open(frame: str, parameters: Parameters) -> bool:
    """Tell whether a frame is one of several that the parameters allow: FRAME does not tell a Y6 from a hexa."""
    return "FRAME_CLASS" not in parameters and "FRAME" in parameters and not frame.startswith(("quad", "Y6"))


def stated_count(parameters: Parameters) -> int | None:
    """Give the number of rotors that parameters state; None where they state none."""
    lifting = len(lifting_rotors(parameters))
    kind = whole(parameters, "FRAME_CLASS", "Q_FRAME_CLASS")
    if lifting > 0 or kind in _OF_CLASS:
        return lifting or _OF_CLASS[kind or 0]
    frame = stated_frame(parameters, 0)
    if frame is not None:
        return len(LAYOUTS[frame[0]])
    return _OF_MAV_TYPE.get(whole(parameters, "MAV_TYPE") or 0)


def count_by_form(parameters: Parameters, moving: int) -> int | None:
    """Give the number of motors of a Copter that states their form alone, the most that its moving outputs allow."""
    if whole(parameters, "FRAME") is None or "FRAME_CLASS" in parameters:
        return None
    return next((count for count in _COUNTS_OF_FORMS if count <= moving), None)


def lifting_rotors(parameters: Parameters) -> list[int]:
    """List the rotors that PX4's CA_ROTOR* let push upward, from 0: a VTOL has one that pushes forward too."""
    count = whole(parameters, "CA_ROTOR_COUNT") or 0
    return [index for index in range(count) if float(parameters.get(f"CA_ROTOR{index}_AZ", -1.0)) < _UPWARD]


AIRPLANE, GROUND, HELICOPTER, VTOL = "an airplane", "a ground vehicle", "a helicopter", "a VTOL"
NO_MULTIROTOR: Final = "not of a multirotor: only vehicles that rotors carry are modelled"

_HELICOPTER_PARAMETERS: Final = ("H_RSC_MODE", "H_COL_MIN", "H_SWASH_TYPE", "H_SV_MAN", "H_SW_TYPE", "H_SWASH_PLATE")
VTOL_TYPES: Final = range(20, 26)  # MAV_TYPE of vehicles that hover on three rotors or more.
# Numbers of parameters that stand for no multirotor, and those of headers.
_NUMBERS, _HEADERS = ({key: numbered(own) for key, own in TABLE[name].items()} for name in ("numbers", "headers"))
# SERVOn_FUNCTION of ArduPilot, what it drives, and of what vehicle.
_FUNCTIONS: Final = {
    number: (word, what) for what, words in TABLE["outputs"].items() for number, word in numbered(words).items()
}
MOTORS: Final = (*range(33, 41), *range(82, 86))  # SERVOn_FUNCTION of ArduPilot that are its motors 1 to 12.
_FEWEST_MOTORS, _FEWEST_SURFACES, _OUTPUTS = 3, 2, 32
# Flight modes of ArduPlane in which its rotors carry it: QSTABILIZE to QACRO, and landing on them.
_HOVER_MODES: Final = (*range(17, 24), 25)
_FORWARD_VTOL_STATES: Final = (1, 2, 4)  # Of PX4's vtol_vehicle_status: transitions, and flight on the wing.
_STATES: Final = (
    # Topic and field, and the states that are forward flight, or that are not.
    ("vtol_vehicle_status", "vehicle_vtol_state", _FORWARD_VTOL_STATES, True),
    ("vtol_vehicle_status", "vtol_in_rw_mode", (0,), True),
    ("vehicle_status", "vehicle_type", (1,), False),
    ("vehicle_status", "is_rotary_wing", (0,), True),
    ("MODE", "ModeNum", _HOVER_MODES, False),
    ("MODE", "Mode", _HOVER_MODES, False),
)


# What PX4 says of its arming, and what of that lets no rotor turn, whichever its version: it starts, or is on standby.
_ARMING: Final = (("actuator_armed", "armed", (0,)), ("vehicle_status", "arming_state", (0, 1)))
_SAID_S: Final = 3.0  # So often it is said, to the ends of a log.


class VehicleKind(NamedTuple):
    """What flies, and how a log says so."""

    what: str
    reason: str


def refuse_other_vehicle(topics: Topics, parameters: Parameters, system: str) -> VehicleKind | None:
    """Refuse a log of what no rotors carry, by states, parameters and columns; a VTOL is given back, which hovers."""
    found = next(_evidence(topics, parameters, system), None)
    if found is not None and found.what != VTOL:
        raise InputError(f"a log of {found.what} ({found.reason}), {NO_MULTIROTOR}")
    return found


def refuse_disarmed(topics: Topics) -> None:
    """Refuse a log in which PX4 says from begin to end that no rotor may turn: a vehicle that is carried moves too."""
    stamps = {topic: own[STAMP] for topic, own in topics.items() if len(own.get(STAMP, ()))}
    said = [
        (f"{topic}.{name}", np.isin(states, disarmed).all(), stamps[topic])
        for topic, name, disarmed in _ARMING
        if len(states := topics.get(topic, {}).get(name, ())) and len(states) == len(stamps.get(topic, ()))
    ]
    if said and all(disarmed for _, disarmed, _ in said):
        ends = min(float(own[0]) for own in stamps.values()), max(float(own[-1]) for own in stamps.values())
        # In a pause of what it says it may have flown.
        by = [name for name, _, own in said if np.diff(own, prepend=ends[0], append=ends[1]).max() < _SAID_S]
        if by:
            raise InputError(f"no flight in it: PX4 is not armed throughout ({by[0]})")


def _evidence(topics: Topics, parameters: Parameters, system: str) -> Iterator[VehicleKind]:
    name = system.partition(" ")[0]
    lifted = next((own for own in ("Q_ENABLE", "Q_TAILSIT_ENABLE") if whole(parameters, own)), None)
    if lifted is not None:
        yield VehicleKind(VTOL, f"{lifted} = {whole(parameters, lifted)}")
    if name in TABLE["firmware"]:
        yield VehicleKind(TABLE["firmware"][name], f"written by {system}")
    heads = [own for own in _HELICOPTER_PARAMETERS if own in parameters]
    if heads and not name.startswith("ArduPlane"):
        yield VehicleKind(HELICOPTER, f"it has the parameter {heads[0]}")
    for key, kinds in _NUMBERS.items():
        number = whole(parameters, key)
        if number in kinds:
            yield VehicleKind(kinds[number], f"{key} = {number}")
    start = whole(parameters, "SYS_AUTOSTART") or 0
    yield from (
        VehicleKind(what, f"SYS_AUTOSTART = {start}")
        for low, high, what in spans("other_airframes")
        if low <= start <= high
    )
    yield from _by_status(topics)
    yield from _by_outputs(parameters)
    yield from _by_header(topics, parameters)


def _by_status(topics: Topics) -> Iterator[VehicleKind]:
    """Look at what PX4 says of its vehicle again and again."""
    status = topics.get("vehicle_status", {})
    if len(status.get("is_vtol", ())) and np.any(status["is_vtol"]):
        yield VehicleKind(VTOL, "vehicle_status.is_vtol")
    kind = np.asarray(status.get("vehicle_type", ()), dtype=float)
    for number, what in ((2, AIRPLANE), (3, GROUND), (4, "a blimp")):
        if len(kind) and (kind == number).all():
            yield VehicleKind(what, f"vehicle_status.vehicle_type = {number}")
    rotary = np.asarray(status.get("is_rotary_wing", ()), dtype=float)
    if len(rotary) and not rotary.any():
        yield VehicleKind("something without rotors that carry it", "vehicle_status.is_rotary_wing = 0")


def _by_outputs(parameters: Parameters) -> Iterator[VehicleKind]:
    """Look at what the outputs of an ArduPilot drive."""
    named = {
        f"{prefix}{output}_FUNCTION": whole(parameters, f"{prefix}{output}_FUNCTION")
        for output in range(1, _OUTPUTS + 1)
        for prefix in ("SERVO", "RC")
    }
    motors = sum(number in MOTORS for number in named.values())
    surfaces = {key: _FUNCTIONS[number] for key, number in named.items() if number in _FUNCTIONS}
    if motors < _FEWEST_MOTORS and len(surfaces) >= _FEWEST_SURFACES:
        shown = ", ".join(f"{key} = {named[key]}: {word}" for key, (word, _) in list(surfaces.items())[:2])
        yield VehicleKind(next(iter(surfaces.values()))[1], shown)


def _by_header(topics: Topics, parameters: Parameters) -> Iterator[VehicleKind]:
    """Look at the header of a blackbox log, and at columns that only vehicles with wings have."""
    for key, kinds in _HEADERS.items():
        said, number = str(parameters.get(key, "")).upper(), whole(parameters, key)
        by_word = next((what for word, what in TABLE["header_words"].items() if word in said), None)
        what = by_word or kinds.get(-1 if number is None else number)
        if what is not None:
            yield VehicleKind(what, f"{key} = {said.lower() if number is None else number} in its header")
    columns = topics.get("", {})
    if "fwAltP" in columns and "mcPosAxisP[0]" not in columns:
        yield VehicleKind(AIRPLANE, "it logs the altitude control of a fixed wing, fwAltP")
    # Of forks of ArduPlane under names of their own; on rotors it logs QTUN too.
    if "NavRoll" in topics.get("CTUN", {}) and "QTUN" not in topics:
        yield VehicleKind(f"{AIRPLANE} or its like", "it logs CTUN.NavRoll")
    motors = sum(name.startswith("motor[") for name in columns)
    if "gyroADC[0]" in columns and 0 < motors < _FEWEST_MOTORS and any(own.startswith("servo[") for own in columns):
        yield VehicleKind(f"{AIRPLANE} or its like", f"it logs {motors} of motor[*] and servos")


def forward_flight(topics: Topics, grid: Array) -> BoolArray | None:
    """Mark when, on a grid in s, a VTOL is not carried by rotors alone; None where the log does not say."""
    for topic, field, states, inside in _STATES:
        values, time = (np.asarray(topics.get(topic, {}).get(name, ()), dtype=float) for name in (field, STAMP))
        if len(values) and len(values) == len(time):
            return np.asarray(np.isin(values[previous_rows(time, grid)], states) == inside, dtype=bool)
    return None


_GEOMETRY: Final = ("CA_ROTOR", "CA_AIRFRAME", "FRAME", "Q_FRAME", "SYS_AUTOSTART", "MAV_TYPE")
_NO_GEOMETRY: Final = ("_CT", "_SLEW")  # Ends of names of what is tuned in flight.
_OLD_FRAME, _FRAME = "FRAME", "FRAME_TYPE"  # Of ArduCopter before 3.5, with the same numbers.
# What besides belongs to a vehicle, as Betaflight, ArduPilot and PX4 call it.
_OTHERS: Final = ("Craft name", "motor_poles", "SERVO_BLH_POLES", "MOT_POLE_COUNT")
WRITTEN_BY: Final = "written by"  # Name of the fact that says which autopilot wrote a log.
_VERSION: Final = "version"
_BOARD: Final = ("Board information", "BRD_TYPE")
# Outputs that stop and full throttle stand for.
_RANGES: Final = ("motorOutput", "MOT_PWM_MIN", "MOT_PWM_MAX", "THR_MIN", "PWM_MIN", "PWM_MAX", "RC3_MIN", "RC3_MAX")
_OF_INPUT: Final = ("RC3_MIN", "RC3_MAX")  # Of the outputs too in ArduCopter, where MOT_PWM_MAX is 0 or not there.
# Share by which an end of a range differs that moves no load by more than flights of one vehicle differ.
_SAME_RANGE: Final = 0.002


def stated_vehicle(system: str, parameters: Mapping[str, float | str]) -> dict[str, str]:
    """List what a log says of its vehicle, as text by name: its autopilot, frame, rotors, board, range of outputs."""
    writer, _, version = system.partition(" ")
    own = dict(parameters)
    if _OLD_FRAME in own:
        own.setdefault(_FRAME, own.pop(_OLD_FRAME))
    ranges = [key for key in _RANGES if key not in _OF_INPUT or (writer == "ArduCopter" and not own.get("MOT_PWM_MAX"))]
    geometry = [key for key in sorted(own) if key.startswith(_GEOMETRY) and not key.endswith(_NO_GEOMETRY)]
    facts = {key: plain(own[key]) for key in (*geometry, *_OTHERS, *_BOARD, *ranges) if key in own}
    stated = {_VERSION: version} | facts
    return {WRITTEN_BY: writer} | {key: value for key, value in stated.items() if value.strip()}


def plain(value: float | str) -> str:
    """Write the value of a parameter."""
    return value if isinstance(value, str) else f"{value:.6g}"


def vehicles_apart(first: Mapping[str, str], other: Mapping[str, str]) -> list[str]:
    """Say in what two logs state different vehicles; empty where they do not, or one states nothing at all."""
    return [words for key, words in _apart(first, other) if key not in (_VERSION, *_BOARD, *_RANGES)]


def autopilots_apart(first: Mapping[str, str], other: Mapping[str, str]) -> list[str]:
    """Say in what two logs state another board, version or range of outputs, as one vehicle can have in turn."""
    return [words for key, words in _apart(first, other) if key in (_VERSION, *_BOARD, *_RANGES)]


def ranges_apart(first: Mapping[str, str], other: Mapping[str, str]) -> bool:
    """Tell whether two logs state other ranges of outputs, so that commands are other shares of all thrust."""
    return any(key in _RANGES for key, _ in _apart(first, other))


def _apart(first: Mapping[str, str], other: Mapping[str, str]) -> list[tuple[str, str]]:
    return [
        (key, f"{key} {first[key] or 'something unknown'} and {other[key] or 'something unknown'}")
        for key in first
        if key in other and first[key] != other[key] and not (key in _RANGES and _nearly(first[key], other[key]))
    ]


def _nearly(first: str, other: str) -> bool:
    one, two = ([float(part) for part in each.split(",")] for each in (first, other))
    return len(one) == len(two) and all(abs(a - b) <= _SAME_RANGE * abs(a) for a, b in zip(one, two, strict=True))


FAST_HZ = 100.0  # At which motors are to be logged, which respond within some 50 ms.
# Below which they are logged too slowly for cause and effect to be distinguished: two samples in the 50 ms
# within which they follow, and a half.
SLOW_HZ = 25.0
_COPTER = ("ArduCopter", "ArduPilot")
_IMU, _FAST_IMU, _WITH_FAST_IMU = 7, 18, (3, 3)
_WITH_DSHOT = (4, 0)
# Of LOG_BITMASK of ArduCopter; the last is newer than others, and takes the place of the second.
_BITS: Final[Mapping[int, str]] = {0: "fast attitude", _IMU: "IMU", 10: "outputs", _FAST_IMU: "fast IMU, from 3.3 on"}
_USUAL_BITS = 176126  # LOG_BITMASK of ArduCopter 4 by default.
_NONE: Final[Parameters] = MappingProxyType({})


def shown_slowly(rotors_hz: float) -> str:
    """Say up to which frequency rotors that are logged so often, Hz, show the motion."""
    return f"rotors are logged {rotors_hz:.2g} times a second, which shows no motion above {rotors_hz / 2:.2g} Hz"


def log_faster(what: str, least_hz: float, *systems: str, parameters: Parameters = _NONE) -> str:
    """Ask for what is logged too slowly faster, and say what to set in the autopilots that wrote the logs.

    The systems are what logs name as their writers, with versions.
    """
    asked = f"log {what} at {least_hz:g} Hz or more"
    known = dict.fromkeys(
        f"{begin}: {next(cure for since, cure in cures if version is None or version >= tuple(since))}"
        for system, version in ((own, _version(own)) for own in systems)
        for begin, cures in TABLE["log_faster"].items()
        if system.startswith(begin)
    )
    if "SDLOG_RATE" in parameters and "SDLOG_PROFILE" not in parameters:
        # Before ULog; -1 leaves the rate to the script that starts the logger.
        known = dict.fromkeys(["PX4: SDLOG_RATE = 200, then restart"])
    said = [f"{asked} ({joined(known)})"] if known else []
    ours = (system for system in systems if system.startswith(_COPTER))
    said += dict.fromkeys(_of_copter(system, parameters) for system in ours)
    return "; ".join(said) or asked


def _version(system: str) -> tuple[int, int] | None:
    """Read the version that a log names, None where it names none."""
    found = re.search(r" v?(\d+)\.(\d+)", system)
    return None if found is None else (int(found[1]), int(found[2]))


def _of_copter(system: str, parameters: Parameters) -> str:
    """Say what ArduPilot's copters can log: outputs are slow, whatever is set; what came later is asked of no other."""
    version, has = _version(system), parameters.get("LOG_BITMASK")
    new = version is not None and version >= _WITH_DSHOT
    old = version is not None and version < _WITH_FAST_IMU
    has = _USUAL_BITS if has is None and new else has
    mask = int(has) if isinstance(has, int | float) and has >= 0 else None
    lacks = old and mask is not None and not mask >> _IMU & 1
    bits = [bit for bit in _BITS if {_IMU: lacks, _FAST_IMU: not old}.get(bit, True)]
    named = "with"
    if mask is not None:
        named = f"= {mask | sum(1 << bit for bit in bits)}, which is {mask} with"
    names = joined(f"{bit} ({_BITS[bit]})" for bit in bits)
    return (
        f"log motor speeds with bidirectional DShot ({'' if new else 'ArduPilot 4: '}SERVO_BLH_BDMASK), for {system} "
        f"logs outputs (RCOU) 10 times a second at most; body rates, and RATE from which outputs are rebuilt, come"
        f" faster with "
        f"{'LOG_FILE_RATEMAX = 0 and ' if new else ''}LOG_BITMASK {named} bits {names}"
    )
