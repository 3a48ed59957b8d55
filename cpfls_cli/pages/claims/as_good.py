"""Whether one setting of a sweep is as good as another."""

from __future__ import annotations

import numpy as np

from cpfls_cli.pages.claims.claim import Claim
from cpfls_cli.pages.claims.paired import PairedRatio, paired_ratio
from cpfls_cli.pages.swept_setting import SweptSetting
from cpfls_cli.pages.table_5 import PRINTED, PrintedColumn
from cpfls_cli.report.numbers import number


def printed_ratio(column: PrintedColumn, reference: PrintedColumn) -> float:
    """Divide the mean squared errors of two columns of Table 5."""
    return float(column.mse_of_runs[0]) / float(reference.mse_of_runs[0])


AS_GOOD = max(printed_ratio(column, PRINTED[1]) for column in PRINTED[2:5])
"""Largest ratio of mean squared errors in Table 5 between settings that the paper calls equally good: 4/3."""

RULE = (
    f"Ratio of the mean squared errors, paired by seed, with its 95 % interval. Pass: all of it at most "
    f"{number(AS_GOOD, 3)}, the largest ratio that the paper prints and calls no difference; fail: all of it above, or "
    "a seed that finds no model where the other setting finds one."
)


def as_good(claim: Claim, setting: SweptSetting, reference: SweptSetting, reason: str) -> Claim | None:
    """Judge whether a setting is as good as another.

    Parameters
    ----------
    reason : str
        Of a failure.

    Returns
    -------
    Claim or None
        None where they have no finished runs of equal seeds.
    """
    found = paired_ratio(setting, reference)
    if not found.seeds:
        return None
    searched = f"{_seeds(found)} of {_sizes(setting, reference)} (population × generations).{_failed(found)}"
    if np.isinf(found.ratio):
        return claim.decided(False, f"no model for {found.failed} of {_seeds(found)}", searched)
    if np.isnan(found.low):
        return claim.undecided(times(found.ratio), f"{searched} Fewer than two seeds with models say nothing.")
    ours = f"{times(found.ratio)} ({number(found.low, 3)} to {number(found.high, 3)})"
    tested = f"{searched} Wilcoxon p that neither is better: {number(found.p_value, 2)}."
    if found.low <= AS_GOOD < found.high:
        return claim.undecided(ours, f"{tested} So few seeds cannot tell: the interval holds the bound.")
    if found.high > AS_GOOD:
        return claim.decided(False, ours, f"{tested} Worse than the paper's own margin: {reason}")
    lower = " The error is even lower." if found.high < 1.0 else ""
    return claim.decided(True, ours, f"{tested}{lower}")


def times(ratio: float) -> str:
    """Write a ratio of errors."""
    return f"{number(ratio, 3)} times the MSE"


def _seeds(found: PairedRatio) -> str:
    return f"{found.seeds} seed{'' if found.seeds == 1 else 's'}"


def _failed(found: PairedRatio) -> str:
    counts = {"this setting": found.failed, "the one beside it": found.reference_failed}
    return "".join(f" No model in {count} of them with {whose}." for whose, count in counts.items() if count)


def _sizes(setting: SweptSetting, reference: SweptSetting) -> str:
    sizes = dict.fromkeys(f"{s.population} × {s.generations}" for s in (setting, reference))
    return " against ".join(sizes)
