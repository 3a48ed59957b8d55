"""Claims of the paper that compare searches seed by seed: fewer samples, a smaller search, the classic fuzzy system."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain

import numpy as np
from scipy.special import stdtrit

from benchmarks.paper.claims import Claim, Measurement, Searches, Settings, decided, not_measured, searches, undecided
from benchmarks.paper.printed import TABLE_5, TYPICAL_MAX_ERROR, TYPICAL_MSE, PrintedColumn
from benchmarks.paper.replicates import ALL_SAMPLES, Setting
from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.report.content import number, percent

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
    """How many times larger an error is with one setting than with another, over pairs of equal seeds.

    The ratio of geometric means over the pairs with two models, its 95 % interval (NaN for fewer than two such pairs)
    and the p-value of Wilcoxon's signed-rank test. All are infinite where the setting failed and the reference did not.
    """

    seeds: int
    failed: int
    reference_failed: int
    ratio: float
    low: float
    high: float
    p_value: float


def paired_ratio(setting: Setting, reference: Setting) -> PairedRatio:
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


def _as_good(setting: Setting, reference: Setting, reason: str) -> Measurement | None:
    """Judge whether a setting is as good as another; None where they have no finished runs of equal seeds."""
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


def _sizes(setting: Setting, reference: Setting) -> str:
    sizes = dict.fromkeys(f"{s.population} × {s.generations}" for s in (setting, reference))
    return " against ".join(sizes)


_Pairs = Callable[[Settings], Iterator[tuple[Setting, Setting]]]
_Lacking = Callable[[Searches], str]


def _claim(
    name: str, words: str, paper: str, pairs: _Pairs, lacking: _Lacking, command: str, reason: str, rule: str = ""
) -> Claim:
    """State a claim about two settings, judged on the first pair that can; the larger search comes first."""

    def of_searches(found: Searches) -> Measurement:
        for pair in chain.from_iterable(map(pairs, found)):
            if (measurement := _as_good(*pair, reason)) is not None:
                return measurement
        return not_measured(lacking(found), command)

    return _of_searches(name, "Section 10", words, f"{_RULE} {rule}".strip(), paper, of_searches)


def _of_searches(
    name: str, where: str, words: str, rule: str, paper: str, measure: Callable[[Searches], Measurement]
) -> Claim:
    return Claim(name, where, words, rule, paper, lambda sources: measure(searches(sources)), measure)


def _reduced_claim(column: PrintedColumn) -> Claim:
    """Fewer samples, each set of them next to all samples."""

    def pairs(settings: Settings) -> Iterator[tuple[Setting, Setting]]:
        for full in settings:
            for reduced in settings:
                equal = reduced.structure == full.structure == "cpfls" and reduced.size == full.size
                if equal and full.criterion == ALL_SAMPLES and reduced.samples == column.samples < full.samples:
                    yield reduced, full

    share = f"{column.samples} of {_FULL.samples} samples"
    return _claim(
        name=f"{column.samples} samples",
        words="In average there is no significant difference in the identification quality for any of the reduced or "
        "the full data set",
        paper=_times(_printed_ratio(column, _FULL)),
        pairs=pairs,
        lacking=lambda _: f"a sweep over {share} and all of them, of equal searches",
        command="make reproduce",
        reason="least squares keeps the error small where it has samples.",
    )


REDUCED_CLAIMS = tuple(map(_reduced_claim, _REDUCED))


_TIMES_LARGER = 10.0
"""A search that is not ten times the other one shows nothing about the paper's, which is 53 times."""


def _alike(one: Setting, other: Setting) -> bool:
    """Tell whether two settings search a periodic system on equally many samples."""
    return one.structure == other.structure == "cpfls" and one.samples == other.samples


def _small_beside_large(settings: Settings) -> Iterator[tuple[Setting, Setting]]:
    for small in settings:
        for large in settings:
            equal = _alike(small, large) and small.ranking == large.ranking
            is_small = small.size == (_SMALL.population, _SMALL.generations)
            if equal and is_small and large.chromosomes >= _TIMES_LARGER * small.chromosomes:
                yield small, large


def _no_larger_search(found: Searches) -> str:
    lacking = f"a search on equal samples with ten times the chromosomes of {_SMALL.population} × {_SMALL.generations}"
    sizes = sorted({setting.size for settings in found for setting in settings})
    return f"{lacking}; here are {', '.join(f'{p} × {g}' for p, g in sizes)}" if sizes else lacking


SMALLER_SEARCH_CLAIM = _claim(
    name="Smaller search",
    words="The identification result is still very good when reducing the population size to 75 and generations "
    "evaluated to 25",
    rule="The other search must have ten times as many chromosomes (the paper's: 53 times).",
    paper=_times(_printed_ratio(_SMALL, _LARGE)),
    pairs=_small_beside_large,
    lacking=_no_larger_search,
    command="make reproduce-larger",
    reason="the larger search still finds better partitions.",
)


def _periodic_beside_classic(settings: Settings) -> Iterator[tuple[Setting, Setting]]:
    for periodic in settings:
        for classic in settings:
            kinds = (periodic.structure, classic.structure) == ("cpfls", "fls")
            learned = periodic.criterion == classic.criterion == ALL_SAMPLES
            if kinds and learned and periodic.size == classic.size:
                yield periodic, classic


