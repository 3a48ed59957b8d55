"""Claims of the paper that compare searches seed by seed: fewer samples, a smaller search, the classic fuzzy system."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from scipy.special import stdtrit

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.sweep import ALL_SAMPLES, SettingRuns
from cpfls_cli.pages.claims import Claim, Measurement, decided, not_measured, undecided
from cpfls_cli.pages.printed import TABLE_5, PrintedColumn
from cpfls_cli.pages.source import Sources
from cpfls_cli.pages.sweep import joined_sweeps
from cpfls_cli.report.numbers import number

_CONFIDENCE = 0.95
_FLS, _FULL, *_REDUCED, _SMALL = TABLE_5
_LARGE = _REDUCED[-1]


def _printed_ratio(column: PrintedColumn, reference: PrintedColumn) -> float:
    """Divide the mean squared errors of two columns of Table 5."""
    return float(column.mse_of_runs[0]) / float(reference.mse_of_runs[0])


AS_GOOD = max(_printed_ratio(column, _FULL) for column in _REDUCED)
"""Largest ratio of mean squared errors in Table 5 between settings that the paper calls equally good: 4/3."""

_RULE = (
    f"Ratio of the mean squared errors, paired by seed, with its 95 % interval. Pass: all of it at most "
    f"{number(AS_GOOD, 3)}, the largest ratio that the paper prints and calls no difference; fail: all of it above, or "
    "a seed that finds no model where the other setting finds one."
)


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


def paired_ratio(setting: SettingRuns, reference: SettingRuns) -> PairedRatio:
    """Compare the mean squared errors of two settings over the seeds that both were searched with.

    With ``d_i = log(mse_i / mse_i')`` over n seeds the ratio is ``exp(mean d)`` and its interval
    ``exp(mean d +- t_{n-1, 0.975} s_d / sqrt n)``.
    """
    both, runs, others = np.intersect1d(setting.seeds, reference.seeds, return_indices=True)
    ours, theirs = setting.errors[runs, 0], reference.errors[others, 0]
    known, known_theirs = np.isfinite(ours), np.isfinite(theirs)
    logs = np.log(ours[known & known_theirs]) - np.log(theirs[known & known_theirs])
    failed = int(np.sum(~known)), int(np.sum(~known_theirs))
    if np.any(known_theirs & ~known):
        return PairedRatio(len(both), *failed, np.inf, np.inf, np.inf, float("nan"))
    mean = float(np.mean(logs)) if len(logs) else float("nan")
    half = _half_width(logs)
    p_value = _p_value(logs)
    low, ratio, high = np.exp([mean - half, mean, mean + half])
    return PairedRatio(len(both), *failed, float(ratio), float(low), float(high), p_value)


def _p_value(logs: Array) -> float:
    # As long to load as all else of a report that compares no sweeps.
    from scipy.stats import wilcoxon

    return float(wilcoxon(logs).pvalue) if len(logs) > 1 and logs.any() else float("nan")


def _half_width(logs: Array) -> float:
    if len(logs) < 2:
        return float("nan")
    quantile = stdtrit(len(logs) - 1, 0.5 + 0.5 * _CONFIDENCE)
    return float(quantile * np.std(logs, ddof=1) / np.sqrt(len(logs)))


def _as_good(setting: SettingRuns, reference: SettingRuns, reason: str) -> Measurement | None:
    """Judge whether a setting is as good as another; None where they have no finished runs of equal seeds.

    Parameters
    ----------
    reason : str
        Of a failure.
    """
    paired = paired_ratio(setting, reference)
    if not paired.seeds:
        return None
    searched = f"{_seeds(paired)} of {_sizes(setting, reference)} (population × generations).{_failed(paired)}"
    if np.isinf(paired.ratio):
        return decided(False, f"no model for {paired.failed} of {_seeds(paired)}", searched)
    if np.isnan(paired.low):
        return undecided(_times(paired.ratio), f"{searched} Fewer than two seeds with models say nothing.")
    ours = f"{_times(paired.ratio)} ({number(paired.low, 3)} to {number(paired.high, 3)})"
    tested = f"{searched} Wilcoxon p that neither is better: {number(paired.p_value, 2)}."
    if paired.low <= AS_GOOD < paired.high:
        return undecided(ours, f"{tested} So few seeds cannot tell: the interval holds the bound.")
    if paired.high > AS_GOOD:
        return decided(False, ours, f"{tested} Worse than the paper's own margin: {reason}")
    lower = " The error is even lower." if paired.high < 1.0 else ""
    return decided(True, ours, f"{tested}{lower}")


def _times(ratio: float) -> str:
    return f"{number(ratio, 3)} times the MSE"


def _seeds(paired: PairedRatio) -> str:
    return f"{paired.seeds} seed{'' if paired.seeds == 1 else 's'}"


def _failed(paired: PairedRatio) -> str:
    counts = {"this setting": paired.failed, "the one beside it": paired.reference_failed}
    return "".join(f" No model in {count} of them with {whose}." for whose, count in counts.items() if count)


def _sizes(setting: SettingRuns, reference: SettingRuns) -> str:
    sizes = dict.fromkeys(f"{s.population} × {s.generations}" for s in (setting, reference))
    return " against ".join(sizes)


_Settings = Sequence[SettingRuns]
_Pairs = Callable[[_Settings], Iterator[tuple[SettingRuns, SettingRuns]]]


def _measured(
    pairs: _Pairs, lacking: Callable[[Sequence[_Settings]], str], command: str, reason: str
) -> Callable[[Sources], Measurement]:
    """Judge a claim on the first pair of settings that can; of several sweeps the one with the larger search does.

    Parameters
    ----------
    lacking : callable
        Names what is missing where no pair is found, from the settings of all sweeps.
    command : str
        What makes it.
    reason : str
        Of a failure.
    """

    def measure(sources: Sources) -> Measurement:
        sweeps = [sweep.record.settings for sweep in joined_sweeps(sources.sweeps)]
        sweeps.sort(key=lambda settings: -max(_chromosomes(setting) for setting in settings))
        for pair in chain.from_iterable(map(pairs, sweeps)):
            if (measurement := _as_good(*pair, reason)) is not None:
                return measurement
        return not_measured(lacking(sweeps), command)

    return measure


def _chromosomes(setting: SettingRuns) -> int:
    """Count the chromosomes of a search as the paper does."""
    return setting.population * setting.generations


def _reduced_claim(column: PrintedColumn) -> Claim:
    """Fewer samples, each set of them beside all samples."""

    def pairs(settings: _Settings) -> Iterator[tuple[SettingRuns, SettingRuns]]:
        for full in settings:
            for reduced in settings:
                equal = reduced.structure == full.structure == "cpfls" and reduced.size == full.size
                if equal and full.criterion == ALL_SAMPLES and reduced.samples == column.samples < full.samples:
                    yield reduced, full

    share = f"{column.samples} of {_FULL.samples} samples"
    return Claim(
        name=f"{column.samples} samples",
        where="Section 10",
        words="In average there is no significant difference in the identification quality for any of the reduced or "
        "the full data set",
        rule=_RULE,
        paper=_times(_printed_ratio(column, _FULL)),
        measure=_measured(
            pairs,
            lambda _: f"a sweep over {share} and all of them, of equal searches",
            "make reproduce",
            "least squares keeps the error small where it has samples.",
        ),
    )


REDUCED_CLAIMS = tuple(map(_reduced_claim, _REDUCED))


_TIMES_LARGER = 10.0
"""A search that is not ten times the other one tells nothing about the paper's, which is 53 times."""


def _small_beside_large(settings: _Settings) -> Iterator[tuple[SettingRuns, SettingRuns]]:
    for small in settings:
        for large in settings:
            equal = small.structure == large.structure == "cpfls" and small.samples == large.samples
            is_small = small.size == (_SMALL.population, _SMALL.generations)
            if equal and is_small and _chromosomes(large) >= _TIMES_LARGER * _chromosomes(small):
                yield small, large


def _no_larger_search(sweeps: Sequence[_Settings]) -> str:
    lacking = f"a search on equal samples with ten times the chromosomes of {_SMALL.population} × {_SMALL.generations}"
    sizes = sorted({setting.size for settings in sweeps for setting in settings})
    return f"{lacking}; here are {', '.join(f'{p} × {g}' for p, g in sizes)}" if sizes else lacking


SMALLER_SEARCH_CLAIM = Claim(
    name="Smaller search",
    where="Section 10",
    words="The identification result is still very good when reducing the population size to 75 and generations "
    "evaluated to 25",
    rule=f"{_RULE} The other search must have ten times as many chromosomes (the paper's: 53 times).",
    paper=_times(_printed_ratio(_SMALL, _LARGE)),
    measure=_measured(
        _small_beside_large,
        _no_larger_search,
        "make reproduce-full",
        "the larger search still finds better partitions.",
    ),
)


def _periodic_beside_classic(settings: _Settings) -> Iterator[tuple[SettingRuns, SettingRuns]]:
    for periodic in settings:
        for classic in settings:
            kinds = (periodic.structure, classic.structure) == ("cpfls", "fls")
            learned = periodic.criterion == classic.criterion == ALL_SAMPLES
            if kinds and learned and periodic.size == classic.size:
                yield periodic, classic


CLASSIC_CLAIM = Claim(
    name="cpFLS and FLS",
    where="Section 10",
    words="There is neither significant quality, nor identification performance degradation when using the new "
    "cpFLS compared to the simple FLS method described in [14]",
    rule=_RULE,
    paper=_times(_printed_ratio(_FULL, _FLS)),
    measure=_measured(
        _periodic_beside_classic,
        lambda _: "a sweep over cpFLS and FLS, all samples, equal searches",
        "make reproduce",
        "closing the circle makes one rule of the first and the last, which leaves fewer coefficients for a path of "
        "small angles. What it gains lies one period away, where this is not judged.",
    ),
)
