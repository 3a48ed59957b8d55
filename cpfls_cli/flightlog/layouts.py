"""Where autopilots put the rotors of the frames that they know, in the order of their motors: `vehicles.toml`."""

import tomllib
from collections.abc import Iterator, Mapping
from math import cos, radians, sin
from pathlib import Path
from typing import Final

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
