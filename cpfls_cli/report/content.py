"""What a command has to say: text, facts, tables, figures, a summary for machines; and how numbers are written."""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal

Tone = Literal["plain", "note", "good", "warning", "unsure"]
"""How much something stands out."""


class Form(StrEnum):
    """What a report is written as."""

    HTML = "html"
    MARKDOWN = "md"
    JSON = "json"


STRUCK = re.compile(r"~~([^~]*)~~(?= impossible)")
"""A number in a text that is struck through; the word behind it says the same where nothing can be struck."""


def impossible(number: str) -> str:
    """Mark a number that no vehicle has."""
    return f"~~{number}~~ impossible"


@dataclass(frozen=True)
class Text:
    """A paragraph.

    Attributes
    ----------
    always : bool
        Of one that warns: whether a terminal shows it however many others there are.
    """

    text: str
    tone: Tone = "plain"
    always: bool = False


@dataclass(frozen=True)
class Facts:
    """Terms with their values."""

    rows: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Cell:
    """A cell of a table that stands out."""

    text: str
    tone: Tone = "plain"


@dataclass(frozen=True)
class Table:
    """A table, with a name that is unique on the page; its first column names the rows.

    Attributes
    ----------
    words : frozenset of int
        Columns that are aligned left; all others hold numbers.
    sentences : frozenset of int
        Columns of long text, which is broken into lines.
    """

    name: str
    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str | Cell]]
    words: frozenset[int] = frozenset({0})
    sentences: frozenset[int] = frozenset()

    @property
    def cells(self) -> list[list[Cell]]:
        """All rows with every entry as a cell."""
        return [[entry if isinstance(entry, Cell) else Cell(entry) for entry in row] for row in self.rows]


Picture = Any
"""A figure as `report.canvas` draws it when somebody asks what it looks like: not every form of a page shows it."""


@dataclass(frozen=True)
class Plot:
    """A figure, with a name that is unique on the page, and a description for those who do not see it.

    Attributes
    ----------
    see : tuple of (str, str), or None
        Where on the page more is said of it: an anchor, and the words that lead there.
    """

    name: str
    caption: str
    picture: Picture
    description: str = ""
    see: tuple[str, str] | None = None


@dataclass(frozen=True)
class Listing:
    """Verbatim text."""

    text: str


@dataclass(frozen=True)
class Folded:
    """Blocks that only some readers want: a page folds them away, a terminal names them and shows them on request.

    Attributes
    ----------
    summary : str
        What they are, in a few words.
    shown : bool
        Whether a page shows them open.
    """

    summary: str
    blocks: Sequence[Block]
    shown: bool = False


@dataclass(frozen=True)
class Heading:
    """A heading inside a section."""

    text: str


@dataclass(frozen=True)
class Box:
    """What a reader must see first; its label is one word, such as the name of a verdict."""

    label: str
    title: str
    sentences: Sequence[str]
    tone: Tone = "note"


Block = Box | Text | Facts | Table | Plot | Listing | Folded | Heading


def unfolded(blocks: Iterable[Block]) -> Iterator[Block]:
    """List blocks with those folded away in their place."""
    for block in blocks:
        yield from unfolded(block.blocks) if isinstance(block, Folded) else (block,)


@dataclass(frozen=True)
class Section:
    """One section of the page; its name is the anchor."""

    name: str
    title: str
    blocks: Sequence[Block]

    @property
    def plots(self) -> list[str]:
        """Names of its plots, also of those folded away, in order."""
        return [block.name for block in unfolded(self.blocks) if isinstance(block, Plot)]

    @property
    def tables(self) -> list[str]:
        """Names of its tables, also of those folded away, in order."""
        return [block.name for block in unfolded(self.blocks) if isinstance(block, Table)]


Command = Sequence[str | Path]
"""Words of a command line; a string is what a person does by hand."""


def command_line(command: Command) -> str:
    """Write a command so that it can be pasted, and what is done by hand as it is."""
    return command if isinstance(command, str) else shlex.join(map(str, command))


@dataclass(frozen=True)
class Outcome:
    """What a command has to say.

    Attributes
    ----------
    summary : mapping
        For machines (``--json``).
    blocks : tuple of Block
        For people, on standard output; texts of tone ``warning`` go to standard error.
    exit_code : int
        Not 0 where the work was stopped.
    next : tuple of Command
        To go on with, with the names of this run.
    written : Path or None
        File or folder that the command wrote.
    """

    summary: Mapping[str, Any]
    blocks: tuple[Block, ...] = ()
    exit_code: int = 0
    next: tuple[Command, ...] = ()
    written: Path | None = None


def caution_texts(cautions: Iterable[str]) -> Iterator[Text]:
    """Write what speaks against a model: the first is seen however many notes there are."""
    return (Text(each, "warning", always=index == 0) for index, each in enumerate(cautions))


