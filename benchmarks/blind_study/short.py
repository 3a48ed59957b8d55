"""What a small study says on one page: totals, groups, coverage by effect, how likely sets are, and every miss."""

from __future__ import annotations

from collections import Counter, defaultdict

import numpy as np

from benchmarks.blind_study.air_tables import air_by_channel, air_coverage, air_totals
from benchmarks.blind_study.number_tables import coverage_table, likely_table
from benchmarks.blind_study.score import UNSEEN
from benchmarks.blind_study.tables import misses, totals
from benchmarks.blind_study.text import table


def short(judged):
    """Write one page on a study."""
    seconds = [each.said["seconds"] for each in judged]
    took = f"{len(judged)} sets, {np.median(seconds):.1f} s a set (median), {sum(seconds):.0f} s in all"
    in_gusts = air_totals(judged), air_coverage(judged), air_by_channel(judged)
    parts = (
        took,
        totals(judged),
        *in_gusts,
        _groups(judged),
        coverage_table(judged),
        likely_table(judged),
        misses(judged),
    )
    return "\n\n".join(part for part in parts if part) + "\n"


def _groups(judged):
    """Count by group: as asked for, below the floor, certain of a false name, certain of nothing but such names."""
    by_group = defaultdict(list)
    for each in judged:
        by_group[each.key["group"]].append(each)
        by_group["all"].append(each)
    by_group["all"] = by_group.pop("all")
    rows = []
    for group, own in by_group.items():
        said = Counter(each.verdict for each in own)
        rows.append(
            (
                group,
                len(own),
                sum(each.good for each in own),
                sum(each.outcome == UNSEEN for each in own) or "",
                sum(each.wrong_name for each in own) or "",
                sum(each.false_name for each in own) or "",
                sum(each.unphysical for each in own) or "",
                ", ".join(f"{verdict} {count}" for verdict, count in said.most_common()),
            )
        )
    return table(("group", "sets", "as asked", "not visible", "wrong name", "false name", "unphysical", "said"), rows)
