"""Words of messages, alike in all rooms."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def joined(words: Iterable[str], last: str = "and") -> str:
    """Join words to a phrase, without repeating one."""
    *others, final = dict.fromkeys(words)
    return f"{', '.join(others)} {last} {final}" if others else final


def did_you_mean(name: str, known: Iterable[str], otherwise: str, *, most: int = 1, cutoff: float = 0.4) -> str:
    """Ask whether one of the known names was meant that are most alike; say something else where none is."""
    near = get_close_matches(name, list(known), n=most, cutoff=cutoff)
    return f"did you mean {' or '.join(near)}?" if near else otherwise
