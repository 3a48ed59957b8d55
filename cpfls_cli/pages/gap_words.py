"""What templates of the gap workflow know: names of channels, effects and their numbers, and what is repeatable."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np

from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.residual.repeated import OPEN, Repeatability
from cpfls_cli.gap.settings import CLEAR
from cpfls_cli.pages.gap import WORDS, channel_words
from cpfls_cli.pages.playback import ERRORS, draw_errors, errors_height
from cpfls_cli.pages.playback import WORDS as PLAYBACK_WORDS
from cpfls_cli.report.canvas import GREY, Axes, Drawn, Figure, in_columns, legend_over
from cpfls_cli.report.content import plain, probability
from cpfls_cli.words import by_name

WHAT_TO_FLY = "cpfls trajectory CONFIG --hover 30 --excite roll,pitch --repeat 4 -o mission.h5"
"""Plans of flights that separate the vehicle from the loop, and a missing effect from gusts."""
BY_HAND = "by hand, stick left and right, then forward and back, about twice a second, with pauses"
"""The same without a mission."""
_FORMATS_WITHOUT = frozenset({"bbl", "bfl"})
"""Formats of logs whose autopilot flies no mission file."""
_FLIES_NO_MISSION = "Betaflight"

NOT_SPLIT = (
    "No two of these flights repeat a path, so the gap cannot be split into a repeatable part (an effect that the "
    "model lacks) and the rest (gusts, noise). Logged setpoints of position or velocity do that too. To fly: "
    f"{WHAT_TO_FLY}"
)
_COLUMNS = 3
_PARTS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("repeatable, explained", {"facecolor": "white"}),
    ("repeatable, not explained", {"facecolor": "#1b4f8a"}),
    ("not repeatable", {"facecolor": "#d9d9d9", "hatch": "////"}),
    ("sensor noise", {"facecolor": "white", "hatch": "...."}),
)


def flown_by_hand(formats: Collection[str], systems: Sequence[str]) -> bool:
    """Tell whether an autopilot flies no mission: by the formats of its logs, or by what wrote them."""
    by_format = bool(formats) and all(each.lower() in _FORMATS_WITHOUT for each in formats)
    return by_format or (bool(systems) and all(each.startswith(_FLIES_NO_MISSION) for each in systems))


def repeatability_drawn(groups: Callable[[Any], tuple[Repeatability | None, Repeatability | None]]) -> Drawn:
    """Make the figure of what is repeatable: of the model as given, and with effects or None."""

    def held(r: Any) -> list[Repeatability]:
        return [each for each in groups(r) if each is not None]

    def height(r: Any) -> float:
        return 1.0 + 1.9 * -(-len(held(r)[0].known) // _COLUMNS)

    def draw(r: Any, figure: Figure) -> None:
        _draw(held(r), figure)

    return Drawn("Repeatable part of torque and force, by channel and band", height, draw, held)


def _draw(groups: Sequence[Repeatability], figure: Figure) -> None:
    """Draw by channel and band what is repeatable, explained and not, and the rest."""
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


def _draw_channel(axes: Axes, groups: Sequence[Repeatability], channel: int, bands: Any) -> None:
    width = 0.8 / len(groups)
    for place, found in enumerate(groups):
        x = np.arange(len(bands)) - 0.4 + width * (place + 0.5)
        heights, bottom = _heights(found, channel)[:, bands], np.zeros(len(bands))
        for (label, style), height in zip(_PARTS, heights, strict=True):
            shown = label if place == 0 else None
            axes.bar(x, height, 0.92 * width, bottom=bottom, label=shown, edgecolor=GREY, linewidth=0.6, **style)
            bottom += height
    axes.set_ylim(0, 100)
    axes.grid(visible=False, axis="x")
    axes.set_axisbelow(True)


def _heights(found: Repeatability, channel: int) -> Any:
    """Give the parts of a bar in per cent, shape (part, band)."""
    gap = np.clip(found.repeatable[channel], 0.0, found.total[channel])
    noise = np.clip(np.nan_to_num(found.noise[channel]), 0.0, found.total[channel] - gap)
    explained = np.clip(found.motion[channel] - gap, 0.0, None)
    parts = np.nan_to_num(np.array([explained, gap, found.total[channel] - gap - noise, noise]))
    return 100 * parts / np.maximum(parts.sum(axis=0), np.finfo(float).tiny)


def by_reason(given: Any) -> dict[str, list[str]]:
    """Gather names by the reason that they have in common: of a mapping from names, or of rows with both."""
    pairs = given.items() if isinstance(given, Mapping) else ((each.name, each.reason) for each in given)
    reasons: dict[str, list[str]] = {}
    for name, reason in pairs:
        reasons.setdefault(reason, []).append(name)
    return reasons


def playback_drawn() -> Drawn:
    """Make the figure of the playback of a result; none of a single horizon, or of flights that show no motion."""
    return Drawn(
        ERRORS,
        lambda r: errors_height(r.playback),
        lambda r, figure: draw_errors(r.playback, figure),
        lambda r: r.playback and len(r.playback.horizon_s) > 1 and any(map(r.playback.moves, r.playback.signals)),
    )


GAP_WORDS: Mapping[str, Any] = {
    **PLAYBACK_WORDS,
    **WORDS,
    **by_name(by_reason, plain, probability),
    "again_open": OPEN,
    "channels": CHANNELS,
    "clear": CLEAR,
    "not_split": NOT_SPLIT,
}
"""Words, constants and filters, by the name that templates use."""
