"""What was said in gusts: each measure by the level of the gusts and by what separates them from the vehicle."""

from __future__ import annotations

import numpy as np

from benchmarks.blind_study.score import RIGHT, VISIBLE, exact
from benchmarks.blind_study.tables import NONE_TRIED, coefficients_of, grouped, of, percent, several, table

_SIZE, _MEMORY = 0.3, 2.0
"""Relative error of a size, and ratio of memories, that are good enough."""
_CHANNELS = ("torque x", "torque y", "torque z", "force x", "force y", "force z")


def air_tables(judged):
    """Write the tables of a study in gusts by title; none for a study in still air alone."""
    if all(each.usual for each in judged):
        return {}
    return {
        "In gusts": air_totals(judged),
        "Intervals in gusts": _coverage(judged),
        "Gusts by channel": air_by_channel(judged),
    }


def air_totals(judged):
    """Write what a study in gusts is held against, one column for each air; nothing for a study in still air alone."""
    if all(each.usual for each in judged):
        return ""
    airs = grouped(sorted(judged, key=lambda each: each.key.get("gusts", 0)), lambda each: each.air)
    rows = [("sets", *map(len, airs.values()), "")]
    for name, target, measure in _MEASURES:
        cells = [percent(measure(own)) for own in airs.values()]
        rows += [(name, *cells, target)] if {*cells} != {NONE_TRIED} else []
    return table(" | ".join(["", *airs, "target"]), rows)


def _coverage(judged):
    """Write how many coefficients of an effect lie in their intervals, one column for each air."""
    airs = {name: coefficients_of(own) for name, own in _airs(judged).items()}
    rows = []
    for effect in sorted({number.effect for own in airs.values() for number in own}):
        flags = [[number.inside for number in own if number.effect == effect] for own in airs.values()]
        rows.append((effect, *(f"{sum(own)} of {len(own)}" if own else "" for own in flags)))
    return table(" | ".join(["effect: in the interval", *airs]), rows)


def air_by_channel(judged):
    """Write what was found of the gusts of a channel over what is there: medians, then the range."""
    rows = []
    for name, own in _airs(judged).items():
        for channel, channel_name in enumerate(_CHANNELS):
            found = [one for one in _channels(own) if one[1] == channel]
            sized = [one for one in found if _is_sized(*one)]
            ratios = [[_ratio(*one, what, what) for one in sized] for what in ("size", "memory")]
            cells = (f"{np.median(each):.2f}, {min(each):.2f} to {max(each):.2f}" for each in ratios if each)
            rows += [(name, channel_name, f"{len(sized)} of {len(found)}", *cells)] if sized else []
    return table("air | channel | size identified | size, found over true | memory, found over true", rows)


def _airs(judged):
    """Group sets by their air, still air first."""
    return grouped(sorted(judged, key=lambda each: each.key.get("gusts", 0)), lambda each: each.air)


def _channels(own):
    """List channels of judged sets that have gusts."""
    return [(each, channel) for each in own if each.key.get("gusts") for channel in range(len(_CHANNELS))]


def _is_gusts_only(each, channel):
    return bool(each.said.get("air")) and each.said["air"]["gusts_only"][channel]


def _is_sized(each, channel):
    return bool(each.said.get("air")) and each.said["air"]["size"][channel] is not None


def _gusts_where_none_are(own):
    still = [each for each in own if not each.key.get("gusts") and "gust_turbulence" not in each.key["hidden"]]
    return [_is_gusts_only(each, channel) for each in still for channel in range(len(_CHANNELS))]


def _ratio(each, channel, said, what):
    """Give a number over the true one; what has no bound is infinite."""
    found = each.said["air"][said][channel]
    return np.inf if found is None else found / each.key["air"][what][channel]


def _near(own, what, low, high):
    return [low <= _ratio(*one, what, what) <= high for one in _channels(own) if _is_sized(*one)]


def _within(own, what, prefix):
    sized = [one for one in _channels(own) if _is_sized(*one)]
    return [_ratio(*one, f"{prefix}low", what) <= 1 <= _ratio(*one, f"{prefix}high", what) for one in sized]


_RARE = "1 in 300"
_MEASURES = (
    ("nothing hidden: false name", _RARE, lambda own: [bool(e.names) for e in of(own, "none")]),
    (f"one effect of {VISIBLE} floors or more: exactly right", "96 % in still air",
     lambda own: [e.outcome == RIGHT for e in of(own, "single") if e.visible >= VISIBLE]),
    ("one effect above the air's share: exactly right", "96 %",
     lambda own: [e.outcome == RIGHT for e in of(own, "single") if e.over_air >= 1]),
    ("any group: wrong name", "0", lambda own: [e.wrong_name for e in own]),
    ("any group but outside: a false name", _RARE, lambda own: [e.false_name for e in own if not e.key["outside"]]),
    ("outside the catalogue: NAMED", "at most 2 %",
     lambda own: [e.verdict == "NAMED" for e in of(own, "outside") if e.key["outside"]]),
    ("two or three effects: all named", "92 %", lambda own: [e.outcome == RIGHT for e in several(own)]),
    ("95 % intervals that hold the hidden value", "90 to 98 %",
     lambda own: [number.inside for number in coefficients_of(own) if exact(number)]),
    ("channels in gusts: residual is gusts alone", "", lambda own: [_is_gusts_only(*one) for one in _channels(own)]),
    ("channels in gusts: size identified", "", lambda own: [_is_sized(*one) for one in _channels(own)]),
    (f"of these: size within {100 * _SIZE:.0f} %", "all", lambda own: _near(own, "size", 1 - _SIZE, 1 + _SIZE)),
    (f"of these: memory within a factor of {_MEMORY:.0f}", "all",
     lambda own: _near(own, "memory", 1 / _MEMORY, _MEMORY)),
    ("of these: size in its interval", "90 to 98 %", lambda own: _within(own, "size", "")),
    ("of these: memory in its interval", "90 to 98 %", lambda own: _within(own, "memory", "memory_")),
    ("channels without gusts: residual is gusts alone", "0", _gusts_where_none_are),
)  # fmt: skip
"""Name, target, and what gives the flags of sets in one air."""