CLASSIC_CLAIM = _claim(
    name="cpFLS and FLS",
    words="There is neither significant quality, nor identification performance degradation when using the new "
    "cpFLS compared to the simple FLS method described in [14]",
    paper=_times(_printed_ratio(_FULL, _FLS)),
    pairs=_periodic_beside_classic,
    lacking=lambda _: "a sweep over cpFLS and FLS, all samples, equal searches",
    command="make reproduce",
    reason="closing the circle makes one rule of the first and the last, which leaves fewer coefficients for a path of "
    "small angles. What it gains lies one period away, where this is not judged.",
)


def _quantity_beside_pareto(settings: Settings) -> Iterator[tuple[Setting, Setting]]:
    for quantity in settings:
        for pareto in settings:
            rankings = quantity.ranking == "quantity-dominance" != pareto.ranking
            if rankings and _alike(quantity, pareto) and quantity.size == pareto.size:
                yield quantity, pareto


RANKING_CLAIM = _claim(
    name="Ranking by quantity",
    words="The achieved quality of non-dominated individuals … is at least as good as for classical Pareto based "
    "ranking method GAs",
    paper="at least as good",
    pairs=_quantity_beside_pareto,
    lacking=lambda _: "a sweep over both rankings, equal samples and searches",
    command="make reproduce",
    reason="the classical ranking finds better models here.",
)


def _periodic(found: Searches) -> list[Setting]:
    return [setting for setting in chain.from_iterable(found) if setting.structure == "cpfls"]


def _of_all_runs(values: Sequence[Array]) -> Array:
    """Join the values of settings; a run without a model reaches nothing."""
    gathered: Array = np.concatenate([np.zeros(0), *values])
    return np.nan_to_num(gathered, nan=np.inf)


_A_SWEEP = partial(not_measured, "a sweep over cpFLS", "make reproduce")


def _typical_errors(found: Searches) -> Measurement:
    mse, largest = (_of_all_runs([setting.errors[:, column] for setting in _periodic(found)]) for column in (0, 1))
    if not len(mse):
        return _A_SWEEP()
    ours = f"{number(float(np.median(mse)), 2)} (N m)², {number(float(np.median(largest)), 2)} N m"
    torque = max(setting.largest_torque for setting in _periodic(found))
    why = f"Medians of {len(mse)} models."
    if torque <= TYPICAL_MAX_ERROR:
        return undecided(ours, f"{why} No model at all would pass: no torque is above {number(torque, 2)} N m.")
    return decided(bool(np.median(mse) < TYPICAL_MSE and np.median(largest) < TYPICAL_MAX_ERROR), ours, why)


TYPICAL_ERRORS_CLAIM = _of_searches(
    "Typical errors",
    "Section 10",
    "the typical mean square error (MSE) is <1e-3, the typical maximum torque error (maxE) is <0.2 Nm",
    f"Medians over all runs of cpFLS. Pass: both below, on a flight with torques above {TYPICAL_MAX_ERROR} N m.",
    f"< {TYPICAL_MSE:g} (N m)², < {TYPICAL_MAX_ERROR:g} N m",
    _typical_errors,
)

_PRINTED_CONDITIONS = [
    float(condition)
    for column in TABLE_5
    for condition in (column.condition_number, column.condition_number_of_runs[0])
]
_LEAST_CONDITION, _LARGEST_CONDITION = min(_PRINTED_CONDITIONS), max(_PRINTED_CONDITIONS)


def _typical_condition(found: Searches) -> Measurement:
    conditions = _of_all_runs([setting.of("condition_number") for setting in _periodic(found)])
    if not len(conditions):
        return _A_SWEEP()
    median = float(np.median(conditions))
    low, high = np.quantile(conditions, [0.25, 0.75])
    why = f"{len(conditions)} models, half of them between {number(float(low), 3)} and {number(float(high), 3)}."
    return decided(_LEAST_CONDITION <= median <= _LARGEST_CONDITION, number(median, 3), why)


TYPICAL_CONDITION_CLAIM = _of_searches(
    "Typical condition number",
    "Section 10",
    "the typical condition number (Cond) of … the matrix of linear equations is ~4-5000",
    "Median condition number over all runs of cpFLS. Pass: between the smallest and the largest of Table 5, "
    f"{number(_LEAST_CONDITION, 4)} and {number(_LARGEST_CONDITION, 4)}.",
    "4000 to 5000",
    _typical_condition,
)

_BEFORE_THE_END = 0.8


def _convergence(found: Searches) -> Measurement:
    sizes: dict[tuple[int, int], list[IntArray]] = {}
    for setting in _periodic(found):
        large = setting.population >= _SMALL.population and setting.generations >= _SMALL.generations
        if large:
            sizes.setdefault(setting.size, []).append(setting.of("settled"))
    if not sizes:
        return not_measured(f"a search of {_SMALL.population} × {_SMALL.generations} or more", "make reproduce")
    medians = {size: float(np.median(np.concatenate(settled))) for size, settled in sorted(sizes.items())}
    passed = all(median <= _BEFORE_THE_END * generations for (_, generations), median in medians.items())
    ours = ", ".join(f"generation {number(median, 3)} of {generations}" for (_, generations), median in medians.items())
    at_once = all(median == 0.0 for median in medians.values())
    return decided(passed, ours, "The random start is there already: most of the error is noise." if at_once else "")


CONVERGENCE_CLAIM = _of_searches(
    "Convergence",
    "Section 10",
    "Convergence of applied multi objective GAs of population size … 200, (or 75) is achieved in <200, (or <25) "
    "generation evaluations",
    "Generation from which on the smallest mean squared error of a population is within 5 % of its last, median over "
    f"the runs of a size. Pass: for each size at most {percent(_BEFORE_THE_END)} of its generations.",
    "before 200 and 25",
    _convergence,
)
