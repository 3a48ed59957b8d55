"""Measured values rounded to what is known of them, so that the ends of an interval can be told apart."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cpfls_cli.report.numbers import number

_DIGITS = 4
_SMALLEST, _LARGEST = -4, 6
"""Powers of ten between which no power is written."""

_FEWEST, _MOST = 2, 15
"""Significant digits; a number holds fifteen."""


def with_interval(value: float, low: float, high: float) -> tuple[str, str, str]:
    """Write a value and the ends of its interval alike, half the width of the interval to two digits.

    Returns
    -------
    tuple of str
        Each with ``-`` for minus and ``e`` for a power of ten that is the same for all; four digits each where the
        interval is not known or has no width.
    """
    width = high - low
    if not (math.isfinite(width) and math.isfinite(value) and width > 0):
        return _alone(value), _alone(low), _alone(high)
    first, second, third = _alike((value, low, high), 0.5 * width)
    return first, second, third


def printed(text: str) -> str:
    """Write a number of `with_interval` as in print.

    Returns
    -------
    str
        With a minus sign, and ``× 10`` with a raised power.
    """
    mantissa, _, power = text.partition("e")
    raised = f" × 10{power.translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}" if power else ""
    return mantissa.replace("-", "−") + raised


def _alike(values: Sequence[float], error: float) -> list[str]:
    largest = math.floor(math.log10(max(map(abs, values))))
    last = math.floor(math.log10(error)) - 1
    digits = min(max(largest - last + 1, _FEWEST), _MOST)
    power = 0 if _SMALLEST <= largest < _LARGEST else largest
    decimals = max(digits - 1 - (largest - power), 0)
    tail = f"e{power}" if power else ""
    return [f"{_signed(each / 10.0**power, decimals)}{tail}" for each in values]


def _signed(value: float, decimals: int) -> str:
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0 else text


def _alone(value: float) -> str:
    if not np.isfinite(value):
        return number(value).replace("−", "-")
    return f"{value:.{_DIGITS}g}" if value else "0"
