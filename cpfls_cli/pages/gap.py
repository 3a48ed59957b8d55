"""The gap on a page: channels, effects and their numbers in words, its size before and after."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.registry import CATALOGUE, VEHICLE_NUMBERS
from cpfls_cli.gap.settings import CLEAR
from cpfls_cli.report.canvas import BASELINE, GREY, Axes, Drawn, Figure, legend_over, logarithmic, style_of
from cpfls_cli.report.content import UNKNOWN, number, printed, whole_percent, with_interval
from cpfls_cli.words import by_name, spoken

if TYPE_CHECKING:
    from cpfls_cli.gap.naming.results import Estimate, GapChange, NamedEffect


_CHANNEL_WORDS = {
    "torque x": "torque about x (roll)",
    "torque y": "torque about y (pitch)",
    "torque z": "torque about z (yaw)",
    "force x": "force along x (forward)",
    "force y": "force along y (left)",
    "force z": "force along z (up)",
}

MEASURED: dict[str, Any] = {"color": "black", "linestyle": "-", "linewidth": 2.6}
"""Wide, so that a thin line on top of it leaves an edge."""

BEFORE: dict[str, Any] = {**BASELINE, "linewidth": 1.4, "zorder": 3}
AFTER: dict[str, Any] = {"color": style_of(1)["color"], "linestyle": "-", "linewidth": 1.2, "zorder": 2.5}

_TURNS = {"x": "roll", "y": "pitch", "z": "yaw"}
_MARKS = 12
_ROOM = 3.0
_LEAST = 0.1
_SQUARE: dict[str, Any] = {"marker": "s", "markerfacecolor": "white", "markersize": 7, "linestyle": "none"}
_GIVEN: dict[str, Any] = {"color": GREY, **_SQUARE}
_SHRUNK: dict[str, Any] = {"color": AFTER["color"], "marker": "o", "markersize": 7, "linestyle": "none"}


def channel_words(channel: int | str) -> str:
    """Say what a channel is, by its index or name."""
    name = channel if isinstance(channel, str) else tuple(_CHANNEL_WORDS)[channel]
    return _CHANNEL_WORDS.get(name, name)


def channel_name(channel: str) -> str:
    """Name a channel in a table: `pitch torque`, `force z`."""
    kind, _, axis = channel.partition(" ")
    return f"{_TURNS[axis]} torque" if kind == "torque" else channel


def channel_unit(channel: str) -> str:
    """Give the unit of a channel."""
    return "N\N{NO-BREAK SPACE}m" if channel.startswith("torque") else "N"


def marked(points: int) -> dict[str, Any]:
    """Put circles on the curve after, of so many points, so that it differs from the others without colour."""
    every = max(1, points // _MARKS)
    return {**AFTER, "marker": "o", "markersize": 3.6, "markerfacecolor": "white", "markevery": every}


def keep_in_view(axes: Axes, shown: Sequence[Array], astray: Array) -> None:
    """Let a curve that runs away leave the picture: it would flatten those that must be seen in full."""
    if leaves_view(shown, astray):
        axes.set_ylim(*_view(shown))


def leaves_view(shown: Sequence[Array], astray: Array) -> bool:
    """Tell whether a curve runs away from those that must be seen in full."""
    low, high = _view(shown)
    return bool(astray.min() < low or astray.max() > high)


def _view(shown: Sequence[Array]) -> tuple[float, float]:
    low, high = float(min(curve.min() for curve in shown)), float(max(curve.max() for curve in shown))
    room = _ROOM * max(high - low, 1e-12)
    return low - room, high + room


def hidden_gaps(gap: GapChange) -> bool:
    """Tell whether gaps are smaller than the figure of them shows."""
    return bool((np.fmin(gap.before_floors[gap.known], gap.after_floors[gap.known]) < _LEAST).any())


def sizes_drawn(gap: Callable[[Any], GapChange]) -> Drawn:
    """Make the figure of the gap of each channel on a logarithmic scale, with the noise floor."""
    return Drawn(
        "Gap of each channel before and after, in noise floors",
        lambda r: 1.0 + 0.34 * len(gap(r).known),
        lambda r, figure: _draw_sizes(gap(r), figure),
        lambda r: gap(r).known,
    )


def _draw_sizes(gap: GapChange, figure: Figure) -> None:
    channels = [channel_words(index) for index in gap.known]
    before, after = gap.before_floors[gap.known], gap.after_floors[gap.known]
    axes = figure.subplots()
    rows = np.arange(len(channels))[::-1]
    start, end = (np.maximum(values, _LEAST) for values in (before, after))
    axes.hlines(rows, np.fmin(start, end), np.fmax(start, end), color="#bbbbbb", linewidth=2, zorder=1)
    axes.plot(start, rows, label="before", zorder=2, **_GIVEN)
    axes.plot(end, rows, label="after", zorder=3, **_SHRUNK)
    axes.axvspan(0.8 * _LEAST, CLEAR, color="#eeeeee", label="within noise", zorder=0)
    axes.axvline(1.0, color="black", linewidth=1.1, linestyle=(0, (4, 2)), label="noise floor", zorder=1)
    axes.set_yticks(rows, channels)
    axes.set_ylim(-0.6, len(channels) - 0.4)
    axes.grid(visible=False, axis="y")
    largest = float(np.nanmax([*before, *after, 1.0]))
    axes.set_xlim(0.8 * _LEAST, 1.6 * max(largest, 3.0))
    logarithmic(axes, _LEAST, 1.6 * largest)
    axes.set_xlabel("gap, noise floors")
    legend_over(figure, axes)


_RELATIVE = "_error"
_SHORT = {"inertia_x": "Ixx", "inertia_y": "Iyy", "inertia_z": "Izz", "thrust_scale": "thrust"}
_NUMBERS = {
    "inertia": "moment of inertia about",
    "coupling": "coupling of rates about",
    "reference": "offset of the point that the log follows along",
}


def effect_title(name: str) -> str:
    """Say what people call an effect."""
    return CATALOGUE[name].title if name in CATALOGUE else name.replace("_", " ")


def titles(names: Iterable[str]) -> list[str]:
    """Say what people call effects."""
    return [effect_title(name) for name in names]


def unit_words(unit: str) -> str:
    """Write a unit as people do, with raised powers; ``1`` is none."""
    return "" if unit == "1" else unit.replace("^2", "²").replace("^3", "³")


def share_words(share: float) -> str:
    """Write a share in whole per cent; what rounding alone would make nothing or all of it is not called so."""
    return whole_percent(share).replace("> ", "more than ").replace("< ", "less than ")


def number_words(effect: NamedEffect) -> str:
    """Write the numbers of an effect with their intervals."""
    relative = effect.name.endswith(_RELATIVE)
    return "; ".join(_relative(effect.name, each) if relative else _coefficient(each) for each in effect.numbers)


def _coefficient(coefficient: Estimate) -> str:
    """Write a value with its interval and unit; a power of ten that all three share is written once."""
    unit = unit_words(coefficient.unit)
    words = with_interval(coefficient.value, coefficient.low, coefficient.high)
    powers = {text.partition("e")[2] for text in words}
    power = f"e{powers.pop()}" if len(powers) == 1 and "" not in powers else ""
    value, low, high = (printed(text.removesuffix(power)) for text in words)
    return f"{spoken(coefficient.name)} = {value} [{low}, {high}]{printed(power)}{' ' if unit else ''}{unit}"


def _relative(effect: str, number: Estimate) -> str:
    """Write an error of a number of the vehicle as people do, `Izz +24 % [+20, +28]`."""
    name, value, low, high = _error_words(effect, number)
    return f"{name} {value} % [{low}, {high}]"


def wrong_numbers(effects: Iterable[NamedEffect]) -> dict[str, str]:
    """Give the numbers of the vehicle that a verdict calls wrong, each with its error, `Izz +24 %`, by identifier."""
    named = [effect for effect in effects if effect.name == VEHICLE_NUMBERS.name]
    numbers = [(effect, number) for effect in named for number in effect.numbers]
    words = ((number.name, _error_words(effect.name, number)) for effect, number in numbers)
    return {name: f"{short} {value} %" for name, (short, value, *_) in words}


def _error_words(effect: str, number: Estimate) -> list[str]:
    """Name a number of the vehicle as people do, and write its error and the interval in per cent, with signs."""
    name = _SHORT.get(number.name, effect.removesuffix(_RELATIVE).replace("_", " "))
    # Flights show no more of it than that.
    name += " over yaw torque" if number.name == "inertia_z" else ""
    numbers = with_interval(*(100.0 * each for each in (number.value, number.low, number.high)))
    signed = (text if text.startswith("-") or text == UNKNOWN or not float(text) else f"+{text}" for text in numbers)
    return [name, *map(printed, signed)]


def measured(number: Any, factor: float = 1.0) -> list[str]:
    """Write a value, and its interval or ``—``, with the digits that the width of the interval leaves."""
    ends = (factor * each for each in (number.value, number.low, number.high))
    first, *interval = (printed(text) for text in with_interval(*ends))
    known = np.isfinite([number.low, number.high]).any()
    return [first, " … ".join(interval) if known else UNKNOWN]


def _range(low: float, high: float) -> str:
    return f"{number(low, 3)} … {number(high, 3)}" if np.isfinite([low, high]).any() else UNKNOWN


def possible(number: Estimate) -> str:
    """Write the range that is physically possible."""
    return _range(*number.plausible)


def meaning(effect: str, coefficient: str) -> str:
    """Name a coefficient of an effect with what it means."""
    if effect not in CATALOGUE:
        return coefficient
    known = CATALOGUE[effect]
    words = {entry.name: entry.meaning for entry in (known.exact or known).numbers}.get(coefficient)
    return f"{coefficient}: {words}" if words else coefficient


def vehicle_number(name: str) -> str:
    """Say what a number of the vehicle is."""
    kind, _, axis = name.rpartition("_")
    words = f"{_NUMBERS[kind]} {axis}" if kind in _NUMBERS else name.replace("_", " ")
    return f"{_SHORT[name]}, {words}" if kind == "inertia" else words


def intervals_drawn(effects: Callable[[Any], Sequence[NamedEffect]]) -> Drawn:
    """Make the figure of where each coefficient lies between the least and the largest possible value."""

    def rows(r: Any) -> list[tuple[NamedEffect, Estimate]]:
        """List numbers whose range is known, from below, as the axis counts."""
        every = [(effect, number) for effect in effects(r) for number in effect.numbers]
        return [each for each in every if np.isfinite([*each[1].plausible, each[1].value]).all()][::-1]

    return Drawn(
        "Coefficients within their possible ranges",
        lambda r: 0.75 + 0.3 * len(rows(r)),
        lambda r, figure: _draw_intervals(rows(r), figure),
        rows,
    )


def _draw_intervals(shown: Sequence[tuple[NamedEffect, Estimate]], figure: Figure) -> None:
    axes = figure.subplots()
    for row, (_, own) in enumerate(shown):
        low, high = own.plausible
        with np.errstate(divide="ignore", invalid="ignore"):
            placed = (np.array([own.value, own.low, own.high]) - low) / (high - low)
        _draw_row(axes, row, placed)
    axes.set_yticks(range(len(shown)), [f"{effect.name}  {own.name}" for effect, own in shown])
    right = axes.twinx()
    axes.set_ylim(-0.6, len(shown) - 0.4)
    right.set_ylim(axes.get_ylim())
    right.set_yticks(range(len(shown)), [f"{possible(own)} {unit_words(own.unit)}" for _, own in shown])
    right.tick_params(length=0)
    right.grid(visible=False)
    axes.set_xlim(-0.03, 1.03)
    axes.set_xticks([0.0, 1.0], ["least possible", "largest possible"])
    axes.grid(visible=False)


def _draw_row(axes: Axes, row: int, placed: Array) -> None:
    value, low, high = placed
    axes.hlines(row, 0.0, 1.0, color="#cccccc", linewidth=5, zorder=0)
    if np.isfinite(low) and np.isfinite(high):
        axes.hlines(row, np.clip(low, 0, 1), np.clip(high, 0, 1), color="black", linewidth=2.4, zorder=1)
    axes.plot([np.clip(value, 0.0, 1.0)], [row], "o", color=AFTER["color"], markersize=6, zorder=2)


WORDS: Mapping[str, Any] = {
    **by_name(channel_name, channel_unit, channel_words, effect_title, titles, unit_words, share_words, number_words),
    **by_name(measured, possible, meaning, vehicle_number),
}
"""What templates know of channels, effects and their numbers."""
