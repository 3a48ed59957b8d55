"""The claims that compare searches: fewer samples, a smaller search, the classic fuzzy system."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from cpfls_cli.report.claims.claim import Claim
from cpfls_cli.report.claims.paired import PairedRatio, paired_ratio
from cpfls_cli.report.numbers import number
from cpfls_cli.report.swept import Sweep
from cpfls_cli.report.swept_setting import ALL_SAMPLES, SweptSetting
from cpfls_cli.report.table_5 import PRINTED, PrintedColumn

_FLS, _FULL, *_REDUCED, _SMALL = PRINTED
_LARGE = _REDUCED[-1]
_TIMES_LARGER = 10.0
"""A search that is not ten times the other one tells nothing about the paper's, which is 53 times."""
_MAKE, _MAKE_FULL = "make reproduce", "make reproduce-full"
_Pair = tuple[SweptSetting, SweptSetting]


def _printed_ratio(column: PrintedColumn, reference: PrintedColumn) -> float:
    return float(column.mse_of_runs[0]) / float(reference.mse_of_runs[0])


AS_GOOD = max(_printed_ratio(column, _FULL) for column in _REDUCED)
"""Largest ratio of mean squared errors in Table 5 between settings that the paper calls equally good: 4/3."""

_RULE = (
    f"Ratio of the mean squared errors, paired by seed, with its 95 % interval. Pass: all of it at most "
    f"{number(AS_GOOD, 3)}, the largest ratio that the paper prints and calls no difference; fail: all of it above."
)


def search_claims(sweeps: Sequence[Sweep]) -> list[Claim]:
    """Check every claim that compares two settings of Table 5.

    Parameters
    ----------
    sweeps : sequence of Sweep
        Where several can check a claim, the one with the larger search does.

    Returns
    -------
    list of Claim
    """
    largest_first = sorted(sweeps, key=lambda sweep: -max(_chromosomes(setting) for setting in sweep.settings))
    return [
        *(_reduced(column, largest_first) for column in _REDUCED),
        _smaller_search(largest_first),
        _classic(largest_first),
    ]


def _reduced(column: PrintedColumn, sweeps: Sequence[Sweep]) -> Claim:
    share = f"{column.samples} of {_FULL.samples} samples"
    claim = Claim(
        name=f"{column.samples} samples",
        where="Section 10",
        words="In average there is no significant difference in the identification quality for any of the reduced or "
        "the full data set",
        rule=_RULE,
        paper=_times(_printed_ratio(column, _FULL)),
    )

    def pairs(settings: Sequence[SweptSetting]) -> Iterator[_Pair]:
        for full in settings:
            for reduced in settings:
                equal = reduced.structure == full.structure == "cpfls" and reduced.size == full.size
                if equal and full.criterion == ALL_SAMPLES and reduced.samples == column.samples < full.samples:
                    yield reduced, full

    return _checked(claim, sweeps, pairs, f"a sweep over {share} and all of them, of equal searches", _MAKE)


def _smaller_search(sweeps: Sequence[Sweep]) -> Claim:
    claim = Claim(
        name="Smaller search",
        where="Section 10",
        words="The identification result is still very good when reducing the population size to 75 and generations "
        "evaluated to 25",
        rule=f"{_RULE} The other search must have ten times as many chromosomes (the paper's: 53 times).",
        paper=_times(_printed_ratio(_SMALL, _LARGE)),
    )

    def pairs(settings: Sequence[SweptSetting]) -> Iterator[_Pair]:
        for small in settings:
            for large in settings:
                equal = small.structure == large.structure == "cpfls" and small.samples == large.samples
                is_small = small.size == (_SMALL.population, _SMALL.generations)
                if equal and is_small and _chromosomes(large) >= _TIMES_LARGER * _chromosomes(small):
                    yield small, large

    lacking = f"a search on equal samples with ten times the chromosomes of {_SMALL.population} × {_SMALL.generations}"
    found = sorted({setting.size for sweep in sweeps for setting in sweep.settings})
    given = f"{lacking}; here are {', '.join(f'{p} × {g}' for p, g in found)}" if found else lacking
    return _checked(claim, sweeps, pairs, given, _MAKE_FULL)


def _classic(sweeps: Sequence[Sweep]) -> Claim:
    claim = Claim(
        name="cpFLS and FLS",
        where="Section 10",
        words="There is neither significant quality, nor identification performance degradation when using the new "
        "cpFLS compared to the simple FLS method described in [14]",
        rule=_RULE,
        paper=_times(_printed_ratio(_FULL, _FLS)),
    )

    def pairs(settings: Sequence[SweptSetting]) -> Iterator[_Pair]:
        for periodic in settings:
            for classic in settings:
                kinds = (periodic.structure, classic.structure) == ("cpfls", "fls")
                learned = periodic.criterion == classic.criterion == ALL_SAMPLES
                if kinds and learned and periodic.size == classic.size:
                    yield periodic, classic

    return _checked(claim, sweeps, pairs, "a sweep over cpFLS and FLS, all samples, equal searches", _MAKE)


def _checked(
    claim: Claim,
    sweeps: Sequence[Sweep],
    pairs: Callable[[Sequence[SweptSetting]], Iterator[_Pair]],
    lacking: str,
    command: str,
) -> Claim:
    found = next((pair for sweep in sweeps for pair in pairs(sweep.settings)), None)
    if found is None:
        return claim.lacks(lacking, command)
    compared = paired_ratio(*found)
    if not compared.seeds:
        return claim.lacks("finished runs of equal seeds", command)
    return _judged(claim, compared, found)


def _judged(claim: Claim, found: PairedRatio, pair: _Pair) -> Claim:
    seeds = f"{found.seeds} seed{'' if found.seeds == 1 else 's'}"
    sizes = f"{_size(pair[0])} against {_size(pair[1])}" if pair[0].size != pair[1].size else _size(pair[0])
    searched = f"{seeds} of {sizes} (population × generations)."
    if found.seeds == 1:
        return claim.undecided(_times(found.ratio), f"{searched} One seed says nothing about the next.")
    ours = f"{_times(found.ratio)} ({number(found.low, 3)} to {number(found.high, 3)})"
    tested = f"{searched} Wilcoxon p that neither is better: {number(found.p_value, 2)}."
    if found.low <= AS_GOOD < found.high:
        return claim.undecided(ours, f"{tested} So few seeds cannot tell: the interval holds the bound.")
    if found.high > AS_GOOD:
        return claim.decided(False, ours, f"{tested} Worse than the paper's own margin.")
    lower = " The error is even lower." if found.high < 1.0 else ""
    return claim.decided(True, ours, f"{tested}{lower}")


def _times(ratio: float) -> str:
    return f"{number(ratio, 3)} times the MSE"


def _size(setting: SweptSetting) -> str:
    return f"{setting.population} × {setting.generations}"


def _chromosomes(setting: SweptSetting) -> int:
    """Count the chromosomes of a search as the paper does."""
    return setting.population * setting.generations
