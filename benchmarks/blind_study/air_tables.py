"""What was said in gusts: each measure by the level of the gusts and by what tells them from the vehicle."""

from __future__ import annotations

import numpy as np

from benchmarks.blind_study.number_tables import coefficients_of, inside
from benchmarks.blind_study.score import RIGHT, VISIBLE, exact
from benchmarks.blind_study.text import NONE_TRIED, percent, table

_SIZE, _MEMORY = 0.3, 2.0
"""Relative error of a size, and ratio of memories, that are good enough."""
_CHANNELS = ("torque x", "torque y", "torque z", "force x", "force y", "force z")
_AIR = frozenset({"gust_turbulence"})
"""What is hidden outside the catalogue and is gusts, too."""


def air_totals(judged):
    """Write what a study in gusts is held against, one column for each air; nothing for a study in still air alone."""
    rows = [
        ("sets", str, len, ""),
        ("nothing hidden: false name", percent, _empty, "1 in 300"),
        (f"one effect of {VISIBLE} floors or more: exactly right", percent, _visible, "96 % in still air"),
        ("one effect above the air's share: exactly right", percent, _above, "96 %"),
        ("any group: wrong name", percent, lambda own: [each.wrong_name for each in own], "0"),
        ("any group but outside: a false name", percent, _false, "1 in 300"),
        ("outside the catalogue: NAMED", percent, _outside, "at most 2 %"),
        ("two or three effects: all named", percent, _several, "92 %"),
        ("95 % intervals that hold the hidden value", percent, _held, "90 to 98 %"),
        ("channels in gusts: told to be all that is left", percent, _told, ""),
        ("channels in gusts: told how large", percent, _sized, ""),
        (f"of these: size within {100 * _SIZE:.0f} %", percent, lambda own: _near(own, "size"), "all"),
        (f"of these: memory within a factor of {_MEMORY:.0f}", percent, lambda own: _near(own, "memory"), "all"),
        ("of these: size in its interval", percent, lambda own: _within(own, ""), "90 to 98 %"),
        ("of these: memory in its interval", percent, lambda own: _within(own, "memory_"), "90 to 98 %"),
        ("channels without gusts: told to be all that is left", percent, _told_in_vain, "0"),
    ]
    airs = _airs(judged)
    if all(each.usual for each in judged):
        return ""
    cells = [(name, [form(measure(own)) for own in airs.values()], target) for name, form, measure, target in rows]
    return table(("", *airs, "target"), [(name, *own, target) for name, own, target in cells if {*own} != {NONE_TRIED}])


def air_coverage(judged):
    """Write how many coefficients of an effect lie in their intervals, one column for each air."""
    if all(each.usual for each in judged):
        return ""
    airs = {name: coefficients_of(own) for name, own in _airs(judged).items()}
    effects = sorted({number.effect for own in airs.values() for number in own})
    rows = [(name, *(_short(inside(own, name)) for own in airs.values())) for name in effects]
    return table(("effect: in the interval", *airs), rows)


def air_by_channel(judged):
    """Write what was found of the gusts of a channel over what is there: medians, then the range."""
    rows = []
    for name, own in _airs(judged).items():
        for channel, told in enumerate(_CHANNELS):
            found = [one for one in _channels(own) if one[1] == channel]
            sizes, memories = (
                [_ratio(*one, what, what) for one in found if _is_sized(*one)] for what in ("size", "memory")
            )
            if sizes:
                rows.append((name, told, f"{len(sizes)} of {len(found)}", _spread(sizes), _spread(memories)))
    return table(("air", "channel", "told how large", "size, found over true", "memory, found over true"), rows)


def _airs(judged):
    """Group sets by their air, still air first."""
    airs = {}
    for each in sorted(judged, key=lambda each: each.key.get("gusts", 0)):
        airs.setdefault(each.air, []).append(each)
    return airs


def _of(own, *groups):
    return [each for each in own if each.key["group"] in groups]


def _empty(own):
    return [bool(each.names) for each in _of(own, "none")]


def _visible(own):
    return [each.outcome == RIGHT for each in _of(own, "single") if each.visible >= VISIBLE]


def _above(own):
    return [each.outcome == RIGHT for each in _of(own, "single") if each.over_air >= 1]


def _false(own):
    return [each.false_name for each in own if not each.key["outside"]]


def _outside(own):
    return [each.verdict == "NAMED" for each in _of(own, "outside") if each.key["outside"]]


def _several(own):
    return [each.outcome == RIGHT for each in _of(own, "pair", "triple") if not each.key["outside"]]


def _held(own):
    return [number.inside for number in coefficients_of(own) if exact(number)]


def _channels(own):
    """List channels of judged sets that have gusts."""
    return [(each, channel) for each in own if each.key.get("gusts") for channel in range(len(_CHANNELS))]


def _is_told(each, channel):
    return bool(each.said.get("air")) and each.said["air"]["told"][channel]


def _told(own):
    return [_is_told(*one) for one in _channels(own)]


def _is_sized(each, channel):
    return bool(each.said.get("air")) and each.said["air"]["size"][channel] is not None


def _sized(own):
    return [_is_sized(*one) for one in _channels(own)]


def _told_in_vain(own):
    still = [each for each in own if not each.key.get("gusts") and not _AIR & {*each.key["hidden"]}]
    return [_is_told(each, channel) for each in still for channel in range(len(_CHANNELS))]


def _ratio(each, channel, said, what):
    found = each.said["air"][said][channel]
    return np.inf if found is None else found / each.key["air"][what][channel]


def _near(own, what):
    low, high = (1 - _SIZE, 1 + _SIZE) if what == "size" else (1 / _MEMORY, _MEMORY)
    return [low <= _ratio(*one, what, what) <= high for one in _channels(own) if _is_sized(*one)]


def _within(own, prefix):
    what, told = "memory" if prefix else "size", [one for one in _channels(own) if _is_sized(*one)]
    # What is told with no bound is infinite.
    return [_ratio(*one, f"{prefix}low", what) <= 1 <= _ratio(*one, f"{prefix}high", what) for one in told]


def _spread(ratios):
    return f"{np.median(ratios):.2f}, {min(ratios):.2f} to {max(ratios):.2f}"


def _short(flags):
    return f"{sum(flags)} of {len(flags)}" if flags else ""
