"""What a log says it is a flight of: firmware, parameters and columns, in one table; only multirotors are modelled."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.layouts import Parameters, whole
from cpfls_cli.flightlog.topics import STAMP, Topics, previous_rows

AIRPLANE, GROUND, BOAT, SUBMARINE = "an airplane", "a ground vehicle", "a boat", "a submarine"
HELICOPTER, BLIMP, BALLOON, VTOL = "a helicopter", "a blimp", "a balloon", "a VTOL"
_FIRMWARE: Final = {
    "ArduPlane": AIRPLANE,
    "ArduRover": f"{GROUND} or {BOAT}",
    "ArduAPMrover2": f"{GROUND} or {BOAT}",
    "ArduSub": SUBMARINE,
    "ArduAntennaTracker": "an antenna tracker",
    "ArduBlimp": BLIMP,
    "ArduHeli": HELICOPTER,
    "Rotorflight": HELICOPTER,
}
_HELICOPTER_PARAMETERS: Final = ("H_RSC_MODE", "H_COL_MIN", "H_SWASH_TYPE", "H_SV_MAN", "H_SW_TYPE", "H_SWASH_PLATE")
_FRAME_CLASSES: Final = {
    6: HELICOPTER,
    8: "a single copter with flaps",
    9: "a coaxial copter with flaps",
    10: "a bicopter or tail-sitter, whose two rotors tilt",
    11: "a helicopter with two rotors",
    13: "a helicopter with four rotors",
}
VTOL_TYPES: Final = range(20, 26)  # MAV_TYPE of vehicles that hover on three rotors or more.
_MAV_TYPES: Final = {
    1: AIRPLANE,
    3: "a coaxial helicopter",
    4: HELICOPTER,
    5: "an antenna tracker",
    7: BLIMP,
    8: BALLOON,
    9: "a rocket",
    10: GROUND,
    11: BOAT,
    12: SUBMARINE,
    16: "a flapping wing",
    17: "a kite",
    19: "a tail-sitter with two rotors",
    **dict.fromkeys(VTOL_TYPES, VTOL),
}
_CA_AIRFRAMES: Final = {
    1: AIRPLANE,
    2: VTOL,
    3: VTOL,
    4: VTOL,
    5: GROUND,
    6: GROUND,
    10: HELICOPTER,
    11: HELICOPTER,
    12: "a coaxial helicopter",
    13: GROUND,
    14: "a spacecraft",
    15: "a spacecraft",
}
_AUTOSTART: Final = (
    # First and last SYS_AUTOSTART of PX4's airframes of a kind.
    *((1002, 1002, VTOL), (1003, 1003, AIRPLANE), (1101, 1101, AIRPLANE), (1102, 1103, VTOL), (2000, 2499, AIRPLANE)),
    *((2500, 2599, BLIMP), (3000, 3999, AIRPLANE), (13000, 13999, VTOL), (15000, 15999, "a coaxial helicopter")),
    *((16000, 16999, HELICOPTER), (17000, 17999, "an autogyro"), (18000, 18999, BALLOON)),
    *((50000, 59999, GROUND), (60000, 60999, SUBMARINE)),
)
_PLATFORMS: Final = {1: AIRPLANE, 2: HELICOPTER, 4: GROUND, 5: BOAT}  # Platform types of INAV by number.
# Mixers of Betaflight and its kin by number; 3 to 6 motors alone have any other.
_MIXERS: Final = {8: AIRPLANE, 14: AIRPLANE, 15: HELICOPTER, 16: HELICOPTER, 24: AIRPLANE}
_SURFACES: Final = {
    4: "aileron",
    16: "aileron",
    19: "elevator",
    21: "rudder",
    24: "flaperon",
    25: "flaperon",
    77: "elevon",
    78: "elevon",
    79: "V-tail",
    80: "V-tail",
}
_STEERING: Final = {26: "ground steering", 73: "left throttle of a rover", 74: "right throttle of a rover"}
_ROTOR_HEADS: Final = {31: "rotor head of a helicopter", 32: "tail of a helicopter"}
_FUNCTIONS: Final = {
    **{number: (word, AIRPLANE) for number, word in _SURFACES.items()},
    **{number: (word, GROUND) for number, word in _STEERING.items()},
    **{number: (word, HELICOPTER) for number, word in _ROTOR_HEADS.items()},
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


class VehicleKind(NamedTuple):
    """What flies, and how a log says so."""

    what: str
    reason: str
    hovers: bool = False  # Whether rotors carry it for a part of its flight.


def other_vehicle(topics: Topics, parameters: Parameters, system: str) -> VehicleKind | None:
    """Tell what a log says it flies; None for a multirotor, and where it does not say.

    Parameters
    ----------
    topics : mapping
        Of them the states of the vehicle and the names of columns are looked at.
    """
    found = next(_evidence(topics, parameters, system), None)
    return None if found is None else found._replace(hovers=found.what == VTOL)


def refuse_other_vehicle(topics: Topics, parameters: Parameters, system: str) -> VehicleKind | None:
    """Refuse a log of something that no rotors carry; a VTOL is given back, which hovers as a multirotor."""
    found = other_vehicle(topics, parameters, system)
    if found is not None and not found.hovers:
        raise InputError(
            f"a log of {found.what} ({found.reason}), not of a multirotor: only vehicles that rotors carry are modelled"
        )
    return found


def _evidence(topics: Topics, parameters: Parameters, system: str) -> Iterator[VehicleKind]:
    name = system.partition(" ")[0]
    lifted = next((own for own in ("Q_ENABLE", "Q_TAILSIT_ENABLE") if whole(parameters, own)), None)
    if lifted is not None:
        yield VehicleKind(VTOL, f"{lifted} = {whole(parameters, lifted)}")
    if name in _FIRMWARE:
        yield VehicleKind(_FIRMWARE[name], f"written by {system}")
    heads = [own for own in _HELICOPTER_PARAMETERS if own in parameters]
    if heads and not name.startswith("ArduPlane"):
        yield VehicleKind(HELICOPTER, f"it has the parameter {heads[0]}")
    for key, kinds in (("FRAME_CLASS", _FRAME_CLASSES), ("CA_AIRFRAME", _CA_AIRFRAMES), ("MAV_TYPE", _MAV_TYPES)):
        number = whole(parameters, key)
        if number in kinds:
            yield VehicleKind(kinds[number], f"{key} = {number}")
    start = whole(parameters, "SYS_AUTOSTART") or 0
    yield from (VehicleKind(what, f"SYS_AUTOSTART = {start}") for low, high, what in _AUTOSTART if low <= start <= high)
    yield from _by_status(topics)
    yield from _by_outputs(parameters)
    yield from _by_header(topics, parameters)


def _by_status(topics: Topics) -> Iterator[VehicleKind]:
    """Look at what PX4 says of its vehicle again and again."""
    status = topics.get("vehicle_status", {})
    if len(status.get("is_vtol", ())) and np.any(status["is_vtol"]):
        yield VehicleKind(VTOL, "vehicle_status.is_vtol")
    kind = np.asarray(status.get("vehicle_type", ()), dtype=float)
    for number, what in ((2, AIRPLANE), (3, GROUND), (4, BLIMP)):
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
    """Look at the header and the columns of a blackbox log."""
    for key, kinds in (("platform_type", _PLATFORMS), ("mixer", _MIXERS), ("mixer_mode", _MIXERS)):
        said, number = str(parameters.get(key, "")).upper(), whole(parameters, key)
        words = {"AIRPLANE": AIRPLANE, "WING": AIRPLANE, "HELI": HELICOPTER, "ROVER": GROUND, "BOAT": BOAT}
        by_word = next((what for word, what in words.items() if word in said), None)
        what = by_word or kinds.get(-1 if number is None else number)
        if what is not None:
            yield VehicleKind(what, f"{key} = {said.lower() if number is None else number} in its header")
    columns = topics.get("", {})
    if "fwAltP" in columns and "mcPosAxisP[0]" not in columns:
        yield VehicleKind(AIRPLANE, "it logs the altitude control of a fixed wing, fwAltP")
    motors = sum(name.startswith("motor[") for name in columns)
    if "gyroADC[0]" in columns and 0 < motors < _FEWEST_MOTORS and any(own.startswith("servo[") for own in columns):
        yield VehicleKind(f"{AIRPLANE} or its like", f"it logs {motors} of motor[*] and servos")


def forward_flight(topics: Topics, grid: Array) -> BoolArray | None:
    """Mark when a VTOL is not carried by rotors alone; None where the log does not say.

    Parameters
    ----------
    grid : array, shape (time,), s
        On the clock of the topics.
    """
    for topic, field, states, inside in _STATES:
        values, time = (np.asarray(topics.get(topic, {}).get(name, ()), dtype=float) for name in (field, STAMP))
        if len(values) and len(values) == len(time):
            return np.asarray(np.isin(values[previous_rows(time, grid)], states) == inside, dtype=bool)
    return None
