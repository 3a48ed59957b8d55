"""What a study found, as Markdown."""

from __future__ import annotations

from collections import Counter, defaultdict
from itertools import pairwise

import numpy as np

from benchmarks.blind_study import score
from benchmarks.blind_study.score import RIGHT, exact, numbers

NONE_TRIED = "none tried"
_AS_ASKED = {
    "lacking": "log lacks a signal: no false name, and a rival comes with what to log",
    "drag_factor": "drag factor 15 to 30 % off: exactly right",
    "attack": "log attacked: exactly right",
    "differing": "effect in the flights of one role: these flights differ",
    "pybullet": "physics of another simulator: no name but the nearest, no number that nobody believes",
}
_OUTSIDE = (
    ["NAMED", "AMBIGUOUS", "PARTIAL", "UNEXPLAINED", "CONTRADICTED", "FLIGHTS_DIFFER", "NO_GAP", "NOT_EXCITED", "ERROR"]
)  # fmt: skip
_LIKELY = (0.01, 0.05, 0.2, 0.5, 0.8, 0.95, 2.0)
_LEVELS = ("low", "mid", "high")
_CLOSE = 0.05


def table(heads, rows):
    """Write a table, its heads with " | " between them; nothing where there are no rows."""
    rows = list(rows)
    if not rows:
        return ""
    heads = heads.split(" | ")
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("|", "/") for cell in line) + " |" for line in lines)


def percent(flags):
    """Write how many are true, and of how many."""
    flags = list(flags)
    return f"{sum(flags)} of {len(flags)} ({100 * sum(flags) / len(flags):.1f} %)" if flags else NONE_TRIED


def tables(judged, more):
    """Write all tables of a study, and more by their titles."""
    seconds, single = [each.said["seconds"] for each in judged], of(judged, "single")
    parts = {
        "Totals against the targets": totals(judged),
        **more,
        "As asked, by group": _groups(judged),
        "One effect hidden: what was named": _confusion(single),
        "One effect hidden: by vehicle": _vehicles(single),
        "Nothing hidden: false names": _false_names(of(judged, "none")),
        "Outside the catalogue": _outside([each for each in judged if each.key["outside"]]),
        "Forms that differ from the catalogue's": _forms(of(judged, "form")),
        "Pairs and triples within the catalogue": _confusion(several(judged)),
        "One effect over a background of many": _background(of(judged, "background")),
        "Hover alone, no velocity, no force": _confusion(of(judged, "hover", "no_velocity", "no_force")),
        "Logs, numbers and simulators that are not as they should be": _faults(of(judged, *_AS_ASKED)),
        "Coefficients and their 95 % intervals": _coefficients(judged),
        "Held-out torque gap in floors": _gaps(single),
        "How likely sets of effects were said to be": _likely(judged),
        "Every miss": _misses(judged),
    }
    took = f"{len(judged)} sets, {np.median(seconds):.1f} s a set (median), {sum(seconds):.0f} s in all"
    return "\n\n".join([took, *(f"## {title}\n\n{text}" for title, text in parts.items() if text)]) + "\n"


def totals(judged):
    """Write the figures that a study is held against."""
    single, none, inside = of(judged, "single"), of(judged, "none"), [e for e in judged if not e.key["outside"]]
    outside = [each for each in of(judged, "outside") if each.key["outside"]]
    seen = [each for each in single if each.visible >= score.VISIBLE]
    known = [number for number in coefficients_of(judged) if exact(number)]
    close = [abs(number.error) <= _CLOSE for number in known if number.level == "mid"]
    rows = [
        ("one effect: exactly right", _right(single), ""),
        (f"one effect with a torque of {score.VISIBLE} floors or more: exactly right", _right(seen), "at least 96 %"),
        ("one effect: exactly right, coloured noise", _right(e for e in single if e.key["kind"] == "coloured"), ""),
        ("any group: wrong name", percent(each.wrong_name for each in judged), "0"),
        ("any group but outside: a false name", percent(each.false_name for each in inside), "1 in 300"),
        ("nothing hidden: false name", percent(bool(each.names) for each in none), "1 in 300"),
        ("nothing hidden: a gap without a name", percent(each.outcome == score.REFUSED for each in none), ""),
        ("outside the catalogue: NAMED", percent(each.verdict == "NAMED" for each in outside), "at most 2 %"),
        ("two or three effects: all named", _right(several(judged)), "92 %"),
        *((label, percent(each.good for each in of(judged, group)), "all") for group, label in _AS_ASKED.items()),
        ("any group: numbers at bounds or effects that cancel", percent(each.unphysical for each in judged), "0"),
        ("coefficients within 5 % at mid noise", percent(close), "all"),
        ("95 % intervals that hold the hidden value", percent(number.inside for number in known), "90 to 98 %"),
        ("could not be judged", percent(each.outcome == score.ERROR for each in judged), "0"),
    ]
    return table(" | found | target", [row for row in rows if row[1] != NONE_TRIED])


