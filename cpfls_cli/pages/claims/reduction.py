"""The claims about reduced training sets: what few samples keep, and the floor under their condition number."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cpfls_cli.pages.claims.claim import Claim
from cpfls_cli.pages.printed import PRINTED_CONTRIBUTION, PRINTED_SHARE, TABLE_4
from cpfls_cli.pages.source import Source
from cpfls_cli.report.numbers import change, percent

_FEWEST = TABLE_4[-1]
_CONTRIBUTION = Claim(
    name="A fifth of the samples",
    where="Section 10",
    words="less than 20% of data points give more than 80% of contribution to the system condition number",
    rule="Condition number of all samples over that of a reduced set with fewer than 20 % of them. Pass: above 80 %. "
    "(So read, the claim is the last column of Table 4.)",
    paper=f"{percent(TABLE_4[0].condition_number / _FEWEST.condition_number)} with "
    f"{percent(_FEWEST.samples / TABLE_4[0].samples)} of the samples",
)
_FLOOR = Claim(
    name="Floor of the condition number",
    where="Section 8",
    words="The target condition number of the ReducedTrainingSet cannot be set to lower than the reference condition "
    "number of the full FullTrainingSet data set",
    rule="Change of the condition number against all samples. Fail: any reduced set of full rank has a lower one.",
    paper=f"{change(TABLE_4[1].change)} to {change(_FEWEST.change)}",
)
_COMMAND = "cpfls reduce CONFIG flight.h5 -o selection.h5"


def reduction_claims(selections: Sequence[Source]) -> list[Claim]:
    """Check what the paper says of reduced training sets."""
    return [_contribution(selections), _floor(selections)]


def _contribution(selections: Sequence[Source]) -> Claim:
    few = [selection for selection in selections if _share(selection) < PRINTED_SHARE]
    if not few:
        return _CONTRIBUTION.lacks("a selection of fewer than 20 % of the samples", _COMMAND)
    selection = max(few, key=_share)
    kept, full = _kept(selection), selection.artifact.number("condition_number_full")
    ours = f"{percent(kept)} with {percent(_share(selection))} of the samples"
    random = full / float(np.median(selection.artifact.array("random/condition_number")))
    why = f"{selection.label}: {_first_enough(selection)}A random choice of equal size keeps {percent(random)}"
    weak = " too, so the claim says more about the path than about the choice" if random > PRINTED_CONTRIBUTION else ""
    return _CONTRIBUTION.decided(kept > PRINTED_CONTRIBUTION, ours, f"{why}{weak}.")


def _floor(selections: Sequence[Source]) -> Claim:
    changes = [1.0 / _kept(selection) - 1.0 for selection in selections if _kept(selection) > 0.0]
    if not changes:
        return _FLOOR.lacks("a selection of full rank", _COMMAND)
    ours = " and ".join(dict.fromkeys(change(share) for share in (max(changes), min(changes))))
    words = {
        True: "No reduced set here is better conditioned than all samples.",
        False: "A reduced set can be better conditioned than the full one: what is left out weighs on strong "
        "directions.",
    }
    holds = min(changes) >= 0.0
    return _FLOOR.decided(holds, ours, words[holds])


def _share(selection: Source) -> float:
    return len(selection.artifact.array("indices")) / selection.artifact.number("candidates")


def _kept(selection: Source) -> float:
    """Divide the condition number of all samples by that of the chosen ones; 0 where rank is lost."""
    artifact = selection.artifact
    if artifact.number("rank") < artifact.number("rank_full"):
        return 0.0
    return artifact.number("condition_number_full") / artifact.number("condition_number")


def _first_enough(selection: Source) -> str:
    """Count the samples from which on, in the order of the choice, 80 % is kept."""
    artifact = selection.artifact
    trace = artifact.array("trace/condition_number")
    enough = trace * PRINTED_CONTRIBUTION < artifact.number("condition_number_full")
    if not len(enough) or not enough[-1]:
        return ""
    first = len(enough) - int(np.argmin(enough[::-1])) + 1 if not enough.all() else 1
    return f"{first} samples ({percent(first / artifact.number('candidates'), 2)}) already keep 80 %. "
