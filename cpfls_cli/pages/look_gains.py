"""The page of gains from one log: what to change, what it gives, and what to fly where the log does not say."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from cpfls_cli.look.gains import HOLDS, AxisGains, AxisMargins, GainRow, TunedGains
from cpfls_cli.look.manoeuvres import Manoeuvre
from cpfls_cli.look.reasons import TOO_SLOW
from cpfls_cli.report.content import Block, Box, Cell, Table, Text
from cpfls_cli.report.numbers import number, percent, sentence
from cpfls_cli.result import Estimate
from cpfls_cli.words import joined

_NOTHING: Final = {
    "autopilot": "the control law of what wrote this log is not known",
    "version": "gains of this version count otherwise than those of later ones",
    "parameters": "the log holds no gains of the rate control",
}
_REASONS: Final = {
    "weak": "{fact}",
    "law": "with the gains in the log and the vehicle that it shows the loop would be unstable, but it "
    "flew: the law that flew is another",
    "feedback": "the feedback that flew is not that of the gains in the log: {fact}",
    "margins": "no gains hold the asked margins with the filters that flew; the best hold {fact}°",
    "band": "the proposed loop would cross at {fact} Hz, above the frequencies at which the log shows the vehicle",
}
_WHY: Final = {
    "": "no change is sure",
    "accepted": "kept: the loop that flew may bear enough",
    "margins": "asked margins",
    "step": "a step on the way: load it, fly, and look again",
    "noise": "noise: not more at once",
    "range": "end of its documented range",
    "with": "goes with the others of its axis",
}


def answer(gains: TunedGains) -> Iterator[Block]:
    """Say which gains to change, what margins that gives, and what to fly for the others."""
    name = gains.version or gains.title
    of = f"{name}: " if name else ""
    if gains.reason:
        yield Box("GAINS", sentence(f"{of}none"), [sentence(_NOTHING[gains.reason])], "warning")
        return
    judged = [sentence(_axis(each)) for each in gains.axes if each.before is not None and not each.reason]
    changes = len(gains.changes)
    title = of + (f"change {changes} of {len(gains.rows)} gains" if changes else "keep the gains")
    if not gains.rows:
        title = f"{of}no gains"
    yield Box("GAINS", sentence(title), judged, "good" if judged else "warning")
    if gains.rows:
        yield _table(gains)
    sticks = {each.axis: _stick(each) for each in gains.fly}
    for each in gains.axes:
        if each.reason:
            fly = f" {sticks[each.axis]}" if each.axis in sticks else ""
            # No flight shows what is not logged.
            fly = " `cpfls look` says what to set." if each.fact == TOO_SLOW else fly
            yield Text(sentence(f"{each.axis}: {_REASONS[each.reason].format(fact=each.fact)}") + fly, "warning")


def _axis(axis: AxisGains) -> str:
    before, after = axis.before, axis.after
    assert before is not None, "an axis without a reason has margins"
    assert after is not None, "an axis without a reason has new ones"
    if not axis.changed:
        return f"{axis.axis}: keep the gains; {_margins(before)}"
    phase = f"phase margin {number(before.phase_deg.value, 2)}° -> {_interval(after.phase_deg, '°')}"
    gain = f"gain margin {number(before.gain_db.value, 2)} -> {_interval(after.gain_db, ' dB')}"
    band = f"bandwidth {number(before.bandwidth_hz.value, 2)} -> {_interval(after.bandwidth_hz, ' Hz')}"
    return f"{axis.axis}: {phase}, {gain}, {band}"


def _margins(own: AxisMargins) -> str:
    return joined(
        [
            f"phase margin {_interval(own.phase_deg, '°')}",
            f"gain margin {_interval(own.gain_db, ' dB')}",
            f"bandwidth {_interval(own.bandwidth_hz, ' Hz')}",
        ]
    )


def _interval(own: Estimate, unit: str) -> str:
    return f"{number(own.value, 2)}{unit} [{number(own.low, 2)}, {number(own.high, 2)}]"


def _table(gains: TunedGains) -> Table:
    rows: list[list[str | Cell]] = [
        [row.parameter, f"{row.axis} {row.term}", f"{row.today:.6g}", f"{row.proposed:.6g}", _best(row), _WHY[row.why]]
        for row in gains.rows
    ]
    header = ("Parameter", "Gain", "Today", "Proposed", "Best, 95 %", "By")
    caption = (
        f"Best gains hold a disk margin of {number(gains.required, 3)}° with {percent(HOLDS, 2)} of the vehicles that "
        "the log leaves possible; one log bears one step to them."
    )
    legend = (
        "Best: the values that would suit each of these vehicles alone. A gain changes where today's value suits none."
    )
    return Table("look-gains", caption, header, rows, frozenset({0, 1, 5}), frozenset({5}), legend=legend)


def _best(row: GainRow) -> str:
    if not np.isfinite(row.low):
        return "—"
    return f"{row.low:.3g} to {row.high:.3g}" if np.isfinite(row.high) else f"{row.low:.3g} and more"


def _stick(own: Manoeuvre) -> str:
    slow = number(1 / own.lowest, 2)
    return (
        f"To see it: fly {own.mode} and move the {own.axis} stick by {percent(own.amplitude, 2)} to both sides for "
        f"{number(own.seconds, 2)} s, from once in {slow} s up to {number(own.highest, 2)} times in a second."
    )