def of(judged, *groups):
    """Take the sets of some groups."""
    return [each for each in judged if each.key["group"] in groups]


def several(judged):
    """Take the sets that hide two or three effects of the catalogue."""
    return [each for each in of(judged, "pair", "triple") if not each.key["outside"]]


def coefficients_of(judged):
    """List coefficients of single effects that were named exactly right."""
    return [number for each in of(judged, "single") if each.outcome == RIGHT for number in numbers(each)]


def grouped(judged, key):
    """Group sets, or numbers, by what a function gives."""
    groups = defaultdict(list)
    for each in judged:
        groups[key(each)].append(each)
    return groups


def _right(judged):
    return percent(each.outcome == RIGHT for each in judged)


def _groups(judged):
    """Count by group: as asked for, below the floor, certain of a false name, certain of nothing but such names."""
    rows = []
    for group, own in [*grouped(judged, lambda each: each.key["group"]).items(), ("all", judged)]:
        said = ", ".join(f"{verdict} {count}" for verdict, count in Counter(e.verdict for e in own).most_common())
        unseen = sum(each.outcome == score.UNSEEN for each in own)
        counts = (sum(getattr(e, what) for e in own) for what in ("wrong_name", "false_name", "unphysical"))
        rows.append((group, len(own), sum(e.good for e in own), *(count or "" for count in (unseen, *counts)), said))
    return table("group | sets | as asked | not visible | wrong name | false name | unphysical | said", rows)


def _confusion(judged):
    """Write what was said of each hidden effect, by noise."""
    noises = sorted({_noise(each) for each in judged}, key=lambda noise: (_LEVELS.index(noise[0]), noise[1] != "white"))
    rows = []
    for hidden, own in grouped(judged, _hidden).items():
        rows.append((hidden, *(_said([each for each in own if _noise(each) == noise]) for noise in noises)))
    return table(" | ".join(["hidden", *map(" ".join, noises)]), rows)


def _noise(each):
    return each.key["level"], each.key["kind"]


def _hidden(each):
    group = "" if each.key["group"] in ("single", "none", "pair", "triple") else f"{each.key['group']}: "
    return group + (" + ".join(each.key["truth"]) or "nothing")


def _said(judged):
    found = Counter(_answer(each) for each in judged)
    return ", ".join(f"{answer} {count}/{len(judged)}" for answer, count in found.most_common())


def _answer(each):
    names = "+".join(sorted(each.names, key=lambda name: name not in each.truth))
    if each.outcome == RIGHT and each.truth:
        return "right" if each.verdict == "NAMED" else "right, with rivals"
    return f"{each.verdict} {names}".strip()


def _vehicles(judged):
    rows = []
    for vehicle, own in grouped(judged, lambda each: each.key["vehicle"]).items():
        rows.append((vehicle, _right(own), _right(each for each in own if each.visible >= score.VISIBLE)))
    return table(f"vehicle | exactly right | with {score.VISIBLE} floors or more", rows)


def _false_names(judged):
    found = grouped(judged, _noise).items()
    rows = [(*noise, percent(bool(each.names) for each in own), _said(own)) for noise, own in found]
    return table("noise | kind | false names | said", rows)


def _outside(judged):
    rows = []
    for hidden, own in grouped(judged, lambda each: " + ".join([*each.key["outside"], *each.key["truth"]])).items():
        found = Counter(each.verdict for each in own)
        rows.append((hidden, *(found[verdict] or "" for verdict in _OUTSIDE), _often(own)))
    return table(" | ".join(["hidden", *_OUTSIDE, "names given"]), rows)


def _often(judged):
    names = Counter(name for each in judged for name in each.names)
    return ", ".join(f"{name} {count}" for name, count in names.most_common(4))


def _forms(judged):
    rows = []
    for (form, nearest), own in grouped(judged, lambda e: (*e.key["hidden"], *e.key["nearest"][:1])[-2:]).items():
        with_nearest = [each for each in own if nearest in each.names]
        alone = sum(len(each.names) == 1 for each in with_nearest)
        other = sum(bool(each.names) and nearest not in each.names for each in own)
        counts = alone, len(with_nearest) - alone, other, len(own) - len(with_nearest) - other
        rows.append((form, nearest, len(own), *counts, _said(own)))
    return table("form | nearest | sets | nearest alone | and more | another | no name | said", rows)


