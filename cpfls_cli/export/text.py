"""Text, names and numbers as source code: text from anywhere made fit for comments and literals, tables of numbers."""

from __future__ import annotations

import json
import math
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError

_COMMENT_COLUMNS, _NUMBER_COLUMNS = 112, 116
_LONGEST_NAME = 48
"""Letters of a prefix: strict compilers of C99 distinguish names by their first 63."""


def comment_lines(paragraphs: Sequence[str]) -> list[str]:
    """Break text of any origin into lines for a comment of C or Python; what could end or start one is taken apart."""
    lines: list[str] = []
    for paragraph in paragraphs:
        safe = comment_text(paragraph)
        lines += [
            f" {line}" for line in textwrap.wrap(safe, _COMMENT_COLUMNS, subsequent_indent="  ", break_on_hyphens=False)
        ] or [""]
    return lines


def commented(mark: str, paragraphs: Sequence[str]) -> list[str]:
    """Write paragraphs as lines of a comment that each begin with a mark."""
    return [f"{mark}{line}".rstrip() for line in comment_lines(paragraphs)]


def comment_text(text: str) -> str:
    """Make text fit for a comment: printable ASCII in one line, without the signs that comments end and begin with."""
    ascii_only = re.sub(r"[^\x20-\x7e]", "?", text).replace("\\", "|")
    # Two question marks would begin a trigraph, which C99 reads before it knows of comments.
    single = re.sub(r"\?{2,}", "?", ascii_only)
    return re.sub(r"(?<=\*)/", " /", re.sub(r"/(?=\*)", "/ ", single))


def xml_text(paragraphs: Sequence[str]) -> str:
    """Break text into the lines of a comment of XML, which no two hyphens may stand in."""
    lines = [line.replace("--", "- -").replace("--", "- -").rstrip("-") for line in comment_lines(paragraphs)]
    return "\n".join(["", *lines, ""])


def literal_text(text: str) -> str:
    """Make text fit for a string literal of C: letters, digits and a few signs."""
    return re.sub(r"[^A-Za-z0-9 .,:;_+()=-]", "_", text)


def identifier(stem: str) -> str:
    """Make a prefix for names in source code of a file's name: letters, digits and underscores, a letter first."""
    cleaned = re.sub(r"[^A-Za-z0-9]+", "_", stem).strip("_")
    named = cleaned if cleaned[:1].isalpha() else f"model_{cleaned}"
    return named[:_LONGEST_NAME].rstrip("_")


def checked_identifier(name: str) -> str:
    """Refuse a prefix that is no identifier."""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise InputError(
            f"--name {name or repr(name)}: not an identifier; use letters, digits and underscores, a letter first"
        )
    if len(name) > _LONGEST_NAME:
        raise InputError(f"--name {name[:8]}...: has {len(name)} letters; at most {_LONGEST_NAME}")
    return name


def number(value: float, form: str = "") -> str:
    """Write a number as a format of Python says, or with as many digits as bring it back; never as -0."""
    return f"{value:z{form}}" if form else repr(float(value) + 0.0)


def c_row(values: Iterable[float]) -> str:
    """Write numbers for an array of C."""
    return ", ".join(f"R({number(value)})" for value in values)


def c_rows(values: Array, labels: Sequence[str]) -> str:
    """Write the rows of a table of C, each in braces, under a comment that names it."""
    return "\n".join(
        f"    /* {label} */\n    {{\n{filled(c_row(row), 8)}\n    }},"
        for label, row in zip(labels, values, strict=True)
    )


def python_rows(values: Array, indent: int) -> str:
    """Write a table of one row or several as nested lists of Python."""
    if values.ndim == 1:
        return filled("[" + ", ".join(number(value) for value in values) + "]", indent)
    rows = ",\n".join(python_rows(row, indent + 4) for row in values)
    return f"{' ' * indent}[\n{rows},\n{' ' * indent}]"


def filled(text: str, indent: int) -> str:
    """Break a list of numbers into indented lines."""
    blank = " " * indent
    wide = {"break_long_words": False, "break_on_hyphens": False}
    return textwrap.fill(text, _NUMBER_COLUMNS, initial_indent=blank, subsequent_indent=blank + " ", **wide)  # type: ignore[arg-type]


def strict_json(document: Mapping[str, Any]) -> str:
    """Write a document as strict JSON in ASCII; null in place of what is not finite."""
    return f"{_written(document, 0)}\n"


def _written(value: Any, depth: int) -> str:
    """Write a value: mappings and lists of them over many lines, lists of numbers in one."""
    blank = " " * (depth + 1)
    if isinstance(value, Mapping) and value:
        entries = [f"{blank}{json.dumps(_text(str(k)))}: {_written(v, depth + 1)}" for k, v in value.items()]
        return "{\n" + ",\n".join(entries) + "\n" + " " * depth + "}"
    if isinstance(value, list | tuple) and any(isinstance(item, Mapping | str) for item in value):
        return "[\n" + ",\n".join(blank + _written(item, depth + 1) for item in value) + "\n" + " " * depth + "]"
    return in_json(value)


def yaml_text(comment: Sequence[str], document: Mapping[str, Any]) -> str:
    """Write a document as YAML that any reader takes, below a comment: mappings in lines, lists of numbers in one."""
    return "\n".join([*commented("#", comment), *_yaml_lines(document, ""), ""])


def _yaml_lines(document: Mapping[str, Any], blank: str) -> Iterator[str]:
    for key, value in document.items():
        if isinstance(value, Mapping) and value:
            yield f"{blank}{json.dumps(key)}:"
            yield from _yaml_lines(value, f"{blank}  ")
        else:
            # Readers of YAML 1.1 take 1e-05 for text.
            written = re.sub(r"(?<![\w.\"])(-?\d+)e([-+]\d+)", r"\1.0e\2", in_json(value))
            yield f"{blank}{json.dumps(key)}: {written}"


def in_json(value: Any) -> str:
    """Write numbers, lists of them or text as JSON; null in place of what is not finite."""
    return json.dumps(_plain(value), allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, float):
        return value + 0.0 if math.isfinite(value) else None
    return _text(value) if isinstance(value, str) else value


def _text(text: str) -> str:
    """Replace halves of characters, which names of files may hold and strict readers refuse."""
    return text.encode("utf-8", "replace").decode("utf-8")
