"""What of a gap comes again where flights repeat their path, on a page: an effect that is missing, or gusts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.residual.repeated import ComesAgain
from cpfls_cli.pages.gap import channel_words
from cpfls_cli.report.canvas import GREY, Drawn, in_columns, legend_over
from cpfls_cli.report.numbers import plain

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
_COLUMNS = 3
_PARTS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("again, explained", {"facecolor": "white"}),
    ("again, not explained", {"facecolor": "#1b4f8a"}),
    ("not again", {"facecolor": "#d9d9d9", "hatch": "////"}),
    ("sensor noise", {"facecolor": "white", "hatch": "...."}),
)


def again_drawn(groups: Callable[[Any], tuple[ComesAgain | None, ComesAgain | None]]) -> Drawn:
    """Make the figure of what comes again of a result: of the model as given, and with effects or None."""

    def held(r: Any) -> list[ComesAgain]:
        return [each for each in groups(r) if each is not None]

    def height(r: Any) -> float:
        return 1.0 + 1.9 * -(-len(held(r)[0].known) // _COLUMNS)

    def draw(r: Any, figure: Figure) -> None:
        _draw(held(r), figure)

    return Drawn("What comes again of torque and force, by channel and band", height, draw, held)


def _draw(groups: Sequence[ComesAgain], figure: Figure) -> None:
    """Draw by channel and band what comes again, explained and not, and what does not."""
    before = groups[0]
    channels, bands = before.known, np.arange(1, len(before.low))[::-1]
    ends = zip(before.low.tolist(), before.high.tolist(), strict=True)
    names = [f"{plain(low)}–{plain(high)}" if low else f"< {plain(high)}" for low, high in ends]
    panels = in_columns(figure, len(channels), _COLUMNS, share_y=True)
    for axes, channel in zip(panels.flat, channels, strict=False):
        _draw_channel(axes, groups, channel, bands)
        axes.set_title(channel_words(CHANNELS[channel]))
        axes.set_xticks(np.arange(len(bands)), [names[band] for band in bands], rotation=30, fontsize=8)
    for axes in panels[:, 0]:
        axes.set_ylabel("share, %")
    figure.supxlabel("Hz", fontsize=9)
    legend_over(figure, panels.flat[0])


def _draw_channel(axes: Axes, groups: Sequence[ComesAgain], channel: int, bands: Any) -> None:
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


def _heights(again: ComesAgain, channel: int) -> Any:
    """Give the parts of a bar in per cent, shape (part, band)."""
    left = np.clip(again.again[channel], 0.0, again.total[channel])
    noise = np.clip(np.nan_to_num(again.noise[channel]), 0.0, again.total[channel] - left)
    explained = np.clip(again.taken[channel] - left, 0.0, None)
    parts = np.nan_to_num(np.array([explained, left, again.total[channel] - left - noise, noise]))
    return 100 * parts / np.maximum(parts.sum(axis=0), np.finfo(float).tiny)