def _background(judged):
    rows = []
    for dominant, own in grouped(judged, lambda each: each.key["dominant"]).items():
        first = percent(each.names[:1] == (dominant,) for each in own)
        somewhere, false = percent(dominant in e.names for e in own), percent(bool(e.false_names) for e in own)
        rows.append((dominant, first, somewhere, false, _often(own)))
    return table("dominant | named first | named | a name of what is not hidden | names given most", rows)


def _faults(judged):
    """Write what was said of each fault of a log, by the name of its case: GROUP-VEHICLE-WHAT-DRAW."""
    found = grouped(judged, lambda each: (each.key["group"], " ".join(each.key["case"].split("-")[2:-1])))
    rows = [(*what, percent(each.good for each in own), _said(own)) for what, own in found.items()]
    return table("group | what | as asked | said", rows)


def _coefficients(judged):
    """Write errors and coverage of each coefficient of single effects that were named exactly right.

    The error is relative to the largest hidden number of the same unit, so that the small component of a vector does
    not count for more than the vector.
    """
    rows = []
    for (effect, name), own in sorted(grouped(coefficients_of(judged), lambda n: (n.effect, n.name)).items()):
        errors = {level: [n.error for n in own if n.level == level] for level in _LEVELS}
        close = percent(abs(error) <= _CLOSE for error in errors["mid"])
        label = effect if exact(own[0]) else f"{effect} (another form)"
        rows.append((label, name, *map(_spread, errors.values()), close, percent(n.inside for n in own)))
    heads = " | ".join(f"{level}: median, largest error" for level in _LEVELS)
    return table(f"effect | coefficient | {heads} | within 5 % at mid | in the interval", rows)


def _spread(errors):
    return f"{100 * np.median(np.abs(errors)):.1f} %, {100 * np.max(np.abs(errors)):.0f} %" if errors else ""


def _gaps(judged):
    """Write the held-out torque gap of each effect before and after, medians over draws, by noise."""
    rows = []
    judged = [each for each in judged if "gap_before" in each.said and each.key["truth"]]
    for effect, own in grouped(judged, lambda each: each.key["truth"][0]).items():
        by_level = [[each for each in own if each.key["level"] == level] for level in _LEVELS]
        rows.append((effect, *map(_shrunk, by_level)))
    return table(" | ".join(["effect", *(f"{level} noise" for level in _LEVELS)]), rows)


def _shrunk(judged):
    if not judged:
        return ""
    before, after = (np.median([each.floors(when) for each in judged]) for when in ("before", "after"))
    return f"{before:.1f} -> {after:.2f}"


def _likely(judged):
    """Hold how likely listed sets were said to be against how many of them were what is hidden.

    Of one to three effects of the catalogue, where the truth is among the sets compared.
    """
    pairs = []
    for each in of(judged, "single", "pair", "triple"):
        listed = [(own["likely"], set(own["effects"]) == each.truth) for own in each.said.get("sets", ())]
        pairs += listed if any(true for _, true in listed) else []
    rows = []
    for low, high in pairwise(_LIKELY if pairs else ()):
        own = [(likely, true) for likely, true in pairs if low <= likely < high]
        label = f"{sum(likely for likely, _ in own):.1f}"
        rows.append((f"{low:.0%} to {min(high, 1):.0%}", len(own), label, sum(true for _, true in own)))
    return table("said to be likely | sets | of them right, as said | right", rows)


def _misses(judged):
    """Write the answers that are not those asked for, set by set."""
    rows = [_miss(each) for each in judged if not each.good or each.wrong_name or each.unphysical]
    return table(
        "set | case | noise | outcome | verdict | named (share, p) | rivals | hidden, floors | gap, floors", rows
    )


def _miss(each):
    named = ", ".join(f"{e['name']} ({e['share']:.2f}, {e['p_value']:.1g})" for e in each.said["effects"])
    rivals = ", ".join(sorted({rival["name"] for rival in each.said.get("alternatives", ())}))
    gap, hidden = "", ""
    if "gap_before" in each.said:
        gap, hidden = f"{each.floors('before'):.2f} -> {each.floors('after'):.2f}", f"{each.visible:.2f}"
    label = each.said.get("error", named)
    return each.key["set"], each.key["case"], each.noise, each.outcome, each.verdict, label, rivals, hidden, gap
