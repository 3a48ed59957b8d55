"""Tables of numbers as source code."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

from cpfls_cli.arrays import Array
from cpfls_cli.regressor.structure import Block, ModelStructure

_COLUMNS = 116


def number(value: float) -> str:
    """Write a number with as many digits as bring it back."""
    return repr(float(value))


def c_row(values: Iterable[float]) -> str:
    """Write numbers for an array of C."""
    return ", ".join(f"R({number(value)})" for value in values)


def c_rows(values: Array, labels: Sequence[str]) -> str:
    """Write the rows of a table of C, each in braces, under a comment that names it.

    Parameters
    ----------
    values : array, shape (rows, columns)
    labels : sequence of str
        One for each row.
    """
    return "\n".join(
        f"    /* {label} */\n    {{\n{filled(c_row(row), 8)}\n    }},"
        for label, row in zip(labels, values, strict=True)
    )


def python_rows(values: Array, indent: int) -> str:
    """Write a table as nested lists of Python.

    Parameters
    ----------
    values : array, shape (columns,) or (rows, columns)
    indent : int
        Spaces before each line.
    """
    if values.ndim == 1:
        return filled("[" + ", ".join(number(value) for value in values) + "]", indent)
    rows = ",\n".join(python_rows(row, indent + 4) for row in values)
    return f"{' ' * indent}[\n{rows},\n{' ' * indent}]"


def filled(text: str, indent: int) -> str:
    """Break a list of numbers into lines.

    Parameters
    ----------
    indent : int
        Spaces before each line.
    """
    blank = " " * indent
    wide = {"break_long_words": False, "break_on_hyphens": False}
    return textwrap.fill(text, _COLUMNS, initial_indent=blank, subsequent_indent=blank + " ", **wide)  # type: ignore[arg-type]


def rule_labels(block: Block, structure: ModelStructure) -> list[str]:
    """Name the rules of an inertia function by their places along its inputs."""
    names = [("roll", "pitch")[angle] for angle in block.function.inputs]
    last = rules_along(structure, block.partitions[-1])
    if len(names) == 1:
        return [f"{names[0]} {rule}" for rule in range(block.rules)]
    return [f"{names[0]} {rule // last}, {names[1]} {rule % last}" for rule in range(block.rules)]


def rules_along(structure: ModelStructure, partition: int) -> int:
    """Count the rules along one input.

    Parameters
    ----------
    partition : int
        Index.
    """
    functions = structure.partitions[partition].functions
    return max(functions - 1, 1) if structure.circular else functions
