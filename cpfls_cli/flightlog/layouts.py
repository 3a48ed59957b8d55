"""Where autopilots put the rotors of the frames that they know, in the order of their motors, and how each turns.

Facts of the motor libraries of ArduPilot (AP_MotorsMatrix), PX4 (geometries of its airframes) and Betaflight (mixers).
A new frame is a row of `_LAYOUTS`, and its number one of `_TYPES`, `_AIRFRAMES` or `_USUAL`.
"""

from collections.abc import Mapping
from math import cos, radians, sin
from typing import Final

Parameters = Mapping[str, float | str]
# x forward and y left, as shares of an arm, and 1 for what turns counter-clockwise seen from above, else -1.
Place = tuple[float, float, int]
_LAYOUTS: Final = """
    # Angle of each motor clockwise from the front, degrees, or x forward and y left; + turns counter-clockwise
    quad plus                  90+ -90+ 0- 180-
    quad X                     45+ -135+ -45- 135-
    quad V                     45+ -135+ -45- 135-
    quad H                     45- -135- -45+ 135+
    quad plus, reversed        90- -90- 0+ 180+
    quad X of Betaflight       135- 45+ -135+ -45-
    quad X reversed            135+ 45- -135- -45+
    quad X of DJI              45+ -45- -135+ 135-
    quad X clockwise           45+ 135- -135+ -45-
    quad Y4                    1,-1+ -1,0- -1,0+ 1,1-
    hexa plus                  0- 180+ -120- 60+ -60+ 120-
    hexa X                     90- -90+ -30- 150+ 30+ -150-
    hexa H                     0,-1- 0,1+ 1,1- -1,-1+ 1,-1+ -1,1-
    hexa X of DJI              30+ -30- -90+ -150- 150+ 90-
    hexa X clockwise           30+ 90- 150+ -150- -90+ -30-
    hexa X of Betaflight       150+ 30+ -150- -30- 90- -90+
    Y6                         60+ -60- -60+ 180- 60- 180+
    Y6 B                       60- 60+ 180- 180+ -60- -60+
    Y6 F                       180+ 60+ -60+ 180- 60- -60-
    hexa coaxial               60- 60+ 180- 180+ -60- -60+
    octa plus                  0- 180- 45+ 135+ -45+ -135+ -90- 90-
    octa X                     22.5- -157.5- 67.5+ 157.5+ -22.5+ -112.5+ -67.5- 112.5-
    octa V                     .34,.83- -.32,-.67- -.32,.67+ -1,-.5+ 1,1+ .34,-.83+ 1,-1- -1,.5-
    octa H                     1,-1- -1,1- .333,-1+ -1,-1+ 1,1+ -.333,1+ .333,1- -.333,-1-
    octa I                     -1,.333- 1,-.333- -1,1+ 1,.333+ -1,-.333+ 1,-1+ -1,-1- 1,1-
    octa X of DJI              22.5+ -22.5- -67.5+ -112.5- -157.5+ 157.5- 112.5+ 67.5-
    octa X clockwise           22.5+ 67.5- 112.5+ 157.5- -157.5+ -112.5- -67.5+ -22.5-
    octa quad plus             0+ -90- 180+ 90- -90+ 0- 90+ 180-
    octa quad X                45+ -45- -135+ 135- -45+ 45- 135+ -135-
    octa quad V                45+ -45- -135+ 135- -45+ 45- 135+ -135-
    octa quad H                45- -45+ -135- 135+ -45- 45+ 135- -135+
    octa quad X clockwise      45+ 45- 135- 135+ -135+ -135- -45- -45+
    octa quad X of Betaflight  135- 45+ -135+ -45- 135+ 45- -135- -45+
    octa quad X reversed       135+ 45- -135- -45+ 135- 45+ -135+ -45-
    dodeca hexa plus           0+ 0- 60- 60+ 120+ 120- 180- 180+ -120+ -120- -60- -60+
    dodeca hexa X              30+ 30- 90- 90+ 150+ 150- -150- -150+ -90+ -90- -30- -30+
    deca plus                  0+ 36- 72+ 108- 144+ 180- -144+ -108- -72+ -36-
    deca X                     18+ 54- 90+ 126- 162+ -162- -126+ -90- -54+ -18-
"""


def numbered(text: str) -> dict[int, str]:
    """Read a table of numbers and what they stand for, ``1: X; 2: V``."""
    pairs = (each.split(":") for each in text.split(";"))
    return {int(number): words.strip() for number, words in pairs}


def _place(text: str) -> Place:
    spin = 1 if text[-1] == "+" else -1
    if "," in text:
        x, y = text[:-1].split(",")
        return float(x), float(y), spin
    angle = radians(float(text[:-1]))
    return round(cos(angle), 9) + 0.0, round(-sin(angle), 9) + 0.0, spin


def _layouts() -> dict[str, tuple[Place, ...]]:
    rows = (row.split() for row in _LAYOUTS.splitlines() if row.strip() and "#" not in row)
    # The name of a frame has letters, the place of a motor ends in a sign.
    return {
        " ".join(word for word in row if word[-1] not in "+-"): tuple(_place(word) for word in row if word[-1] in "+-")
        for row in rows
    }


LAYOUTS: Final = _layouts()
# FRAME_CLASS of ArduPilot, and the number of its motors; others are no frames of upright rotors alone.
_CLASSES: Final = numbered("1: quad; 2: hexa; 3: octa; 4: octa quad; 5: Y6; 12: dodeca hexa; 14: deca")
_OF_CLASS: Final = {1: 4, 2: 6, 3: 8, 4: 8, 5: 6, 7: 3, 12: 12, 14: 10}
_TYPES: Final = numbered(
    "0: plus; 1: X; 2: V; 3: H; 6: plus, reversed; 10: B; 11: F; 12: X of Betaflight; 13: X of DJI; 14: X clockwise;"
    " 15: I; 18: X reversed; 19: Y4"
)
# Motors of the frames that Copter had before FRAME_CLASS (to 3.4): FRAME is their form alone.
_COUNTS_OF_FORMS: Final = (8, 6, 4)
# First and last SYS_AUTOSTART of PX4 that is a frame of one kind.
_AIRFRAMES: Final = (
    (4000, 4899, "quad X"),
    (5000, 5999, "quad plus"),
    (6000, 6999, "hexa X"),
    (7000, 7999, "hexa plus"),
    (8000, 8999, "octa X"),
    (9000, 9999, "octa plus"),
    (11000, 11999, "hexa coaxial"),
    (12000, 12999, "octa quad X"),
    (24000, 24999, "dodeca hexa X"),
)
_UPWARD: Final = -0.5  # Part of a rotor's axis along z, downward, from which on it carries the vehicle.
_OF_MAV_TYPE: Final = {2: 4, 13: 6, 14: 8, 15: 3, 29: 12, 35: 10}
USUAL: Final[Mapping[str, Mapping[int, str]]] = {
    "PX4": {4: "quad X", 6: "hexa X", 8: "octa X"},
    "ArduPilot": {4: "quad X", 6: "hexa X", 8: "octa X"},
    "Betaflight": {4: "quad X of Betaflight", 6: "hexa X of Betaflight", 8: "octa quad X of Betaflight"},
    "Crazyflie": {4: "quad X clockwise"},
}
"""Frame that a kind of log numbers its motors for if nothing is changed, by the number of motors."""


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
