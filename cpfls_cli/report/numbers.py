"""Numbers and phrases as people read them: as many digits as are known, no false zeros, no false ones."""

from __future__ import annotations

import math

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
