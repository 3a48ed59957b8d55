"""Estimated against hidden coefficients, and gaps before and after, as Markdown."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise

import numpy as np

from benchmarks.blind_study.score import RIGHT, exact, numbers
from benchmarks.blind_study.text import percent, table

_LIKELY = (0.01, 0.05, 0.2, 0.5, 0.8, 0.95, 2.0)
_CLOSE = 0.05
_NEAR = 0.15
_LEVELS = ("low", "mid", "high")

_EARLIER = {
    "com_offset": "40.2 -> 1.01", "motor_lag": "23.0 -> 1.02", "wind": "17.7 -> 1.02", "rotor_mismatch": "15.7 -> 1.03",
    "flapping_moment": "10.6 -> 1.02", "payload": "9.6 -> 1.5", "rotor_drag": "9.4 -> 1.0",
    "command_delay": "8.8 -> 1.0", "torque_bias": "7.8 -> 1.0", "vertical_descent": "7.4 -> 6.8",
    "inflow": "5.9 -> 1.0", "euler_axis_torque": "5.6 -> 1.0", "products_of_inertia": "5.1 -> 1.0",
    "rotor_acceleration": "3.9 -> 1.0", "battery_sag": "3.7 -> 1.0", "linear_damping": "3.6 -> 1.0",
    "quadratic_damping": "3.5 -> 1.0", "parasitic_drag": "3.3 -> 1.0", "rotor_gyroscopic": "2.6 -> 1.0",
    "ground_effect": "1.4 -> 1.0",
}  # fmt: skip
"""Held-out gap in floors of an earlier study with another simulator, mid white noise, medians."""


def number_totals(judged):
    """Give rows on coefficients for the table of targets."""
    found = [number for number in coefficients_of(judged) if exact(number)]
    close = [abs(number.error) <= _CLOSE for number in found if number.level == "mid"]
    inside = [number.inside for number in found]
    return [
        ("coefficients within 5 % at mid noise", percent(close), "all"),
        ("95 % intervals that hold the hidden value", percent(inside), "90 to 98 %"),
    ]


def coefficient_table(judged):
    """Write errors and coverage of each coefficient of single effects that were named exactly right.

    The error is relative to the largest hidden number of the same unit, so that the small component of a vector does
    not count for more than the vector.
    """
    rows = []
    by_name = defaultdict(list)
    for number in coefficients_of(judged):
        by_name[number.effect, number.name].append(number)
    for (effect, name), own in sorted(by_name.items()):
        errors = {level: [n.error for n in own if n.level == level] for level in _LEVELS}
        shown = [_spread(errors[level]) for level in _LEVELS]
        close = [abs(error) <= _CLOSE for error in errors["mid"]]
        told = effect if exact(own[0]) else f"{effect} (another form)"
        rows.append((told, name, *shown, percent(close), percent([n.inside for n in own])))
    heads = [f"{level}: median, largest error" for level in _LEVELS]
    return table(("effect", "coefficient", *heads, "within 5 % at mid", "in the interval"), rows)


def coverage_table(judged):
    """Write, effect by effect, how many coefficients lie in their intervals and within 15 %."""
    by_effect = defaultdict(list)
    for number in coefficients_of(judged):
        by_effect[number.effect].append(number)
    rows = []
    for effect, own in sorted(by_effect.items()):
        inside, near = [n.inside for n in own], [abs(n.error) <= _NEAR for n in own]
        rows.append((effect, percent(inside), percent(near), _spread([n.error for n in own])))
    return table(("effect", "in the interval", "within 15 %", "median, largest error"), rows)


def gap_table(judged):
    """Write the held-out torque gap of each effect before and after, medians over draws, by noise."""
    rows = []
    by_effect = defaultdict(list)
    for each in judged:
        if "gap_before" in each.said and each.key["truth"]:
            by_effect[each.key["truth"][0]].append(each)
    for effect, own in by_effect.items():
        cells = [_shrunk([each for each in own if each.key["level"] == level]) for level in _LEVELS]
        rows.append((effect, *cells, _EARLIER.get(effect, "")))
    return table(("effect", *(f"{level} noise" for level in _LEVELS), "earlier study, mid"), rows)


def likely_table(judged):
    """Hold how likely listed sets were said to be against how many of them were what is hidden.

    Of one to three effects of the catalogue, where the truth is among the sets compared.
    """
    pairs = []
    for each in judged:
        listed = [(own["likely"], set(own["effects"]) == each.truth) for own in each.said.get("sets", ())]
        pairs += listed if each.key["group"] in ("single", "pair", "triple") and any(true for _, true in listed) else []
    rows = []
    for low, high in pairwise(_LIKELY):
        own = [(likely, true) for likely, true in pairs if low <= likely < high]
        told = f"{sum(likely for likely, _ in own):.1f}"
        rows.append((f"{low:.0%} to {min(high, 1):.0%}", len(own), told, sum(true for _, true in own)))
    return table(("said to be likely", "sets", "of them right, as said", "right"), rows if pairs else [])


def coefficients_of(judged):
    """List coefficients of single effects that were named exactly right."""
    single = [each for each in judged if each.key["group"] == "single" and each.outcome == RIGHT]
    return [number for each in single for number in numbers(each)]


def inside(found, effect):
    """Tell which coefficients of an effect lie in their intervals."""
    return [number.inside for number in found if number.effect == effect]


def _spread(errors):
    if not errors:
        return ""
    return f"{100 * np.median(np.abs(errors)):.1f} %, {100 * np.max(np.abs(errors)):.0f} %"


def _shrunk(judged):
    if not judged:
        return ""
    before, after = (np.median([each.floors(when) for each in judged]) for when in ("before", "after"))
    return f"{before:.1f} -> {after:.2f}"
