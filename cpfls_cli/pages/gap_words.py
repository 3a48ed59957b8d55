"""What templates of the gap workflow know beside what all do: names of channels, effects and their numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.residual.repeated import OPEN
from cpfls_cli.gap.settings import CLEAR
from cpfls_cli.pages import effects, gap
from cpfls_cli.pages.playback import ERRORS, draw_errors, errors_height
from cpfls_cli.pages.playback import WORDS as PLAYBACK_WORDS
from cpfls_cli.pages.repeats import NOT_SPLIT
from cpfls_cli.pages.sensors import contradicted
from cpfls_cli.report.canvas import Drawn
from cpfls_cli.report.numbers import plain, probability


def channel_words(channel: int | str) -> str:
    """Say what a channel is, by its index or name."""
    return gap.channel_words(channel if isinstance(channel, str) else CHANNELS[channel])


def by_reason(given: Any) -> dict[str, list[str]]:
    """Gather names by the reason that they have in common: of a mapping from names, or of rows with both."""
    pairs = given.items() if isinstance(given, Mapping) else ((each.name, each.reason) for each in given)
    reasons: dict[str, list[str]] = {}
    for name, reason in pairs:
        reasons.setdefault(reason, []).append(name)
    return reasons


def measured(number: Any, factor: float = 1.0) -> list[str]:
    """Write a value, and its interval or ``—``, with the digits that the width of the interval leaves."""
    return effects.measured(*(factor * each for each in (number.value, number.low, number.high)))


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
    "again_open": OPEN,
    "by_reason": by_reason,
    "channel_name": gap.channel_name,
    "channel_unit": gap.channel_unit,
    "channel_words": channel_words,
    "channels": CHANNELS,
    "clear": CLEAR,
    "contradicted": contradicted,
    "effect_title": effects.effect_title,
    "meaning": effects.meaning,
    "measured": measured,
    "not_split": NOT_SPLIT,
    "number_words": effects.number_words,
    "plain": plain,
    "possible": effects.possible,
    "probability": probability,
    "share_words": effects.share_words,
    "titles": effects.titles,
    "unit_words": effects.unit_words,
    "vehicle_number": effects.vehicle_number,
}
"""Words, constants and filters, by the name that templates use."""
