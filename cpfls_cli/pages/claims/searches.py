"""The claims that compare searches: fewer samples, a smaller search, the classic fuzzy system."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import chain

from cpfls_cli.pages.claims.as_good import RULE, as_good, printed_ratio, times
from cpfls_cli.pages.claims.claim import Claim
from cpfls_cli.pages.swept import Sweep
from cpfls_cli.pages.swept_setting import ALL_SAMPLES, SweptSetting
from cpfls_cli.pages.table_5 import PRINTED, PrintedColumn

_FLS, _FULL, *_REDUCED, _SMALL = PRINTED
_LARGE = _REDUCED[-1]
_TIMES_LARGER = 10.0
"""A search that is not ten times the other one tells nothing about the paper's, which is 53 times."""
_FEWER_SAMPLES = (
    "the error is that of the structure, which least squares keeps small where it has samples, and the reduced set is "
    "chosen for its condition number alone."
)
_CLOSED_CIRCLE = (
    "closing the circle makes one rule of the first and the last, which leaves fewer coefficients for a path of small "
    "angles. What it gains lies one period away, where this is not judged."
)
_LESS_SEARCH = "the larger search still finds better partitions."
_MAKE, _MAKE_FULL = "make reproduce", "make reproduce-full"
_Pair = tuple[SweptSetting, SweptSetting]


def search_claims(sweeps: Sequence[Sweep]) -> list[Claim]:
    """Check every claim that compares two settings of Table 5.

    Parameters
    ----------
    sweeps : sequence of Sweep
        Where several can check a claim, the one with the larger search does.
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
        rule=RULE,
        paper=times(printed_ratio(column, _FULL)),
    )

    def pairs(settings: Sequence[SweptSetting]) -> Iterator[_Pair]:
        for full in settings:
            for reduced in settings:
                equal = reduced.structure == full.structure == "cpfls" and reduced.size == full.size
                if equal and full.criterion == ALL_SAMPLES and reduced.samples == column.samples < full.samples:
                    yield reduced, full

    return _checked(
        claim, sweeps, pairs, f"a sweep over {share} and all of them, of equal searches", _MAKE, _FEWER_SAMPLES
    )


def _smaller_search(sweeps: Sequence[Sweep]) -> Claim:
    claim = Claim(
        name="Smaller search",
        where="Section 10",
        words="The identification result is still very good when reducing the population size to 75 and generations "
        "evaluated to 25",
        rule=f"{RULE} The other search must have ten times as many chromosomes (the paper's: 53 times).",
        paper=times(printed_ratio(_SMALL, _LARGE)),
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
    return _checked(claim, sweeps, pairs, given, _MAKE_FULL, _LESS_SEARCH)


def _classic(sweeps: Sequence[Sweep]) -> Claim:
    claim = Claim(
        name="cpFLS and FLS",
        where="Section 10",
        words="There is neither significant quality, nor identification performance degradation when using the new "
        "cpFLS compared to the simple FLS method described in [14]",
        rule=RULE,
        paper=times(printed_ratio(_FULL, _FLS)),
    )

    def pairs(settings: Sequence[SweptSetting]) -> Iterator[_Pair]:
        for periodic in settings:
            for classic in settings:
                kinds = (periodic.structure, classic.structure) == ("cpfls", "fls")
                learned = periodic.criterion == classic.criterion == ALL_SAMPLES
                if kinds and learned and periodic.size == classic.size:
                    yield periodic, classic

    return _checked(
        claim, sweeps, pairs, "a sweep over cpFLS and FLS, all samples, equal searches", _MAKE, _CLOSED_CIRCLE
    )


def _checked(
    claim: Claim,
    sweeps: Sequence[Sweep],
    pairs: Callable[[Sequence[SweptSetting]], Iterator[_Pair]],
    lacking: str,
    command: str,
    reason: str,
) -> Claim:
    """Judge a claim on the first pair of settings that can; the reason is that of a failure."""
    for pair in chain.from_iterable(pairs(sweep.settings) for sweep in sweeps):
        if (judged := as_good(claim, *pair, reason)) is not None:
            return judged
    return claim.lacks(lacking, command)


def _chromosomes(setting: SweptSetting) -> int:
    """Count the chromosomes of a search as the paper does."""
    return setting.population * setting.generations
