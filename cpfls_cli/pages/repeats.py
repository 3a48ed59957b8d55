"""What of a gap comes again where flights repeat their path, on a page: an effect that is missing, or gusts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.artifacts.comes_again import OPEN, ComesAgainGroup, Part
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.pages.gap import channel_words
from cpfls_cli.report.canvas import GREY, in_columns, legend_over, plot
from cpfls_cli.report.content import Block, Box, Folded, Heading, Plot, Table, Text
from cpfls_cli.report.numbers import number, plain, sentence, whole_percent
from cpfls_cli.words import joined

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WHAT_TO_FLY = "cpfls trajectory CONFIG --hover 30 --excite roll,pitch --repeat 4 -o mission.h5"
"""Plans what tells the vehicle from the loop, and a missing effect from gusts."""
BY_HAND = "by hand, stick left and right, then forward and back, about twice a second, with pauses"
"""The same without a mission."""
FLOWN_BY_HAND = frozenset({"bbl", "bfl"})
"""Formats of logs whose autopilot flies no mission file."""

NOT_SPLIT = (
    "No two of these flights repeat a path, so the gap cannot be split into what comes again (an effect that the model "
    "lacks) and what does not (gusts, noise). Logged setpoints of position or velocity tell that too. To fly: "
    f"{WHAT_TO_FLY}"
)
NO_EFFECT = "What is left does not come again: no effect of the vehicle explains it."
_TITLE = "What comes again"
_TELLS = 0.05
"""Share of a motion that a model has to explain for that to be told."""
_VISIBLE = 0.1
"""Share of what comes again that is visible where it is left: effects that explain nine tenths of a gap are named."""
_COLUMNS = 3
_PARTS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("again, explained", {"facecolor": "white"}),
    ("again, not explained", {"facecolor": "#1b4f8a"}),
    ("not again", {"facecolor": "#d9d9d9", "hatch": "////"}),
    ("sensor noise", {"facecolor": "white", "hatch": "...."}),
)


def again_box(before: ComesAgainGroup, after: ComesAgainGroup | None = None, effects: str = "") -> Box:
    """Say what of a gap comes again, where, and with effects what of that is left.

    Parameters
    ----------
    after : ComesAgainGroup or None
        With effects; None where none were sought.
    effects : str
        What the model with effects is.
    """
    found = [
        (before.share_in(channel, part), channel, part) for channel in before.channels for part in before.parts(channel)
    ]
    lines = [_channel_sentence(before, channel, after) for channel in before.known]
    left = [] if after is None or not found else list(_left(before, after, effects))
    if not found:
        return Box("REPEATS", sentence(_nothing(before, "the gap")), [*lines, *left], "note")
    share, channel, part = max(found, key=lambda each: each[0])
    title = (
        f"Of the gap in the {channel_words(CHANNELS[channel])} {_where(part)} {whole_percent(share)} comes again: the "
        f"model{'' if after is None else ' as given'} lacks an effect there."
    )
    return Box("REPEATS", title, [*lines, *left], "note")


def _nothing(again: ComesAgainGroup, what: str) -> str:
    """Say that nothing comes again, if that is known."""
    most = whole_percent(again.most)
    if not again.nothing:
        return f"these runs do not tell whether {what} comes again: up to {most} of it may"
    return (
        f"{what} does not come again (at most {most} of it): gusts or noise, and no effect of the vehicle explains it"
    )


def _left(before: ComesAgainGroup, after: ComesAgainGroup, effects: str) -> Iterator[str]:
    """Say what effects leave of what comes again; that more is missing only where a visible part is left."""
    left = {channel: _left_in(before, after, channel) for channel in after.channels}
    names = [channel_words(CHANNELS[channel]) for channel, share in left.items() if share > _VISIBLE]
    if names:
        yield sentence(f"{effects}, part of what is left comes again, in the {joined(names)}: more is missing")
    elif left:
        most = whole_percent(max(left.values()))
        yield sentence(f"{effects}, {most} at most of what comes again is left: no further effect shows")
    else:
        yield sentence(f"{effects}, {_nothing(after, 'what is left')}")


def _left_in(before: ComesAgainGroup, after: ComesAgainGroup, channel: int) -> float:
    """Compute the largest share that is left of what comes again in parts of a channel; infinite where none came."""
    bands = [part.bands for part in after.parts(channel)]
    came, left = ([float(np.nansum(each.again[channel, own])) for own in bands] for each in (before, after))
    return max(now / then if then > 0 else np.inf for then, now in zip(came, left, strict=True))


def _channel_sentence(before: ComesAgainGroup, channel: int, after: ComesAgainGroup | None) -> str:
    """Say of a channel what comes again, and how large is what does not."""
    said = "; ".join(_part_words(before, channel, part, after) for part in before.parts(channel))
    if not said:
        most = before.at_most(channel)
        said = f"{'nothing comes' if most <= OPEN else 'nothing surely comes'} again (at most {whole_percent(most)})"
    rest = _rest(before if after is None else after, channel)
    return f"{sentence(f'{channel_words(CHANNELS[channel])}: {said}')} The rest: {rest}."


def _rest(again: ComesAgainGroup, channel: int) -> str:
    """Say what does not come again: gusts, or noise as far as it is known."""
    size, unit = float(again.does_not[channel]), _unit(channel)
    noise = float(np.sqrt(again.noise[channel, 0]) / again.resists[channel])
    if noise > size:
        return f"noise of the sensors of about {number(noise, 2)} {unit}"
    return f"gusts of about {number(size, 2)} {unit}, or noise{'' if np.isnan(noise) else ' that is not white'}"


def _part_words(again: ComesAgainGroup, channel: int, part: Part, after: ComesAgainGroup | None) -> str:
    """Say how much comes again in some bands, how much of the motion is explained there, and what effects leave."""
    words = f"{whole_percent(again.share_in(channel, part))} comes again {_where(part)}"
    if after is not None:
        left = float(np.nansum(after.again[channel, part.bands]) / np.nansum(again.again[channel, part.bands]))
        words += f", of which {whole_percent(float(np.clip(left, 0.0, 1.0)))} is left"
    explained = again.explained[channel, part.bands]
    if (explained > _TELLS).all():
        low, high = (whole_percent(float(each)) for each in (explained.min(), explained.max()))
        words += f" (of the motion that comes again the model explains {low if low == high else f'{low} to {high}'})"
    return words


def _where(part: Part) -> str:
    low, high = plain(part.low), plain(part.high)
    return f"from {low} to {high} Hz" if part.low else f"below {high} Hz"


def _unit(channel: int) -> str:
    return "rad/s²" if CHANNELS[channel].startswith("torque") else "m/s²"


def again_blocks(
    before: ComesAgainGroup | None, after: ComesAgainGroup | None, index: int, label: str
) -> Iterator[Block]:
    """Show what comes again by channel and band; nothing where no flight repeats another.

    Parameters
    ----------
    label : str
        What kind of artifact it is, for names that are unique on the page.
    """
    if before is None:
        return
    yield Heading(_TITLE)
    yield Text(_explanation(before))
    yield again_figure(f"comes-again-{label}-{index}", before, after)
    yield Folded("By channel and band", [_table(f"comes-again-{label}-{index}-table", before, after)])


def _explanation(again: ComesAgainGroup) -> str:
    runs = f"{again.runs} runs of {'one path' if again.paths == 1 else f'{again.paths} paths'}"
    return (
        f"{runs} ({joined(again.flights)}) are held against each other. The part of the gap that agrees with another "
        f"run at the same place of the path was asked for in both: the model lacks something there, or a sensor has a "
        f"fault "
        "that comes again with the path. The rest is the run's own: gusts and noise, the floor that no model of "
        "the vehicle goes below."
    )


def _table(name: str, before: ComesAgainGroup, after: ComesAgainGroup | None) -> Table:
    groups = [before] if after is None else [before, after]
    rows = [
        [
            channel_words(CHANNELS[channel]),
            f"{plain(before.low[band])} to {plain(before.high[band])}" if band else "all",
            _unit(channel),
            *(entry for group in groups for entry in _entries(group, channel, band)),
        ]
        for channel in before.known
        for band in range(len(before.low))
    ]
    columns = ["Gap", "Comes again", "Explained"]
    header = [
        "Channel",
        "Band, Hz",
        "Unit",
        *columns,
        *(f"After: {each.lower()}" for each in columns if after is not None),
    ]
    caption = (
        "The gap over the moment of inertia or the mass, the share of it that comes again, with 95 % of its scatter "
        f"over {before.blocks.min()} to {before.blocks.max()} blocks of the path, and the share of the motion that "
        "comes again that the model explains."
    )
    return Table(name, caption, header, rows, frozenset({0, 1, 2}))


def _entries(again: ComesAgainGroup, channel: int, band: int) -> tuple[str, str, str]:
    gap = float(np.sqrt(again.total[channel, band]) / again.resists[channel])
    return number(gap, 2), _share(again, channel, band), whole_percent(float(again.explained[channel, band]))


def _share(again: ComesAgainGroup, channel: int, band: int) -> str:
    share, half = float(again.share[channel, band]), float(again.share_half[channel, band])
    if not np.isfinite(share):
        return number(share)
    return f"{100 * share:.0f} ± {100 * half:.0f} %".replace("-", "−")


def again_figure(name: str, before: ComesAgainGroup, after: ComesAgainGroup | None) -> Plot:
    """Draw by channel and band what comes again, explained and not, and what does not; after effects beside before."""
    groups = [before] if after is None else [before, after]
    channels, bands = before.known, np.arange(1, len(before.low))[::-1]
    ends = zip(before.low.tolist(), before.high.tolist(), strict=True)
    names = [f"{plain(low)}–{plain(high)}" if low else f"< {plain(high)}" for low, high in ends]

    def draw(figure: Figure) -> None:
        panels = in_columns(figure, len(channels), _COLUMNS, share_y=True)
        for axes, channel in zip(panels.flat, channels, strict=False):
            _draw_channel(axes, groups, channel, bands)
            axes.set_title(channel_words(CHANNELS[channel]))
            axes.set_xticks(np.arange(len(bands)), [names[band] for band in bands], rotation=30, fontsize=8)
        for axes in panels[:, 0]:
            axes.set_ylabel("share, %")
        figure.supxlabel("Hz", fontsize=9)
        legend_over(figure, panels.flat[0])

    beside = "" if after is None else " Left bars: the model as given; right bars: with the effects."
    caption = (
        "Of the torque and force that the motion takes, by band of frequency: what comes again in other runs of the "
        "path and is explained by the model, what comes again and is not, and what does not come again. All but "
        f"the first are the gap.{beside}"
    )
    rows = -(-len(channels) // _COLUMNS)
    return plot(name, caption, "What comes again of torque and force, by channel and band", 1.0 + 1.9 * rows, draw)


def _draw_channel(axes: Axes, groups: Sequence[ComesAgainGroup], channel: int, bands: Any) -> None:
    width = 0.8 / len(groups)
    for place, again in enumerate(groups):
        x = np.arange(len(bands)) - 0.4 + width * (place + 0.5)
        heights, bottom = _heights(again, channel)[:, bands], np.zeros(len(bands))
        for (label, style), height in zip(_PARTS, heights, strict=True):
            shown = label if place == 0 else None
            axes.bar(x, height, 0.92 * width, bottom=bottom, label=shown, edgecolor=GREY, linewidth=0.6, **style)
            bottom += height
    axes.set_ylim(0, 100)
    axes.grid(visible=False, axis="x")
    axes.set_axisbelow(True)


def _heights(again: ComesAgainGroup, channel: int) -> Any:
    """Give the parts of a bar in per cent, shape (part, band)."""
    left = np.clip(again.again[channel], 0.0, again.total[channel])
    noise = np.clip(np.nan_to_num(again.noise[channel]), 0.0, again.total[channel] - left)
    explained = np.clip(again.taken[channel] - left, 0.0, None)
    parts = np.nan_to_num(np.array([explained, left, again.total[channel] - left - noise, noise]))
    return 100 * parts / np.maximum(parts.sum(axis=0), np.finfo(float).tiny)
