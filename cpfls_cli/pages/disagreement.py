"""The page of a disagreement: on which axis, when and with which signals a model and flights disagree."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.disagreement import DependenceGroup, DisagreementRecord, HeatMapGroup
from cpfls_cli.artifacts.playback import by_horizon
from cpfls_cli.gap.settings import CLEAR
from cpfls_cli.pages.gap import channel_name, channel_unit, channel_words
from cpfls_cli.pages.playback import against_rivals, playback_figure
from cpfls_cli.pages.repeats import NOT_SPLIT, again_blocks, again_box
from cpfls_cli.pages.sensors import contradicted, sensors_answer, settled_channels, unseen_answer
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import in_columns, line, plain_ticks, plot, stacked
from cpfls_cli.report.content import Block, Box, Cell, Folded, Heading, Plot, Table, Text, in_short
from cpfls_cli.report.numbers import number, plain, sentence, whole_percent
from cpfls_cli.words import joined

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PatchCollection
    from matplotlib.figure import Figure

_STRETCHES = 5
_SIGNALS = 4
_NAMED_SIGNALS = 2
_COLUMNS = 2
_LEVELS = 8
_BLUE, _SHADE = "#1b4f8a", "#f3d9b8"
_LABEL = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
_SIGNAL_UNITS = {
    "time": "s",
    "body rate": "rad/s",
    "roll": "rad",
    "pitch": "rad",
    "yaw": "rad",
    "air velocity": "m/s",
    "speed": "m/s",
    "horizontal speed": "m/s",
    "vertical speed": "m/s",
    "height": "m",
    "rotor speed": "rad/s",
    "thrust": "N",
    "rotor torque": "N m",
    "voltage": "share of full",
}


def answer(disagreement: Source[DisagreementRecord]) -> Iterator[Block]:
    """Say where a model and flights disagree, what the flights cannot show, and what to distrust."""
    record = disagreement.record
    *again, gap = lead(disagreement)
    for box in again:
        yield from in_short(box, 0, "what comes again, channel by channel")
    yield gap
    yield from settled_channels(record.audit)
    yield _axes_table(record, 1)
    yield Folded("when the gap is largest, and what it follows", list(_when(record, 1)))
    played = [*_not_split(record), *_played(record)]
    yield from [Folded("what comes again, and playback", played)] if played else []
    yield from unseen_answer(record.not_excited)
    yield from sensors_answer(record.audit)
    yield from (Text(warning, "warning") for warning in record.warning)


def lead(disagreement: Source[DisagreementRecord]) -> Iterator[Box]:
    """Say what comes again of the gap where flights repeat each other, and how large it is."""
    record = disagreement.record
    if record.again is not None and not record.audit.contradiction:
        yield again_box(record.again)
    yield verdict_box(disagreement)


def _not_split(record: DisagreementRecord) -> Iterator[Text]:
    """Say of a gap that it cannot be split, and what to fly."""
    if record.again is None and record.gap.above_noise.any():
        yield Text(NOT_SPLIT)


def where(disagreement: Source[DisagreementRecord]) -> Iterator[Block]:
    """Say on which axis, when and with which signals a model and flights disagree."""
    record = disagreement.record
    yield _axes_table(record, 1)
    yield from _when(record, 1)


def _when(record: DisagreementRecord, index: int) -> Iterator[Block]:
    yield from _stretches(record, index)
    yield from _follows(record)


def verdict_box(disagreement: Source[DisagreementRecord]) -> Box:
    """Say how large the largest gap is, and how to go on."""
    record, gap = disagreement.record, disagreement.record.gap
    if record.audit.contradiction:
        first, *others = record.audit.contradiction
        return Box("GAP", contradicted(first), [sentence(each) for each in others], "warning")
    if gap.largest is None:
        return Box("GAP", f"{disagreement.label}: no gap could be measured.", [], "warning")
    if not gap.above_noise.any():
        return Box("GAP", "Model and flights agree within the noise.", [], "good")
    channel, floors = gap.channel[gap.largest], float(gap.floors[gap.largest])
    title = f"The gap is largest in the {channel_words(channel)}: {number(floors, 3)} noise floors."
    signals = [signal for signal, _ in record.dependence.followed(channel)][:_NAMED_SIGNALS]
    follows = [f"It follows {joined(signals)} most."] if signals else []
    on = (
        "The model has effects already; `cpfls diagnose` needs a comparison without them."
        if not record.is_base(disagreement.vehicle)
        else "Run `cpfls diagnose` to learn what is missing."
    )
    return Box("GAP", title, [*follows, on])


def disagreement_blocks(disagreement: Source[DisagreementRecord], index: int) -> Iterator[Block]:
    """Show where a model and flights disagree, with its figures."""
    record = disagreement.record
    yield Heading(disagreement.label)
    yield _axes_table(record, index)
    if not record.gap.known:
        return
    yield from _not_split(record)
    yield from again_blocks(record.again, None, index, "compared")
    yield Heading("When")
    yield residual_figure(f"gap-over-time-{index}", record)
    yield from _stretches(record, index)
    yield Heading("What it follows")
    yield from _follows(record)
    channels = _followed_channels(record)
    if channels:
        yield dependence_figure(f"dependence-{index}", record.dependence, channels)
        if record.heat_map is not None:
            yield heat_map_figure(f"heat-map-{index}", record.heat_map)
    else:
        yield Text("No channel has a gap above noise, so there is nothing to follow.")
    drawn = (
        None if record.playback is None else playback_figure(f"replay-{index}", record.playback.by_horizon, "the model")
    )
    if drawn is not None:
        yield Heading("Measured and simulated")
        yield from _played(record)
        yield drawn


def _played(record: DisagreementRecord) -> Iterator[Text]:
    yield from map(Text, against_rivals(by_horizon(record.playback)))


def _axes_table(record: DisagreementRecord, index: int) -> Table:
    gap = record.gap
    rows: list[list[str | Cell]] = []
    for channel_index in gap.known:
        channel = gap.channel[channel_index]
        sizes = [number(float(values[channel_index]), 3) for values in (gap.rms, gap.floor, gap.floors)]
        above = Cell("yes", "warning") if gap.above_noise[channel_index] else Cell("no")
        share = whole_percent(float(gap.share[channel_index]))
        rows.append([channel_name(channel), channel_unit(channel), *sizes, above, share])
    caption = (
        "Gap between what the measured motion takes and what the model provides, root mean square over "
        f"{', '.join(record.flights.names())}."
    )
    legend = (
        f"Floor: what noise alone would leave. Above noise: more than {CLEAR:g} floors, because without a gap chance "
        "leaves up to that. Share: of the torque or force that moves the vehicle."
    )
    header = ("Channel", "Unit", "Gap", "Noise floor", "In floors", "Above noise", "Share")
    return Table(f"gap-by-axis-{index}", caption, header, rows, frozenset({0, 1, 5}), legend=legend)


def _stretches(record: DisagreementRecord, index: int) -> Iterator[Table]:
    flights = record.flights.names()
    rows = [
        [str(rank), flights[flight], channel_name(channel), f"{start:.1f} … {end:.1f}", number(floors, 3)]
        for rank, (flight, start, end, channel, floors) in enumerate(record.stretch.first(_STRETCHES), start=1)
    ]
    caption = "The stretches in which the gap is largest, on the clock of each flight."
    header = ("Largest", "Flight", "Channel", "Time, s", "In floors")
    if rows:
        yield Table(f"stretches-{index}", caption, header, rows, frozenset({0, 1, 2}))


def _follows(record: DisagreementRecord) -> Iterator[Text]:
    for channel in _followed_channels(record):
        signals = [f"{signal} ({whole_percent(share)})" for signal, share in record.dependence.followed(channel)]
        if signals:
            yield Text(f"The gap in the {channel_words(channel)} follows {', '.join(signals[:_SIGNALS])}.")


def _followed_channels(record: DisagreementRecord) -> list[str]:
    """Channels above noise of which it is known what they follow: those below follow chance."""
    above = [record.gap.channel[index] for index in np.flatnonzero(record.gap.above_noise)]
    return [channel for channel in above if channel in record.dependence.channel]


def residual_figure(name: str, record: DisagreementRecord) -> Plot:
    """Draw the gap of each channel over all flights, one after another."""
    gap, residual = record.gap, record.residual
    offset = flight_offsets(residual.flight, residual.time)
    time, value = residual.time + offset[residual.flight], residual.value / gap.floor
    parts = [residual.flight == index for index in np.unique(residual.flight)]

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(gap.known))
        for axes, index in zip(panels, gap.known, strict=True):
            for part in parts:
                line(axes, time[part], value[part, index], color=_BLUE, linewidth=0.9)
            axes.axhspan(-1.0, 1.0, color="#dddddd", zorder=0)
            _mark_stretches(axes, record, gap.channel[index], offset)
            for part in parts[1:]:
                axes.axvline(time[part][0], color="black", linewidth=0.7, linestyle=(0, (4, 2)))
            axes.set_xlim(time.min(), time.max())
            axes.set_title(channel_words(gap.channel[index]))
        figure.supylabel("gap, noise floors", fontsize=9.5)
        panels[-1].set_xlabel("time, s; flights one after another")

    more = " Dashed lines separate the flights, in the order given." if len(offset) > 1 else ""
    caption = (
        "Gap over time, in noise floors; the grey band is one floor up and down. Shaded and numbered: the "
        f"{_STRETCHES} stretches in which it is largest, as in the table below.{more}"
    )
    return plot(name, caption, "Gap of each channel over time in noise floors", 0.7 + 1.1 * len(gap.known), draw)


def flight_offsets(flight: IntArray, clock: Array) -> Array:
    """Put the clocks of flights one after another: give for each flight what is to be added to its clock, s."""
    offset, end = np.zeros(int(flight.max(initial=-1)) + 1), 0.0
    for index in range(len(offset)):
        times = clock[flight == index]
        if len(times):
            offset[index] = end - times[0]
            end += times[-1] - times[0] + (times[-1] - times[0]) / max(len(times) - 1, 1)
    return offset


def _mark_stretches(axes: Axes, record: DisagreementRecord, channel: str, offset: Array) -> None:
    for rank, (flight, start, end, name, _) in enumerate(record.stretch.first(_STRETCHES), start=1):
        if name != channel:
            continue
        first = start + offset[flight]
        axes.axvspan(first, first + end - start, color=_SHADE, zorder=0)
        middle, above = first + (end - start) / 2, axes.get_xaxis_transform()
        axes.text(middle, 0.97, str(rank), transform=above, ha="center", va="top", fontsize=8.5, zorder=5, bbox=_LABEL)


def dependence_figure(name: str, dependence: DependenceGroup, channels: Sequence[str]) -> Plot:
    """Draw the share of each channel's gap that its best signals explain, each alone."""
    rows = ceil(len(channels) / _COLUMNS)

    def draw(figure: Figure) -> None:
        panels = in_columns(figure, len(channels), _COLUMNS)
        for axes, channel in zip(panels.flat, channels, strict=False):
            _draw_channel(axes, dependence, channel)
        for column in range(min(_COLUMNS, len(channels))):
            last = panels[(len(channels) - 1 - column) // _COLUMNS, column]
            last.set_xlabel("share of variance explained")
            last.tick_params(labelbottom=True)

    caption = (
        "What the gap follows: share of its variance that a smooth curve over one signal explains on stretches that "
        "the curve was not fitted to. Filled: chance does as well in less than 5 % of trials; hollow: it may be chance."
    )
    return plot(name, caption, "Share of the gap explained by each signal, by channel", 0.6 + 1.25 * rows, draw)


def _draw_channel(axes: Axes, dependence: DependenceGroup, channel: str) -> None:
    best = dependence.of_channel(channel)[:_SIGNALS]
    shares = np.clip(dependence.r2[best], 0.0, 1.0)
    rows = np.arange(len(best))[::-1]
    colours = [_BLUE if certain else "white" for certain in dependence.sure[best]]
    axes.barh(rows, shares, height=0.66, color=colours, edgecolor=_BLUE)
    axes.set_yticks(rows, [dependence.signal[index] for index in best])
    axes.set_axisbelow(True)
    axes.set_xlim(0.0, 1.0)
    axes.grid(visible=False, axis="y")
    axes.set_title(channel_words(channel))


def heat_map_figure(name: str, heat_map: HeatMapGroup) -> Plot:
    """Draw the mean gap over the two signals that explain it best."""
    channel, signals = heat_map.channel, heat_map.signal
    mean, edges = heat_map.mean.T, (heat_map.first_edge, heat_map.second_edge)
    largest = float(np.nanmax(np.abs(mean), initial=1e-12))

    def draw(figure: Figure) -> None:
        from matplotlib.colors import BoundaryNorm
        from matplotlib.ticker import MaxNLocator

        limits = MaxNLocator(_LEVELS, symmetric=True).tick_values(-largest, largest)
        axes = figure.subplots()
        axes.set_facecolor("white")
        mesh = axes.pcolormesh(*edges, np.ma.masked_invalid(mean), cmap="PuOr", norm=BoundaryNorm(limits, 256))
        axes.add_collection(_hatched(*edges, mean < 0))
        bar = figure.colorbar(mesh, ax=axes, ticks=limits)
        bar.ax.set_yticklabels([plain(float(limit), smallest=1e-4) for limit in limits])
        bar.set_label(f"mean gap, {channel_unit(channel)}")
        axes.grid(visible=False)
        axes.set_xlabel(signal_words(signals[0]))
        axes.set_ylabel(signal_words(signals[1]))
        for axis in (axes.xaxis, axes.yaxis):
            plain_ticks(axis)

    caption = (
        f"Mean gap of the {channel_words(channel)}, the channel with the largest one in floors, over the two signals "
        "that explain it best. Hatched cells are negative; cells that the flights never visited are left empty."
    )
    return plot(name, caption, f"Mean gap over {signals[0]} and {signals[1]}", 3.9, draw)


def _hatched(first: Array, second: Array, marked: BoolArray) -> PatchCollection:
    """Hatch cells, so that a sign is seen without colour."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Rectangle

    cells = [
        Rectangle((first[column], second[row]), first[column + 1] - first[column], second[row + 1] - second[row])
        for row, column in np.argwhere(marked)
    ]
    return PatchCollection(cells, facecolor="none", edgecolor="#6b6b6b", linewidth=0.0, hatch="////")


def signal_words(signal: str) -> str:
    """Name a signal with its unit."""
    unit = _SIGNAL_UNITS.get(signal) or _SIGNAL_UNITS.get(signal.rsplit(" ", 1)[0])
    return f"{signal}, {unit}" if unit else signal
