"""Two settings compared seed by seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student
from scipy.stats import wilcoxon

from cpfls_cli.arrays import Array
from cpfls_cli.pages.swept_setting import SweptSetting

_CONFIDENCE = 0.95


@dataclass(frozen=True)
class PairedRatio:
    """How many times larger an error is with one setting than with another.

    Attributes
    ----------
    seeds : int
        Pairs.
    failed, reference_failed : int
        Pairs in which the setting, or the reference, found no model.
    ratio, low, high : float
        Ratio of geometric means over the pairs with two models, and its 95 % interval; the interval is NaN for fewer
        than two such pairs. All are infinite where the setting failed and the reference did not: no model is an
        infinite error.
    p_value : float
        Of Wilcoxon's signed-rank test that neither setting is better; NaN for fewer than two pairs.
    """

    seeds: int
    failed: int
    reference_failed: int
    ratio: float
    low: float
    high: float
    p_value: float


def paired_ratio(setting: SweptSetting, reference: SweptSetting) -> PairedRatio:
    """Compare the mean squared errors of two settings over the seeds that both were searched with.

    With ``d_i = log(mse_i / mse_i')`` over n seeds the ratio is ``exp(mean d)`` and its interval
    ``exp(mean d +- t_{n-1, 0.975} s_d / sqrt n)``.
    """
    both, places, others = np.intersect1d(setting.seeds, reference.seeds, return_indices=True)
    ours, theirs = setting.mse[places, 0], reference.mse[others, 0]
    found, found_theirs = np.isfinite(ours), np.isfinite(theirs)
    logs = np.log(ours[found & found_theirs]) - np.log(theirs[found & found_theirs])
    failed = int(np.sum(~found)), int(np.sum(~found_theirs))
    if np.any(found_theirs & ~found):
        return PairedRatio(len(both), *failed, np.inf, np.inf, np.inf, float("nan"))
    mean = float(np.mean(logs)) if len(logs) else float("nan")
    half = _half_width(logs)
    p_value = float(wilcoxon(logs).pvalue) if len(logs) > 1 and logs.any() else float("nan")
    low, ratio, high = np.exp([mean - half, mean, mean + half])
    return PairedRatio(len(both), *failed, float(ratio), float(low), float(high), p_value)


def _half_width(logs: Array) -> float:
    if len(logs) < 2:
        return float("nan")
    quantile = student.ppf(0.5 + 0.5 * _CONFIDENCE, len(logs) - 1)
    return float(quantile * np.std(logs, ddof=1) / np.sqrt(len(logs)))
