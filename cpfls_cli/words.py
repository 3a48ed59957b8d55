"""Words of messages, alike in all rooms."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from textwrap import wrap
from typing import Any

_UNIT = re.compile(r"_(?:1_s|s|hz|m)$")
_SYMBOL = re.compile(r"[A-Za-z]{1,2}_.+|(?:theta|delta)_[xyz]")


def joined(words: Iterable[str], last: str = "and") -> str:
    """Join words to a phrase, without repeating one; of none, an empty one."""
    *others, final = dict.fromkeys(words) or ("",)
    return f"{', '.join(others)} {last} {final}" if others else final


def some(names: Sequence[str], most: int, between: str = ", ") -> str:
    """List names, not more than anybody reads."""
    rest = len(names) - most
    return between.join(names[:most]) + (f" and {rest} more" if rest > 0 else "")


def few(names: Sequence[str], most: int = 6) -> str:
    """Join names to a phrase, not more than anybody reads in a sentence."""
    return some(names, most) if len(names) > most else joined(names)


def capitalised(words: str) -> str:
    """Begin with a capital."""
    return words[0].upper() + words[1:]


def spoken(name: str) -> str:
    """Say the name of a number as people do, without underscores and unit; a symbol, such as d_x or theta_x, stays."""
    words = _UNIT.sub("", name)
    return name if _SYMBOL.fullmatch(name) else words.replace("_", " ")


def did_you_mean(name: str, known: Iterable[str], otherwise: str, *, most: int = 1, cutoff: float = 0.4) -> str:
    """Ask whether one of the known names was meant that are most alike; say something else where none is."""
    near = get_close_matches(name, list(known), n=most, cutoff=cutoff)
    return f"did you mean {' or '.join(near)}?" if near else otherwise


def by_name(*functions: Any) -> dict[str, Any]:
    """Give functions by their names, as templates call them."""
    return {each.__name__.lstrip("_"): each for each in functions}


def broken(text: str, width: int | None, indent: str = "") -> list[str]:
    """Break a sentence between words where a terminal has no room for it; None is the width of no terminal."""
    line = indent + text
    if width is None or len(line) <= width:
        return [line]
    return wrap(
        line, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False, drop_whitespace=True
    )
