"""The page of a twin: where a simulator parts from a flight whose setpoints it flew, by channel, time and frequency."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.arrays import BoolArray
from cpfls_cli.artifacts.twin import SETPOINT, STAYS, TwinRecord
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.pages.gap import MEASURED
from cpfls_cli.pages.sensors import contradicted
from cpfls_cli.pages.source import Source
from cpfls_cli.playback.settings import VEHICLE
from cpfls_cli.report.canvas import BASELINE, HELD, band, legend_over, line, logarithmic, plain_ticks, plot, style_of
from cpfls_cli.report.content import Block, Box, Cell, Facts, Folded, Heading, Plot, Table, Text, in_short
from cpfls_cli.report.numbers import number, sentence
from cpfls_cli.response.mismatch import NOT_ACCEPTABLE, NOT_JUDGED, Deviation
from cpfls_cli.simulation.twin import LIFT
from cpfls_cli.words import joined

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PREDICTIONS = {SETPOINT: "Setpoint", STAYS: "Still"}
_ASKED = {"attitude": "attitude and thrust", "body_rate": "body rates and thrust"}
_GAINS = {
    "stated": "as the config states them",
    "log": "those of the log",
    "simulation": "those that the flight was simulated with",
    "defaults": "the defaults of the autopilot",
}
_INSTRUMENTS = {
    "repeats": "the same path flown again",
    "setpoints": "setpoints from outside of all loops",
    "none": "none: the setpoints themselves, which answer gusts below the bandwidth of the position control",
}
_NO_PART = "They answer the setpoints alike, and what differs is no more than gusts and noise"
_LEGEND = (
    "First the root mean square of measured less simulated, beside the setpoint itself and a vehicle that stays as it "
    "begins. J adds up differences of the answers to the setpoints (up to 50 good, up to 100 acceptable). Apart: from "
    "the first second in which what follows the setpoints and differs is more than gusts and noise, and than 1 dB of "
    "the motion."
)
_GUSTS_LEGEND = (
    " In gusts: least and most by which {count} vehicles that the model allows, each in gusts of its own and with what "
    "the model lacks, are off from it."
)
_VISIBLE_DB, _VISIBLE_DEG = 1.0, 7.6
"""Differences that are listed: with these J is 20 each."""
_SHOWN_S = 6.0
_BEFORE: dict[str, Any] = {**style_of(2), "linewidth": 1.4, "zorder": 3}
_AFTER: dict[str, Any] = {**style_of(1), "linewidth": 1.4, "zorder": 3.5}
_TICKS_HZ = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)


def answer(twin: Source[TwinRecord], index: int = 1) -> Iterator[Block]:
    """Say whether the simulator flies like the vehicle, and where it does not."""
    record = twin.record
    box = twin_box(record)
    yield from in_short(box, 4, "what else parts, and the vehicle of the config")
    yield from _tables(record, index)
    yield from (Text(words, "warning") for words in record.warning)


def twin_box(record: TwinRecord) -> Box:
    """Say of the last vehicle first whether it flies like the flight, then channel by channel, then of the others."""
    last = len(record.vehicle) - 1
    parted, judged = _parted(record, last), record.judged(last)
    told = [sentence(words) for words in _gust_words(record)]
    told += [sentence(_channel(record, last, channel)) for channel in parted]
    told += [sentence(_in_short(record, each)) for each in range(last)]
    if record.contradiction:
        return Box("TWIN", contradicted(record.contradiction[0]), told, "warning")
    title, tone = _title(record, last, parted, judged)
    alike = judged and not (parted or record.beyond)
    return Box("TWIN", sentence(title), [sentence(_NO_PART), *told] if alike else told, tone)


def _title(record: TwinRecord, vehicle: int, parted: list[int], judged: list[int]) -> tuple[str, Any]:
    name, names = record.name(vehicle), record.channel
    if np.isfinite(record.lost[vehicle]):
        return f"{name} overturns {_when(record.lost[vehicle])} along the setpoints of {record.flight}", "warning"
    if not judged and not parted:
        return f"{name} cannot be judged: the setpoints of {record.flight} move it nowhere clearly", "warning"
    if parted:
        alike = [names[channel] for channel in judged if channel not in parted]
        rest = f"; alike in {joined(alike)}" if alike else ""
        where = joined([names[channel] for channel in parted])
        small = ", by no more than its gusts do" if _by_gusts(record, parted) else ""
        return f"{name} parts from {record.flight} in {where}{small}{rest}", "warning"
    if record.beyond:
        where = joined([names[channel] for channel in record.beyond])
        return f"{name} answers the setpoints of {record.flight} alike, but gusts do not explain {where}", "warning"
    return f"{name} flies like {record.flight}: {joined([names[channel] for channel in judged])}", "good"


def _by_gusts(record: TwinRecord, channels: list[int]) -> bool:
    """Tell whether gusts explain how far off a flight is in all of some channels."""
    return not record.beyond and set(channels) <= set(record.held)


def _gust_words(record: TwinRecord) -> Iterator[str]:
    """Say in what the flight is one of those in gusts, and in what it is farther off."""
    known = record.in_gusts
    if known is None:
        return
    last, within = len(record.vehicle) - 1, [each for each in record.held if each not in record.beyond]
    flights = f"{len(known.rms)} flights in the gusts of {record.vehicle[last]}"
    if record.beyond:
        off = (
            f"{record.channel[each]} ({number(float(record.rms[last, each]), 2)} {_unit(record, each)}, they "
            f"{_least_to_most(record, each)})"
            for each in record.beyond
        )
        yield f"farther off than {flights}, so gusts do not explain it: {joined(list(off))}"
    if within:
        names = joined([record.channel[each] for each in within])
        yield f"no farther off than {flights}: {names}"
    else:
        yield f"no channel is like {flights}"
    if known.lost:
        yield f"in gusts {known.lost} of {len(known.rms)} overturn"


def _least_to_most(record: TwinRecord, channel: int) -> str:
    assert record.in_gusts is not None, "asked for"
    rms = record.in_gusts.rms[:, channel]
    return f"{number(float(rms.min()), 2)} to {number(float(rms.max()), 2)}"


def _parted(record: TwinRecord, vehicle: int) -> list[int]:
    return [channel for channel in range(len(record.channel)) if record.parts(vehicle, channel)]


def _in_short(record: TwinRecord, vehicle: int) -> str:
    """Say of another vehicle in what it parts."""
    parted, name = _parted(record, vehicle), record.name(vehicle)
    if np.isfinite(record.lost[vehicle]):
        return f"{name} overturns {_when(record.lost[vehicle])}"
    if not parted:
        return f"{name} parts in nothing"
    return f"{name} parts in {joined([record.channel[channel] for channel in parted])}"


def _when(second: float) -> str:
    return f"at {number(float(second), 3)} s"


def _channel(record: TwinRecord, vehicle: int, channel: int) -> str:
    """Say of one channel at which frequencies and when a vehicle parts."""
    parts, row = [], record.answers.row(vehicle, channel)
    if row is not None and np.isfinite(record.answers.cost[row]):
        off = [each for each in record.answers.deviations(row) if not each.right]
        where = ", ".join(map(_deviation_words, off)) or "right throughout"
        low, high = record.answers.band[row].tolist()
        parts.append(f"J = {number(float(record.answers.cost[row]), 3)} {_span_words(low, high)}; {where}")
    first = record.first_apart(vehicle, channel)
    if np.isfinite(first):
        share = float(record.window.apart[vehicle, :, channel].mean())
        follows = np.nan_to_num(record.window.follows[vehicle, :, channel])
        largest, floor = int(np.argmax(follows)), float(record.floor[vehicle, channel])
        parts.append(
            f"apart first {_when(first)}, in {number(100 * share, 2)} % of the seconds, most "
            f"{_when(record.window.start[largest])} ({number(float(follows[largest]), 2)} {_unit(record, channel)}, "
            f"gusts and noise {number(floor, 2)})"
        )
    return f"{record.channel[channel]}: {'; '.join(parts)}"


def _unit(record: TwinRecord, channel: int) -> str:
    name = record.channel[channel]
    if name.startswith("velocity"):
        return "m/s"
    if name == LIFT:
        return "m/s²"
    return "rad/s" if name.endswith("rate") else "rad"


def _tables(record: TwinRecord, index: int) -> Iterator[Block]:
    """Show the channels that are judged; the others are folded away."""
    known = [channel for channel in range(len(record.channel)) if np.isfinite(record.movement[channel])]
    judged = [each for each in known if each in record.judged(len(record.vehicle) - 1) or each in record.held]
    others = [each for each in known if each not in judged]
    caption = f"Differences of simulated vehicles that fly freely along the setpoints of {record.flight}."
    if judged:
        legend = _LEGEND if record.in_gusts is None else _LEGEND + _GUSTS_LEGEND.format(count=len(record.in_gusts.rms))
        yield _table(f"twin-{index}", caption, record, judged, legend)
    if others:
        more = _table(
            f"twin-others-{index}", f"The same of channels that are not judged: {record.flight}.", record, others
        )
        yield Folded("channels that are not judged", [more]) if judged else more


def _table(name: str, caption: str, record: TwinRecord, channels: list[int], legend: str = "") -> Table:
    vehicles = range(len(record.vehicle))
    names = ["Config" if record.vehicle[each] == VEHICLE else "Model" for each in vehicles]
    header = (
        "Channel",
        *names,
        *_PREDICTIONS.values(),
        *([] if record.in_gusts is None else ["In gusts"]),
        *(f"J {name.lower()}" for name in names),
        *(f"{name} apart" for name in names),
    )
    rows: list[list[str | Cell]] = [
        [
            f"{record.channel[channel]}, {_unit(record, channel)}",
            *(number(float(value), 2) for value in record.rms[:, channel]),
            *([] if record.in_gusts is None else [_in_gusts(record, channel)]),
            *(_judged(record, each, channel, record.word(each, channel)) for each in vehicles),
            *(_seconds(record.first_apart(each, channel)) for each in vehicles),
        ]
        for channel in channels
    ]
    return Table(name, caption, header, rows, frozenset({0}), legend=legend)


def _in_gusts(record: TwinRecord, channel: int) -> Cell:
    if channel not in record.held:
        return Cell("—")
    return Cell(_least_to_most(record, channel), "warning" if channel in record.beyond else "plain")


def _seconds(value: float) -> str:
    return f"{number(value, 3)} s" if np.isfinite(value) else "—"


def _judged(record: TwinRecord, vehicle: int, channel: int, word: str) -> Cell:
    if word == NOT_JUDGED:
        return Cell("—")
    return Cell(number(record.cost(vehicle, channel), 3), "warning" if word == NOT_ACCEPTABLE else "plain")


def twin_blocks(twin: Source[TwinRecord], index: int) -> Iterator[Block]:
    """Show all of a twin: who flew what, where they part, and three pictures."""
    record = twin.record
    title = AUTOPILOTS[record.autopilot].title if record.autopilot in AUTOPILOTS else record.autopilot
    yield Heading(twin.label)
    rows = [
        ("Flight", record.flight),
        ("Law", f"{title}, asked for {_ASKED.get(record.asked, record.asked)} as logged"),
        ("Gains", _GAINS.get(record.gains.source, record.gains.source)),
        ("Thrust", "the logged setpoint" if record.thrust_from == "setpoint" else "that of the flight's rotors"),
        ("Rotors", f"{number(1e3 * record.rotor_lag_s, 3)} ms behind their command"),
        ("Instruments", _INSTRUMENTS.get(record.instruments, record.instruments)),
    ]
    if record.left_out:
        rows.append(("Not simulated", "; ".join(record.left_out)))
    yield Facts(rows)
    yield from _tables(record, index)
    yield from (Text(words, "warning") for words in record.warning)
    yield _stretch_figure(record, index)
    if record.judged(len(record.vehicle) - 1):
        yield _frequency_figure(record, index)
        yield _time_figure(record, index)


def _styles(record: TwinRecord) -> list[dict[str, Any]]:
    """Draw the last vehicle as the one after, others as those before."""
    return [_BEFORE if each < len(record.vehicle) - 1 else _AFTER for each in range(len(record.vehicle))]


def _shown(record: TwinRecord) -> list[int]:
    """List the channels that are worth drawing: those judged, or the rates."""
    return record.judged(len(record.vehicle) - 1) or [0, 1, 2]


def _stretch_figure(record: TwinRecord, index: int) -> Plot:
    """Draw flight and vehicles around the second in which they are farthest apart for what they move."""
    channels = [channel for channel in _shown(record) if channel < 6][:6]
    told = np.isfinite(record.window.follows[0][:, channels]).any()
    follows = record.window.follows if told else record.window.difference
    away = np.nan_to_num(follows[0][:, channels]) / np.maximum(record.movement[channels], 1e-12)
    window, worst = np.unravel_index(int(np.argmax(away)), away.shape)
    axis = channels[int(worst)] % 3
    rows = [channel for channel in (axis, axis + 3) if np.isfinite(record.movement[channel])]
    middle = float(record.window.start[window]) + 0.5
    part = np.abs(record.time - middle) <= _SHOWN_S / 2

    blown = [channel for channel in rows[:1] if channel in record.held]

    def draw(figure: Figure) -> None:
        panels = np.atleast_1d(figure.subplots(len(rows) + len(blown), 1, sharex=True))
        for axes, channel in zip(panels[len(rows) :], blown, strict=True):
            _beside_gusts(axes, record, channel, part)
        for axes, channel in zip(panels, rows, strict=False):
            line(axes, record.time[part], record.measured[part, channel], label="flight", **MEASURED)
            if np.isfinite(record.setpoint[part, channel]).any():
                line(axes, record.time[part], record.setpoint[part, channel], label="setpoint", **BASELINE)
            for vehicle, style in enumerate(_styles(record)):
                values = record.simulated[vehicle, part, channel]
                line(axes, record.time[part], values, label=record.name(vehicle), **style)
            axes.set_ylabel(f"{record.channel[channel]}, {_unit(record, channel)}")
        panels[-1].set_xlabel("s")
        legend_over(figure, panels[0])

    caption = (
        f"{joined([record.channel[each] for each in rows]).capitalize()} of {record.flight} and simulated, around the "
        "second in which the first of them is farthest off. They start in the flight's state and never see it again."
    )
    if record.in_gusts is not None and blown:
        caption += (
            f" Below, the first of them less that of {record.vehicle[-1]} in still air; shaded, "
            f"{len(record.in_gusts.rms)} flights in gusts from the least to the most."
        )
    return plot(
        f"twin-stretch-{index}", caption, "Flight and simulated vehicles over time", 6.0 if blown else 4.4, draw
    )


def _beside_gusts(axes: Axes, record: TwinRecord, channel: int, part: BoolArray) -> None:
    """Draw how far a flight is off from the last vehicle, within what vehicles in gusts are."""
    assert record.in_gusts is not None, "some are held"
    time, still = record.time[part], record.simulated[-1, part, channel]
    low, high = record.in_gusts.low[part, channel] - still, record.in_gusts.high[part, channel] - still
    band(axes, time, low, high, color="#c9c9c9")
    line(axes, time, record.measured[part, channel] - still, label="flight", **MEASURED | {"linewidth": 1.4})
    axes.set_ylabel(f"difference, {_unit(record, channel)}")


def _frequency_figure(record: TwinRecord, index: int) -> Plot:
    """Draw how much stronger and earlier the simulated vehicles answer, by frequency."""
    channels = _shown(record)[:3]

    def draw(figure: Figure) -> None:
        panels = figure.subplots(2, len(channels), sharex=True, sharey="row", squeeze=False)
        for column, channel in enumerate(channels):
            for vehicle, style in enumerate(_styles(record)):
                row = record.answers.row(vehicle, channel)
                if row is not None:
                    _ratio(panels[:, column], record, row, record.name(vehicle), style, first=vehicle == 0)
            panels[0, column].set_title(record.channel[channel])
            panels[1, column].set_xlabel("Hz")
            low, high = record.answers.frequency[[0, -1]]
            ticks = [tick for tick in _TICKS_HZ if 0.99 * low <= tick <= 1.01 * high][:: 2 if len(channels) > 2 else 1]
            logarithmic(panels[1, column], ticks)
        panels[0, 0].set_ylabel("simulated over flight, dB")
        panels[1, 0].set_ylabel("degrees")
        legend_over(figure, panels[0, 0])

    caption = (
        "Answer to the same setpoints, simulated over flown: at 0 dB and 0 degrees they fly alike. Shaded: 95 % of the "
        "scatter that gusts and noise leave in the flight's answer. Only where the answer is clear."
    )
    return plot(f"twin-frequency-{index}", caption, "Simulated over flown answer by frequency", 4.6, draw)


def _ratio(panels: Any, record: TwinRecord, row: int, name: str, style: dict[str, Any], *, first: bool) -> None:
    low, high = record.answers.band[row].tolist()
    inside = (record.answers.frequency >= low) & (record.answers.frequency <= high)
    frequency = record.answers.frequency[inside]
    gain = (record.answers.model.magnitude - record.answers.measured.magnitude)[row][inside]
    phase = (record.answers.model.phase - record.answers.measured.phase)[row][inside]
    scatter = 2 * record.answers.random_error[row][inside]
    halves = (20 * np.log10(1 + scatter), np.degrees(scatter))
    turned = (phase + 180.0) % 360.0 - 180.0
    for axes, values, half in zip(panels, (gain, turned), halves, strict=True):
        if first:
            band(axes, frequency, -half, half, color="#c9c9c9", label="95 %")
            axes.axhline(0.0, **HELD)
        axes.plot(frequency, values, label=name, **style)
        plain_ticks(axes.yaxis)


def _time_figure(record: TwinRecord, index: int) -> Plot:
    """Draw second by second how much of the difference is the simulator's."""
    channels = [channel for channel in _shown(record) if channel < 6][:3]
    middles = record.window.start + 0.5

    def draw(figure: Figure) -> None:
        panels = np.atleast_1d(figure.subplots(len(channels), 1, sharex=True))
        for axes, channel in zip(panels, channels, strict=True):
            floor = record.floor[-1, channel]
            axes.axhline(floor, label="gusts and noise", **BASELINE)
            for vehicle, style in enumerate(_styles(record)):
                follows = record.window.follows[vehicle, :, channel]
                line(axes, middles, follows, label=record.name(vehicle), **style)
            axes.set_ylabel(f"{record.channel[channel]}, {_unit(record, channel)}")
            axes.set_ylim(bottom=0.0)
        panels[-1].set_xlabel("s")
        legend_over(figure, panels[0])

    caption = (
        "Difference that follows the setpoints, root mean square of each second: the simulator's own fault. Dashed: "
        "what of the difference does not follow them, over the whole flight."
    )
    return plot(f"twin-time-{index}", caption, "Difference by second", 4.4, draw)


def _span_words(low: float, high: float) -> str:
    """Say from which frequency to which, Hz."""
    return f"from {number(low, 2)} to {number(high, 2)} Hz"


def _deviation_words(part: Deviation) -> str:
    """Say how far a model is off over a stretch of frequencies."""
    where = _span_words(part.low, part.high)
    if part.right:
        return f"right {where}"
    decibels, said = 20 * np.log10(part.gain), []
    if abs(decibels) >= _VISIBLE_DB:
        strong = decibels > 0
        said.append(f"{number(part.gain if strong else 1 / part.gain, 2)} times too {'strong' if strong else 'weak'}")
    if abs(part.phase) >= _VISIBLE_DEG:
        # A difference of phases alone is that of a delay or a lag.
        delay = 1e3 * abs(part.phase) / 360 / float(np.sqrt(part.low * part.high))
        of_delay = "" if said else f" ({number(delay, 2)} ms)"
        said.append(f"{number(abs(part.phase), 2)}° too {'late' if part.phase < 0 else 'early'}{of_delay}")
    return f"{' and '.join(said) or 'off'} {where}"
