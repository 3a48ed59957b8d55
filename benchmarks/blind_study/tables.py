"""What a study found, as Markdown."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable

from benchmarks.blind_study import score
from benchmarks.blind_study.air_tables import air_by_channel, air_coverage, air_totals
from benchmarks.blind_study.number_tables import coefficient_table, gap_table, number_totals
from benchmarks.blind_study.score import OUTCOMES, RIGHT
from benchmarks.blind_study.text import NONE_TRIED, percent, table

_AS_ASKED = {
    "lacking": "log lacks a signal: no false name, and a rival comes with what to log",
    "drag_factor": "drag factor 15 to 30 % off: exactly right",
    "attack": "log attacked: exactly right",
    "differing": "effect in the flights of one role: these flights differ",
    "pybullet": "physics of another simulator: no name but the nearest, no number that nobody believes",
}
_LIMITED = ("hover", "no_velocity", "no_force")
_OUTSIDE = (
    *("NAMED", "AMBIGUOUS", "PARTIAL", "UNEXPLAINED", "CONTRADICTED"),
    *("FLIGHTS_DIFFER", "NO_GAP", "NOT_EXCITED", "ERROR"),
)


def tables(judged):
    """Write all tables of a study."""
    parts = (
        ("Totals against the targets", totals(judged)),
        ("In gusts", air_totals(judged)),
        ("Intervals in gusts", air_coverage(judged)),
        ("Gusts by channel", air_by_channel(judged)),
        ("Outcomes by group and noise", _outcomes(judged)),
        ("One effect hidden: what was named", _confusion(_of(judged, "single"))),
        ("One effect hidden: by vehicle", _vehicles(_of(judged, "single"))),
        ("Nothing hidden: false names", _false_names(_of(judged, "none"))),
        ("Outside the catalogue", _outside(_with_outside(judged))),
        ("Forms that differ from the catalogue's", _forms(_of(judged, "form"))),
        ("Pairs and triples within the catalogue", _confusion(_several(judged))),
        ("One effect over a background of many", _background(_of(judged, "background"))),
        ("Hover alone, no velocity, no force", _confusion(_of(judged, *_LIMITED))),
        ("Logs, numbers and simulators that are not as they should be", _as_asked(_of(judged, *_AS_ASKED))),
        ("Coefficients and their 95 % intervals", coefficient_table(judged)),
        ("Held-out torque gap in floors", gap_table(_of(judged, "single"))),
        ("Simpler procedures on the same columns", _simpler(judged)),
        ("Every miss", misses(judged)),
    )
    return "\n\n".join(f"## {title}\n\n{text}" for title, text in parts if text) + "\n"


def totals(judged):
    """Write the figures that a study is held against."""
    single, none = _of(judged, "single"), _of(judged, "none")
    outside = _with_outside(_of(judged, "outside"))
    right = [each.outcome == RIGHT for each in single]
    seen = [each.outcome == RIGHT for each in single if each.visible >= score.VISIBLE]
    rows = [
        ("one effect: exactly right", percent(right), ""),
        (f"one effect with a torque of {score.VISIBLE} floors or more: exactly right", percent(seen), "at least 96 %"),
        ("one effect: exactly right, coloured noise", percent(_right(single, "coloured")), ""),
        ("any group: wrong name", percent([each.wrong_name for each in judged]), "0"),
        ("any group but outside: a false name", percent([each.false_name for each in _inside(judged)]), "1 in 300"),
        ("nothing hidden: false name", percent([bool(each.names) for each in none]), "1 in 300"),
        ("nothing hidden: a gap without a name", percent([each.outcome == score.REFUSED for each in none]), ""),
        ("outside the catalogue: NAMED", percent([each.verdict == "NAMED" for each in outside]), "at most 2 %"),
        ("two or three effects: all named", percent([each.outcome == RIGHT for each in _several(judged)]), "92 %"),
        *((told, percent([each.good for each in _of(judged, group)]), "all") for group, told in _AS_ASKED.items()),
        ("any group: numbers at bounds or effects that cancel", percent([each.unphysical for each in judged]), "0"),
        *number_totals(judged),
        ("could not be judged", percent([each.outcome == score.ERROR for each in judged]), "0"),
    ]
    return table(("", "found", "target"), [row for row in rows if row[1] != NONE_TRIED])


def misses(judged):
    """Write the answers that are not those asked for, set by set."""
    rows = [_miss(each) for each in judged if not each.good or each.wrong_name or each.unphysical]
    columns = (
        "set",
        "case",
        "noise",
        "outcome",
        "verdict",
        "named (share, p)",
        "rivals",
        "hidden, floors",
        "gap, floors",
    )
    return table(columns, rows)


def _of(judged, *groups):
    return [each for each in judged if each.key["group"] in groups]


def _with_outside(judged):
    return [each for each in judged if each.key["outside"]]


def _several(judged):
    return [each for each in _of(judged, "pair", "triple") if not each.key["outside"]]


def _inside(judged):
    return [each for each in judged if not each.key["outside"]]


def _right(judged, kind):
    return [each.outcome == RIGHT for each in judged if each.key["kind"] == kind]


def _outcomes(judged):
    rows = []
    for group, own in _grouped(judged, lambda each: (each.key["group"], each.key["level"], each.key["kind"])).items():
        found = Counter(each.outcome for each in own)
        rows.append((*group, len(own), *(found[name] or "" for name in OUTCOMES)))
    return table(("group", "noise", "kind", "sets", *OUTCOMES), rows)


def _confusion(judged):
    """Write what was said of each hidden effect, by noise."""
    noises = sorted({_noise(each) for each in judged}, key=_rank)
    rows = []
    for hidden, own in _grouped(judged, _hidden).items():
        rows.append((hidden, *(_said([each for each in own if _noise(each) == noise]) for noise in noises)))
    return table(("hidden", *(" ".join(noise) for noise in noises)), rows)


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


def _false_names(judged):
    rows = []
    for group, own in _grouped(judged, lambda each: (each.key["level"], each.key["kind"])).items():
        rows.append((*group, percent([bool(each.names) for each in own]), _said(own)))
    return table(("noise", "kind", "false names", "said"), rows)


def _outside(judged):
    rows = []
    for hidden, own in _grouped(judged, lambda each: " + ".join([*each.key["outside"], *each.key["truth"]])).items():
        found = Counter(each.verdict for each in own)
        rows.append((hidden, *(found[verdict] or "" for verdict in _OUTSIDE), _often(own)))
    return table(("hidden", *_OUTSIDE, "names given"), rows)


def _forms(judged):
    rows = []
    for (form, nearest), own in _grouped(judged, lambda e: (*e.key["hidden"], *e.key["nearest"][:1])[-2:]).items():
        with_nearest = [each for each in own if nearest in each.names]
        alone = [each for each in with_nearest if len(each.names) == 1]
        other = [each for each in own if each.names and nearest not in each.names]
        quiet = len(own) - len(with_nearest) - len(other)
        rows.append(
            (form, nearest, len(own), len(alone), len(with_nearest) - len(alone), len(other), quiet, _said(own))
        )
    return table(("form", "nearest", "sets", "nearest alone", "and more", "another", "no name", "said"), rows)


def _background(judged):
    rows = []
    for dominant, own in _grouped(judged, lambda each: each.key["dominant"]).items():
        first = [bool(each.names) and each.names[0] == dominant for each in own]
        somewhere = [dominant in each.names for each in own]
        false = [bool(each.false_names) for each in own]
        rows.append((dominant, percent(first), percent(somewhere), percent(false), _often(own)))
    return table(("dominant", "named first", "named", "a name of what is not hidden", "names given most"), rows)


def _vehicles(judged):
    rows = []
    for vehicle, own in _grouped(judged, lambda each: each.key["vehicle"]).items():
        seen = [each.outcome == RIGHT for each in own if each.visible >= score.VISIBLE]
        rows.append((vehicle, percent([each.outcome == RIGHT for each in own]), percent(seen)))
    return table(("vehicle", "exactly right", f"with {score.VISIBLE} floors or more"), rows)


def _as_asked(judged):
    """Write what was said of each fault of a log, by the name of its case."""
    rows = []
    for what, own in _grouped(judged, _fault).items():
        rows.append((*what, percent([each.good for each in own]), _said(own)))
    return table(("group", "what", "as asked", "said"), rows)


def _fault(each):
    # Names of cases are GROUP-VEHICLE-WHAT-DRAW.
    return each.key["group"], " ".join(each.key["case"].split("-")[2:-1])


def _simpler(judged):
    """Write how simpler procedures do where they were tried; they know neither sensors nor wrong vehicle numbers."""
    own = [each for each in judged if "baselines" in each.said]
    ways = {"this": lambda e: set(e.names), "BIC": lambda e: set(e.said["baselines"]["bic"])}
    ways["F test"] = lambda e: set(e.said["baselines"]["f_test"])
    rows = []
    for name, way in ways.items():
        single = [each for each in _of(own, "single") if not each.truth & score.NOT_COLUMNS]
        rows.append(
            (
                name,
                percent([way(each) == each.truth for each in single]),
                percent([way(each) > each.truth for each in single]),
                percent([bool(way(each)) and not way(each) & each.truth for each in single]),
                percent([bool(way(each)) for each in _of(own, "none")]),
                percent([bool(way(each)) and _certain(name, each) for each in _of(own, "outside")]),
            )
        )
    columns = (
        "way",
        "exactly right",
        "right and more",
        "wrong",
        "nothing hidden: a name",
        "outside: certain of a name",
    )
    return table(columns, rows)


def _certain(way, each):
    # Simpler procedures have no way to say that their names are not all.
    return way != "this" or each.verdict in score.CERTAIN


def _miss(each):
    named = ", ".join(f"{e['name']} ({e['share']:.2f}, {e['p_value']:.1g})" for e in each.said["effects"])
    rivals = ", ".join(sorted({rival["name"] for rival in each.said.get("alternatives", ())}))
    gap, hidden = "", ""
    if "gap_before" in each.said:
        gap, hidden = f"{each.floors('before'):.2f} -> {each.floors('after'):.2f}", f"{each.visible:.2f}"
    told = each.said.get("error", named)
    return each.key["set"], each.key["case"], each.noise, each.outcome, each.verdict, told, rivals, hidden, gap


def _often(judged):
    names = Counter(name for each in judged for name in each.names)
    return ", ".join(f"{name} {count}" for name, count in names.most_common(4))


def _noise(each):
    return each.key["level"], each.key["kind"]


def _rank(noise):
    return ("low", "mid", "high").index(noise[0]), noise[1] != "white"


def _grouped(judged: Iterable, key):
    groups = defaultdict(list)
    for each in judged:
        groups[key(each)].append(each)
    return groups
