"""What names of columns and sizes of numbers mean: `columns.toml`, the table that logs are recognised by.

In its rows a remark begins with ``#``, and ``~`` is a space within a unit.
"""

import tomllib
from pathlib import Path
from typing import Final, Literal, NamedTuple, cast, get_args

from cpfls_cli.flightlog.settings import SignalName
from cpfls_cli.units import UnitName

_TABLE: Final = tomllib.loads(Path(__file__).with_name("columns.toml").read_text("utf-8"))
PX4, ARDUPILOT, BETAFLIGHT, CRAZYFLIE, PARROT = "PX4", "ArduPilot", "Betaflight", "Crazyflie", "Parrot"
_UNITS: Final[dict[str, UnitName]] = {own.replace(" ", "~"): own for own in get_args(UnitName)}
KIN: Final = {ARDUPILOT: ("Ardu",), BETAFLIGHT: ("INAV", "Cleanflight", "EmuFlight")}


def _rows(name: str, separator: str | None = None) -> list[list[str]]:
    rows = (row.split("#")[0] for row in _TABLE[name].splitlines())
    return [[cell.strip() for cell in row.split(separator)] for row in rows if row.strip()]


def _number(text: str) -> float:
    parts = [float(part) for part in text.split("/")]
    return parts[0] / parts[1] if len(parts) > 1 else parts[0]


class Known(NamedTuple):
    """Columns in which a kind of log holds a signal."""

    system: str
    signal: str  # One that `import.signals` takes, or one that `look` alone asks for.
    columns: tuple[str, ...]  # Each of them, or one pattern with ``*`` for the axes or numbers of a group.
    unit: UnitName | None  # Of ``scale * column + offset``; None where numbers or the log show it.
    frame: str | None  # None where it has none, and for a setpoint, which is in the axes of what is measured.
    scale: float
    offset: float
    sign: tuple[float, ...] | None  # Of each column in that frame; None for +1 everywhere.


def _known(system: str, signal: str, pattern: str, unit: str, frame: str, factor: str, signs: str) -> Known:
    before, _, rest = pattern.partition("{")
    axes, _, after = rest.partition("}")
    columns = tuple(f"{before}{axis}{after}" for axis in axes.split(","))
    scale, _, offset = factor.partition(",")
    sign = None if signs == "+" else tuple(1.0 if own == "+" else -1.0 for own in signs)
    own = (None if unit == "-" else _UNITS[unit], None if frame == "-" else frame)
    return Known(system, signal, columns, *own, _number(scale), float(offset or 0), sign)


class Meaning(NamedTuple):
    """What words of a name mean a signal."""

    signal: SignalName
    kinds: frozenset[str]  # In what its columns differ,
    number: int  # and how many there are; of rotors at least.
    last: int  # Only so many words at the end of the name count; 0: all of them.
    words: frozenset[str]  # One of them has to stand in the name.
    never: frozenset[str]  # Words that rule it out, with those of `NOT_MEASURED`.


class Row(NamedTuple):
    """A size that speaks for a unit."""

    size: float
    unit: UnitName
    scale: float  # Factor that makes it of what is logged.


class Range(NamedTuple):
    """Numbers of a command that is no speed by its name, and what they are taken for: a share of the largest."""

    low: float  # No number is below the first or above the last; the largest lies above the second.
    high_from: float
    high: float
    scale: float
    offset: float
    clear: Literal["always", "of commands", "never"]  # Whether the range alone shows it.
    words: str
    rival: tuple[str, ...]  # Another reading of such numbers, but for speeds, and where it holds; or none.


def _each(name: str) -> frozenset[str]:
    return frozenset(_TABLE[name].split())


KNOWN: Final = tuple(_known(*row) for row in _rows("known"))
# What names write, as the unit and the factor that makes it.
WRITTEN: Final = {
    text: (_UNITS[unit], _number(scale)) for unit, scale, *written in _rows("spellings") for text in written
}
IN_FULL: Final[dict[str, str]] = _TABLE["in_full"]
ONE_WORD: Final[dict[str, str]] = _TABLE["one_word"]
A_WORD, RATE_WORDS, WISHED, FAST = (_each(name) for name in ("a_word", "rate_words", "wished", "fast"))
ASKED, AIMED, HEIGHT = _each("asked"), _each("aimed") | WISHED, _each("height")
MOTORS, TELEMETRY = _each("motors"), _each("telemetry")
AIRPLANE_WORDS: Final[list[list[str]]] = _TABLE["airplane"]
WITH_AIRPLANE: Final = _each("with_airplane")
FAMILIES: Final = tuple((kind, tuple(axes)) for kind, *axes in _rows("families"))
NOT_MEASURED, SECOND_HAND, OF_TRACKS = _each("not_measured"), _each("second_hand"), _each("of_tracks")
TOPICS_OF_PX4: Final = _each("topics_of_px4")
IN_RADIANS: Final = {word: signals for word, *signals in _rows("in_radians")}
ALLOWED: Final = {signal: frozenset(words) for signal, *words in _rows("allowed")}
MEANINGS: Final = tuple(
    Meaning(
        cast("SignalName", signal),
        frozenset(kinds.split()),
        int(number),
        int(last),
        *(frozenset(own.replace("@rate_words", _TABLE["rate_words"]).split()) for own in words),
    )
    for signal, kinds, number, last, *words in _rows("meanings", "|")
)
# "Current" may be the current time.
NO_CLOCK: Final = (_each("no_clock") | ASKED | HEIGHT | TELEMETRY | NOT_MEASURED - {"current"}).union(
    *(own.words for own in MEANINGS if own.signal != "position")
)
RANGES: Final = tuple(Range._make((*map(_number, row[:5]), *row[5:7], tuple(row[7:]))) for row in _rows("ranges", "|"))


def sizes(of: str) -> tuple[Row, ...]:
    """Give the sizes that speak for units of a kind."""
    rows = (own for kind, *own in _rows("sizes") if kind == of)
    return tuple(Row(float(size), _UNITS[unit], _number(scale)) for size, unit, scale in rows)
