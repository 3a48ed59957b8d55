"""The page of frequency responses: where a model answers its rotors as the vehicle does, and where it is off."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.artifacts.replay import played_words
from cpfls_cli.artifacts.response import NOT_ACCEPTABLE, NOT_JUDGED, ResponseRecord
from cpfls_cli.pages.gap import MEASURED
from cpfls_cli.pages.sensors import contradicted
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import (
    BASELINE,
    GREY,
    HELD,
    band,
    legend_above,
    legend_over,
    logarithmic,
    plain_ticks,
    plot,
    style_of,
)
from cpfls_cli.report.content import Block, Box, Cell, Facts, Heading, Plot, Table, Text, in_short
from cpfls_cli.report.numbers import number, sentence
from cpfls_cli.response.mismatch import ACCEPTABLE, COHERENT, GOOD, Deviation
from cpfls_cli.words import joined

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ANGULAR = "torque of the rotors to angular acceleration"
_FOLLOWERS = (" rate", " angle")
_BEHIND = 45.0
"""Degrees: a first-order lag is so far behind at the frequency that is the inverse of its time."""
_KINDS = {"thrust": "thrust of the rotors to specific force along z", "rotor speed": "command of the rotors to speed"}
_UNITS = {"thrust": "m/s² per N", "rotor speed": "rad/s per rad/s"}
_WORDS = {"good": "good", "acceptable": "acceptable", NOT_ACCEPTABLE: "not acceptable", NOT_JUDGED: "not judged"}
_INSTRUMENTS = {
    "repeats": "the same path flown again: what comes again is no gust",
    "setpoints": "logged setpoints that know nothing of the gusts",
    "none": "none",
}
_LOOP = "not judged: these flights show the loop, not the vehicle"
_REMEDY = (
    "Nothing in these flights moves the vehicle independently of the gusts. The curves are those of vehicle and "
    "autopilot together, and so is J; fly the same path several times, or log the setpoints of pilot or mission."
)
_MOVED_BY = {"repeats": "the paths that are flown again", "setpoints": "the logged setpoints"}
_AUDIBLE_DB, _AUDIBLE_DEG = 1.0, 7.6
"""Differences that are told: with these J is 20 each."""
_NAMED = 4
"""Flights that are named in a caption; more stand beside it."""
_TICKS_HZ = tuple(digit * 10.0**power for power in range(-2, 3) for digit in (1, 2, 5))
_ROOM_DB, _ROOM_DEG = 12.0, 45.0
_MODEL: dict[str, Any] = {**style_of(1), "linewidth": 1.6, "zorder": 3}
_UNEXCITED: dict[str, Any] = {"color": GREY, "linewidth": 0.8, "zorder": 1.5}


def answer(response: Source[ResponseRecord], index: int = 1) -> Iterator[Block]:
    """Say in which responses and at which frequencies a model is right, and how far off it is where it is not."""
    record = response.record
    yield from in_short(response_box(record), len((record.contradiction or ())[1:]), "each response in words")
    yield from _grounds(response.record, index)


def _grounds(record: ResponseRecord, index: int) -> Iterator[Block]:
    yield _table(record, index)
    yield from (Text(words, "warning") for words in record.warning)


def response_box(record: ResponseRecord) -> Box:
    """Say first whether the model answers as the vehicle does, then response by response."""
    told = [sentence(_told(record, index)) for index in range(len(record.name))]
    words = {name: record.word(index) for index, name in enumerate(record.name)}
    judged = [name for name, word in words.items() if word != NOT_JUDGED]
    off = [name for name in judged if words[name] == NOT_ACCEPTABLE]
    left = [each for row, each in enumerate(record.name) if words[each] == NOT_JUDGED and record.is_modelled(row)]
    open_ = f"; not judged: {joined(left)}" if left else ""
    name = played_words(record.played)
    if record.contradiction:
        others = map(sentence, record.contradiction[1:])
        return Box("RESPONSE", contradicted(record.contradiction[0]), [*others, *told], "warning")
    if not record.has_instruments:
        return Box("RESPONSE", sentence(f"{name}: {_LOOP}"), [_REMEDY, *told], "warning")
    if not judged:
        why = f"{_moved_by(record)} move no response clearly, and what moves by itself is of the loop"
        return Box("RESPONSE", sentence(f"{name} cannot be judged: {why}"), told, "warning")
    if off:
        return Box(
            "RESPONSE", sentence(f"{name} does not answer as the vehicle does: {joined(off)}{open_}"), told, "warning"
        )
    title = sentence(f"{name} answers its rotors as the vehicle does: {joined(judged)}{open_}")
    return Box("RESPONSE", title, told, "note" if left else "good")


def _told(record: ResponseRecord, index: int) -> str:
    """Say of one response how good the model is and where."""
    name, word = record.name[index], record.word(index)
    low, high = record.band[index].tolist()
    if not np.isfinite(low):
        return f"{name}: not judged, nowhere {_clear(record)}"
    where = span_words(low, high)
    if not np.isfinite(record.cost[index]):
        return f"{name}: {_behind(record, index)} {where}"
    parts = record.deviations(index)
    right = len(parts) == 1 and parts[0].right
    details = "right throughout" if right else ", ".join(map(deviation_words, parts))
    alone = "of the loop: " if not record.has_instruments else f"not moved by {_moved_by(record)}, so of the loop: "
    judged = f"{word_of(word)}, " if record.is_of_vehicle(index) else alone
    return f"{name}: {judged}J = {number(float(record.cost[index]), 3)} {where}; {details}"


def _moved_by(record: ResponseRecord) -> str:
    """Say what moves the vehicle and knows nothing of gusts; of a newer program that is what it calls it."""
    return _MOVED_BY.get(record.instruments, record.instruments)


def _behind(record: ResponseRecord, index: int) -> str:
    """Say from which frequency on a response without a model lags."""
    low, high = record.band[index].tolist()
    inside = (record.frequency >= low) & (record.frequency <= high) & np.isfinite(record.measured.phase[index])
    phase = np.unwrap(record.measured.phase[index][inside], period=360)
    late = np.flatnonzero(phase < -_BEHIND)
    if not len(late):
        return f"follows what is asked less than {_BEHIND:g}° behind"
    around = slice(max(int(late[0]) - 1, 0), int(late[0]) + 1)
    place = np.interp(_BEHIND, -phase[around], np.log(record.frequency[inside][around]))
    return f"{_BEHIND:g}° behind what is asked at {number(float(np.exp(place)), 2)} Hz, seen"


def word_of(word: str) -> str:
    """Say how far to trust a model by a response; a word that a newer program wrote stands as it is."""
    return _WORDS.get(word, word)


def span_words(low: float, high: float) -> str:
    """Say from which frequency to which, Hz."""
    return f"from {number(low, 2)} to {number(high, 2)} Hz"


def deviation_words(part: Deviation) -> str:
    """Say how far a model is off over a stretch of frequencies."""
    where = span_words(part.low, part.high)
    if part.right:
        return f"right {where}"
    decibels, said = 20 * np.log10(part.gain), []
    if abs(decibels) >= _AUDIBLE_DB:
        strong = decibels > 0
        said.append(f"{number(part.gain if strong else 1 / part.gain, 2)} times too {'strong' if strong else 'weak'}")
    if abs(part.phase) >= _AUDIBLE_DEG:
        # A difference of phases alone is that of a delay or a lag.
        delay = 1e3 * abs(part.phase) / 360 / float(np.sqrt(part.low * part.high))
        of_delay = "" if said else f" ({number(delay, 2)} ms)"
        said.append(f"{number(abs(part.phase), 2)}° too {'late' if part.phase < 0 else 'early'}{of_delay}")
    return f"{' and '.join(said) or 'off'} {where}"


def _table(record: ResponseRecord, index: int) -> Table:
    rows: list[list[str | Cell]] = []
    for row, name in enumerate(record.name):
        word, (low, high) = record.word(row), record.band[row].tolist()
        judged = (record.frequency >= low) & (record.frequency <= high)
        rows.append(
            [
                name,
                number(float(record.cost[row]), 3),
                Cell(word_of(word), "warning" if word == NOT_ACCEPTABLE else "plain"),
                f"{number(low, 2)} to {number(high, 2)}" if judged.any() else "—",
                _median(record.coherence[row][judged]),
                _median(100 * record.random_error[row][judged]),
            ]
        )
    flown = joined(record.flown) if len(record.flown) <= _NAMED else f"{len(record.flown)} flights"
    caption = f"Frequency responses of {flown} and of the model along the same flights."
    legend = (
        f"J adds up differences in decibels and degrees over the band of {_clear(record)} (Tischler and Remple): up to "
        f"{GOOD:g} is good, up to {ACCEPTABLE:g} acceptable."
    )
    header = ("Response", "Mismatch J", "The model", "Band, Hz", "Coherence", "Random error, %")
    return Table(f"response-{index}", caption, header, rows, frozenset({0, 2}), legend=legend)


def _clear(record: ResponseRecord) -> str:
    """Say what a response has to have to be judged."""
    averaged = ", or of a random error of less than 10 %" if record.has_instruments else ""
    return f"a coherence above {COHERENT:g}{averaged}"


def _median(values: Array) -> str:
    known = values[np.isfinite(values)]
    return number(float(np.median(known)), 2) if len(known) else "—"


def response_blocks(response: Source[ResponseRecord], index: int) -> Iterator[Block]:
    """Show frequency responses."""
    record = response.record
    yield Heading(response.label)
    yield Facts(
        [
            ("The model", played_words(record.played)),
            ("Flights", joined(record.flown)),
            ("Instruments", _INSTRUMENTS.get(record.instruments, record.instruments)),
        ]
    )
    yield from _grounds(record, index)
    for row, name in enumerate(record.name):
        yield bode_figure(f"response-{name.replace(' ', '-')}-{index}", record, row)


def bode_figure(name: str, record: ResponseRecord, row: int) -> Plot:
    """Draw one response: magnitude, phase and coherence over the logarithm of the frequency."""
    shown, title = record.coherent[row], record.name[row]
    kind, unit = _kind(title)

    def draw(figure: Figure) -> None:
        upper, middle, lower = figure.subplots(3, 1, sharex=True, height_ratios=(3, 3, 2))
        _curves(upper, record, row, "magnitude", 20 * np.log10(1 + 2 * _error(record, row, shown)))
        _curves(middle, record, row, "phase", np.degrees(2 * _error(record, row, shown)))
        upper.set_ylabel(f"dB ({unit})")
        middle.set_ylabel("degrees")
        lower.plot(record.frequency, record.coherence_output[row], label="output", **MEASURED)
        if record.instrumented[row]:
            lower.plot(record.frequency, record.coherence_input[row], label="input", **HELD)
            lower.plot(record.frequency, record.clearness[row], label="by random error", **_MODEL)
            legend_above(lower)
        lower.axhline(COHERENT, **BASELINE)
        lower.set_ylim(0.0, 1.05)
        lower.set_ylabel("coherence")
        lower.set_xlabel("Hz")
        low, high = record.frequency[0], record.frequency[-1]
        logarithmic(lower, [tick for tick in _TICKS_HZ if 0.99 * low <= tick <= 1.01 * high])
        legend_over(figure, upper)

    loop = "" if record.is_of_vehicle(row) else " Without instruments: of vehicle and autopilot together."
    caption = (
        f"{title.capitalize()}: {kind}, of the vehicle with 95 % of its scatter, and of the model by the same windows. "
        f"Grey: outside {_clear(record)}; nothing to go by.{loop}"
    )
    return plot(name, caption, f"Bode plot of {title}: {kind}, measured and of the model", 5.6, draw)


def _kind(name: str) -> tuple[str, str]:
    """Say from what to what a response is, and in which unit."""
    if name.endswith(_FOLLOWERS):
        return f"setpoint to {name}, of vehicle and autopilot", "rad per rad"
    return _KINDS.get(name, _ANGULAR), _UNITS.get(name, "rad/s² per N m")


def _error(record: ResponseRecord, row: int, shown: BoolArray) -> Array:
    return np.where(shown, record.random_error[row], np.nan)


def _curves(axes: Axes, record: ResponseRecord, row: int, part: str, half: Array) -> None:
    """Draw the magnitude or the phase of one response, with half the width of its band."""
    frequency, shown = record.frequency, record.coherent[row]
    measured, model, direct = (getattr(each, part)[row] for each in (record.measured, record.model, record.direct))
    clear = np.where(shown, measured, np.nan)
    if shown.any():
        band(axes, frequency, clear - half, clear + half, color="#c9c9c9", label="95 %")
    axes.plot(*_unbroken(frequency, measured), label="not excited", **_UNEXCITED)
    if record.instrumented[row]:
        axes.plot(*_unbroken(frequency, np.where(shown, direct, np.nan)), label="without instruments", **HELD)
    axes.plot(*_unbroken(frequency, clear), label="vehicle", **MEASURED)
    axes.plot(*_unbroken(frequency, np.where(shown, model, np.nan)), label="model", **_MODEL)
    plain_ticks(axes.yaxis)
    seen = np.concatenate([clear, np.where(shown, model, np.nan)])
    seen = seen[np.isfinite(seen)]
    if len(seen):
        room = _ROOM_DB if part == "magnitude" else _ROOM_DEG
        axes.set_ylim(float(seen.min()) - room, float(seen.max()) + room)


def _unbroken(frequency: Array, values: Array) -> tuple[Array, Array]:
    """Lift the pen where a phase goes round."""
    jumps = np.flatnonzero(np.abs(np.diff(values)) > 180) + 1
    return np.insert(frequency, jumps, frequency[jumps]), np.insert(values, jumps, np.nan)
