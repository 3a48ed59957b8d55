"""What pages of playback and of flights ask Python for: errors by horizon, gusts and contradictions in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, runs
from cpfls_cli.pages.trust import contradicted
from cpfls_cli.playback.errors import (
    AFTER,
    BEFORE,
    MODEL,
    NOTHING_MOVES,
    RATE_FADES,
    RATE_STAYS,
    STATED,
    WITH_PAST,
    ByHorizon,
)
from cpfls_cli.playback.gusts import GustAxis
from cpfls_cli.report.canvas import BASELINE, GREY, HELD, Figure, legend_over, line, stacked, style_of
from cpfls_cli.report.content import number
from cpfls_cli.rounding import less
from cpfls_cli.words import by_name, joined

WHO: Mapping[str, str] = {
    MODEL: "the model",
    AFTER: "with the effects",
    NOTHING_MOVES: "nothing moves",
    RATE_STAYS: "rate stays",
    RATE_FADES: "rate fades",
    STATED: "stated vehicle",
    BEFORE: "as given",
    WITH_PAST: "with the past",
}
"""What is said of predictions, in the order in which they are shown."""

SIGNALS: Mapping[str, tuple[str, str, float]] = {
    "body_rate": ("body rate", "rad/s", 1.0),
    "attitude": ("attitude", "°", 180.0 / np.pi),
    "velocity": ("velocity", "m/s", 1.0),
    "position": ("position", "m", 1.0),
}
"""Of each signal its name, the unit that people read, and by what errors in SI are multiplied for it."""

_JUDGED: dict[str, Any] = {**style_of(0), "linewidth": 2.0, "zorder": 3}
_AS_STATED: dict[str, Any] = {"color": GREY, "linestyle": "-", "linewidth": 0.9}
_STYLES = {
    MODEL: _JUDGED,
    AFTER: _JUDGED,
    NOTHING_MOVES: HELD,
    RATE_STAYS: BASELINE,
    RATE_FADES: {"color": GREY, "linestyle": (0, (5, 1.5, 1, 1.5)), "linewidth": 1.2},
    STATED: _AS_STATED,
    BEFORE: _AS_STATED,
    WITH_PAST: {**style_of(2), "linewidth": 2.0, "zorder": 4},
}
_STRETCHES = 2


def spans(horizon: Array, better: BoolArray) -> str:
    """Say at which horizons something holds: at the longest stretches of them, where they are many."""
    if better.all():
        return f"every horizon to {horizon[-1]:.3g} s"
    longest = sorted(sorted(runs(better), key=lambda run: run[0] - run[1])[:_STRETCHES])
    ends = [(horizon[first], horizon[after - 1]) for first, after in longest]
    return joined([" to ".join(f"{end:.3g} s" for end in dict.fromkeys(each)) for each in ends])


WORDS: Mapping[str, Any] = {
    **by_name(contradicted, less, spans),
    "moves": lambda signal, r: r.moves(signal),
    "signal_words": lambda signal: SIGNALS[signal][0],
    "signals": SIGNALS,
    "who": WHO,
    "wins": lambda signal, r: r.wins(signal),
}
"""What templates of playback know (`by_horizon.md.j2`, `trust.md.j2`)."""


def draw_errors(
    r: ByHorizon, figure: Figure, left_out: Sequence[str] = (), names: Mapping[str, str] | None = None
) -> None:
    """Draw the mean error over the horizon, of a model and of what it has to beat; `names`: others than in `WHO`."""
    called = {**WHO, **(names or {})}
    panels = stacked(figure, len(r.signals))
    for axes, signal in zip(panels, r.signals, strict=True):
        words, unit, scale = SIGNALS[signal]
        shown = [name for name in WHO if name in r.models and name not in left_out]
        for name in reversed(shown):
            line(axes, r.horizon_s, scale * r.of(name, signal).mae, label=called[name], **_STYLES[name])
        tops = {name: scale * float(r.of(name, signal).mae.max()) for name in r.models}
        top = 1.6 * max(tops[name] for name in (r.judged, *r.rivals))
        axes.set(ylim=(0.0, min(top, 1.06 * max(tops.values())) or 1.0), title=f"{words}, {unit}")
    panels[-1].set_xlabel("horizon, s")
    legend_over(figure, panels[0])


def errors_height(r: ByHorizon) -> float:
    """Give the height of the figure of errors, inch."""
    return 0.9 + 1.7 * len(r.signals)


ERRORS = "Mean error by horizon, of the model and of what it has to beat"
"""What the figure of errors shows."""


def gust_words(axes: list[GustAxis], instrument_kind: str) -> str:
    """Tell sizes and memories by axis, and what no gust exceeds."""
    known = [axis_words(axis) for axis in axes if np.isfinite(axis.size)]
    least = [
        f"{number(axis.high, 2)} {_unit(axis)} {_where(axis)}"
        for axis in axes
        if np.isfinite(axis.high) and not np.isfinite(axis.size)
    ]
    open_ = [_where(axis) for axis in axes if not np.isfinite(axis.high)]
    said = [f"Gusts: {'; '.join(known)}."] if known else []
    if least:
        said.append(f"No gusts above {joined(least)}{_UNIDENTIFIED if instrument_kind == 'none' else ''}.")
    if open_:
        said.append(f"Gusts {joined(open_)} are not known, because what they move is not.")
    if known:
        what = "the innovations" if instrument_kind == "past" else "what is not repeatable"
        said.append(f"Standard deviations of {what}; `cpfls simulate --model --gusts` plays them.")
    return " ".join(said)


_UNIDENTIFIED = ": all that the model leaves, because nothing separates gusts from what it lacks"


def axis_words(axis: GustAxis) -> str:
    """Write size and memory of gusts about or along an axis, with their intervals."""
    size = f"{number(axis.size, 2)} {_unit(axis)} {_where(axis)} ({_ends(axis.low, axis.high)})"
    return f"{size}, lasting {number(axis.memory, 2)} s ({_ends(axis.memory_low, axis.memory_high)})"


def _ends(low: float, high: float) -> str:
    return f"{number(low, 2)} to {number(high, 2)}"


def _unit(axis: GustAxis) -> str:
    return "rad/s²" if axis.turns else "m/s²"


def _where(axis: GustAxis) -> str:
    return f"about {axis.name}" if axis.turns else f"along {axis.name}"
