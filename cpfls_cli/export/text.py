"""Text from anywhere, made fit for comments, names and literals of source code."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence

from cpfls_cli.errors import InputError

_COLUMNS = 112


def comment_lines(paragraphs: Sequence[str]) -> list[str]:
    """Break text into lines for a comment of C or Python.

    Parameters
    ----------
    paragraphs : sequence of str
        Of any origin: what could end a comment, or start one, is taken apart.

    Returns
    -------
    list of str
        Each starts with a space, or is empty.
    """
    lines: list[str] = []
    for paragraph in paragraphs:
        safe = comment_text(paragraph)
        lines += [
            f" {line}" for line in textwrap.wrap(safe, _COLUMNS, subsequent_indent="  ", break_on_hyphens=False)
        ] or [""]
    return lines


def comment_text(text: str) -> str:
    """Make text fit for a comment: printable ASCII in one line, without the signs that comments end and begin with."""
    ascii_only = re.sub(r"[^\x20-\x7e]", "?", text).replace("\\", "|")
    # Two question marks would begin a trigraph, which C99 reads before it knows of comments.
    single = re.sub(r"\?{2,}", "?", ascii_only)
    return re.sub(r"(?<=\*)/", " /", re.sub(r"/(?=\*)", "/ ", single))


def literal_text(text: str) -> str:
    """Make text fit for a string literal of C: letters, digits and a few signs."""
    return re.sub(r"[^A-Za-z0-9 .,:;_+()=-]", "_", text)


def identifier(stem: str) -> str:
    """Make a prefix for the names in source code out of the name of a file.

    Returns
    -------
    str
        Letters, digits and underscores, a letter first.
    """
    cleaned = re.sub(r"[^A-Za-z0-9]+", "_", stem).strip("_")
    return cleaned if cleaned[:1].isalpha() else f"model_{cleaned}".rstrip("_")


def checked_identifier(name: str) -> str:
    """Refuse a prefix that is no identifier.

    Raises
    ------
    InputError
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise InputError(
            f"--name {name or repr(name)}: is no identifier; use letters, digits and underscores, a letter first"
        )
    return name