UNKNOWN = "—"
ROUNDING = 1e-12
_LARGE = 1e6
_LEAST_P = 1e-6
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SMALLEST, _LARGEST = -4, 6
"""Powers of ten between which no power is written."""

_FEWEST, _MOST = 2, 15
"""Significant digits; a number holds fifteen."""


def number(value: float, digits: int = 4) -> str:
    """Write a number with so many significant digits, perhaps a power of ten; ``—`` if unknown, ``∞`` without bound."""
    if math.isnan(value):
        return UNKNOWN
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    power = int(exponent)
    if value == 0 or _SMALLEST <= power < _LARGEST:
        decimals = max(digits - 1 - power, 0) if value else 0
        text = f"{value:.{decimals}f}"
    else:
        text = f"{mantissa} × {power_of_ten(power)}"
    return text.replace("-", "−")


def plain(value: float, smallest: float = 1e-3) -> str:
    """Write a setting or the tick of an axis: no trailing zeros, small and large ones by powers of a thousand."""
    if value == 0 or not math.isfinite(value) or smallest <= abs(value) < _LARGE:
        return (f"{value:.6g}" if math.isfinite(value) else number(value)).replace("-", "−")
    power = 3 * math.floor(math.log10(abs(value)) / 3)
    return f"{value / 10.0**power:.6g} × {power_of_ten(power)}".replace("-", "−")


def power_of_ten(power: int) -> str:
    """Write ten to a power."""
    return f"10{str(power).translate(_SUPERSCRIPT)}"


def count(value: float) -> str:
    """Write a whole number."""
    return UNKNOWN if math.isnan(value) else str(round(value))


def percent(share: float, digits: int = 3) -> str:
    """Write a share as per cent; what only rounding leaves is written as zero."""
    if math.isnan(share) or math.isinf(share):
        return number(share)
    return "0 %" if abs(share) < ROUNDING else f"{number(100 * share, digits)} %"


def whole_percent(share: float) -> str:
    """Write a share in whole per cent."""
    if not math.isfinite(share):
        return number(share)
    if 0 < abs(share) < 0.005:
        return "< 1 %"
    return "> 99 %" if 0.995 <= share < 1 else f"{100 * share:.0f} %".replace("-", "−")


def probability(value: float) -> str:
    """Write a probability; the smallest ones by a bound."""
    return "< 10⁻⁶" if value < _LEAST_P else number(value, 2)


def change(share: float) -> str:
    """Write a relative change as per cent with its sign."""
    if not math.isfinite(share):
        return UNKNOWN
    text = f"{100 * share:+.2f} %"
    return "0 %" if text in ("+0.00 %", "-0.00 %") else text.replace("-", "−")


def r_squared(value: float) -> str:
    """Write a share of variance explained; it reads 1 only where nothing but rounding is missing."""
    if not math.isfinite(value):
        return UNKNOWN
    if 1.0 - value < ROUNDING:
        return "1"
    if value > 0.99995:
        return "> 0.9999"
    text = f"{value:.4f}" if abs(value) < 100 else number(value, 4)
    return "0.0000" if text == "-0.0000" else text.replace("-", "−")


def with_interval(value: float, low: float, high: float) -> tuple[str, str, str]:
    """Write a value and the ends of its interval alike, half the width of the interval to two digits.

    Each has ``-`` for minus and ``e`` for a power of ten that is the same for all; four digits where the interval is
    not known or has no width.
    """
    width = high - low
    if not (math.isfinite(width) and math.isfinite(value) and width > 0):
        return _alone(value), _alone(low), _alone(high)
    largest = math.floor(math.log10(max(abs(value), abs(low), abs(high))))
    last = math.floor(math.log10(0.5 * width)) - 1
    digits = min(max(largest - last + 1, _FEWEST), _MOST)
    power = 0 if _SMALLEST <= largest < _LARGEST else largest
    decimals = max(digits - 1 - (largest - power), 0)

    def written(one: float) -> str:
        text = f"{one / 10.0**power:.{decimals}f}"
        # Rounded to zero, a number has no sign.
        text = text.removeprefix("-") if float(text) == 0 else text
        return f"{text}e{power}" if power else text

    return written(value), written(low), written(high)


def _alone(value: float) -> str:
    if not math.isfinite(value):
        return number(value).replace("−", "-")
    return f"{value:.4g}" if value else "0"


def printed(text: str) -> str:
    """Write a number of `with_interval` as in print: with a minus sign, and ``× 10`` with a raised power."""
    mantissa, _, power = text.partition("e")
    raised = f" × {power_of_ten(int(power))}" if power else ""
    return mantissa.replace("-", "−") + raised


def sentence(text: str) -> str:
    """Write words as a sentence: with a capital letter, unless a file name comes first, and a full stop."""
    first = text.split(" ", 1)[0]
    start = text if "." in first or "_" in first else f"{text[:1].upper()}{text[1:]}"
    return start if start.endswith((".", "?", "!")) else f"{start}."
