"""What rounding may not decide: numbers that differ by less than a computation resolves are equal.

Another processor adds in another order, and so does another version of a library: what is computed differs in its last
digits. Where two numbers are equal but for that, `<`, `min` and `sorted` would give every machine another word, name or
model. What decides between computed numbers asks here: a tie is a tie, and the first of those tied is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

import numpy as np

from cpfls_cli.arrays import Array, BoolArray

ROUNDING = 1e-8
"""Share of two numbers by which they may differ and are equal. Machines agree within 5e-10 of a condition number of
6e8, of all that is computed here what loses most digits; and nobody reads more than five."""

_MOST_DIGITS = 8  # More of them only rounding decides.

Item = TypeVar("Item")


def less(left: Array | float, right: Array | float, scale: Array | float = 0.0) -> BoolArray:
    """Tell whether numbers are less than others by more than rounding; false where either is NaN.

    Parameters
    ----------
    left, right : float or array
    scale : float or array
        Size of what they were computed from, where that is larger: a difference keeps the rounding of what it is of.

    Returns
    -------
    array of bool
        Of the shape that the arguments have together, that of a number for numbers.
    """
    return np.asarray(left + _margin(left, right, scale) < right)


def at_most(left: Array | float, right: Array | float, scale: Array | float = 0.0) -> BoolArray:
    """Tell whether numbers are less than others or tied with them; arguments and result are those of `less`."""
    return np.asarray(left <= right + _margin(left, right, scale))


def tied(left: Array, right: Array) -> BoolArray:
    """Tell which numbers are equal up to rounding; false where either is NaN."""
    return at_most(left, right) & at_most(right, left)


def _margin(left: Array | float, right: Array | float, scale: Array | float) -> Array:
    size = np.maximum(np.maximum(np.abs(left), np.abs(right)), scale)
    # What is infinite is not rounded.
    return ROUNDING * np.where(np.isfinite(size), size, 0.0)


def apart(first: float, second: float, digits: int = 3) -> tuple[str, str]:
    """Write two numbers that a sentence compares, with as many more digits as show that they differ."""
    written = (_written(first, digits), _written(second, digits))
    same = written[0] == written[1] and digits < _MOST_DIGITS
    return apart(first, second, digits + 1) if same else written


def _written(value: float, digits: int) -> str:
    text = f"{value:.{digits}g}"
    # Up to 10⁹ zeros read better than a power of ten.
    return f"{float(text):.0f}" if "e+0" in text else text


def levelled(values: Array) -> Array:
    """Give numbers that are equal up to rounding one value, the least of theirs, so that comparing them is exact.

    Parameters
    ----------
    values : array, shape (n,)
        Infinite ones and NaN stay.

    Returns
    -------
    array, shape (n,)
    """
    order = np.argsort(values, kind="stable")
    ascending = values[order]
    first = np.ones(len(values), dtype=np.bool_)
    first[1:] = less(ascending[:-1], ascending[1:]) | np.isnan(ascending[1:])
    level = np.empty_like(ascending)
    level[order] = ascending[first][np.cumsum(first) - 1]
    return level


def smallest(items: Iterable[Item], key: Callable[[Item], float]) -> Item:
    """Give the item of the smallest number, the first of those tied."""
    return ascending(items, key)[0]


def largest(items: Iterable[Item], key: Callable[[Item], float]) -> Item:
    """Give the item of the largest number, the first of those tied."""
    return ascending(items, lambda item: -key(item))[0]


def ascending(items: Iterable[Item], key: Callable[[Item], float]) -> list[Item]:
    """Sort items by a number; those tied stay in their order."""
    listed = list(items)
    levels = levelled(np.array([key(item) for item in listed], dtype=np.float64))
    return [listed[index] for index in np.argsort(levels, kind="stable")]
