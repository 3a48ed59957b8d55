"""From what was found to one word: named, partly, ambiguous, unexplained, no gap, or not excited."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.gap.naming.results import Alternative, NamedEffect, Unexplained, Verdict
from cpfls_cli.gap.settings import GapSettings

_SECOND_CAUSE = 0.03
"""Share of the gap, in squared floors, from which on what is left is a cause of its own."""

_CLEAR = 1.5
_PART = 0.05
_STAYS = 0.7
"""Root mean square that is left of a clear gap about an axis, as a share, from which on nothing explained it."""

_LARGE = 3.0
_REST = 0.1
"""Root mean square that is left, in floors and as a share of the gap, that no name for the gap may leave behind."""

_MAIN = 0.1
"""Share of the gap from which on an effect that cannot be told from another makes the whole answer ambiguous."""


def verdict_of(
    effects: Sequence[NamedEffect],
    alternatives: Sequence[Alternative],
    unexplained: Sequence[Unexplained],
    share: float,
    stays: bool,
    excited: bool,
    settings: GapSettings,
) -> Verdict:
    """Give the verdict.

    Parameters
    ----------
    effects : sequence of NamedEffect
    alternatives : sequence of Alternative
    unexplained : sequence of Unexplained
        Where effects were found: of those, the ones that matter.
    share : float
        Of the gap above the floor that the effects take off flights not seen.
    stays : bool
        Whether an axis keeps a clear gap.
    excited : bool
        Whether anything moved enough to show a gap.
    settings : GapSettings
    """
    if not effects:
        if unexplained:
            return Verdict.UNEXPLAINED
        return Verdict.NO_GAP if excited else Verdict.NOT_EXCITED
    if share < settings.partial_share:
        return Verdict.UNEXPLAINED
    if share < settings.named_share or unexplained or stays:
        return Verdict.PARTIAL
    main = {effect.name for effect in effects if effect.share >= _MAIN}
    return Verdict.AMBIGUOUS if any(rival.instead_of in main for rival in alternatives) else Verdict.NAMED


def gap_stays(before: Array, after: Array) -> bool:
    """Tell whether the gap about an axis, or along one, stays that is a part of the whole.

    Parameters
    ----------
    before, after : array, shape (6,), floors
        Of the held-out flights, with the vehicle's own numbers refitted.
    """
    return any(_stays(before[kind], after[kind]) for kind in (slice(0, 3), slice(3, 6)))


def _stays(own: Array, left: Array) -> bool:
    clear = (own > _CLEAR) & (own**2 > _PART * np.nanmax(own, initial=0.0) ** 2)
    large = (left > _LARGE) & (left > _REST * own)
    return bool((clear & ((left > _STAYS * own) | large)).any())


def matters(left: Unexplained, before: Array) -> bool:
    """Tell whether what is left beside named effects shows a second cause that is not small.

    Parameters
    ----------
    left : Unexplained
    before : array, shape (6,), floors
        The gap of each channel without effects.
    """
    follows = left.signal is not None or left.frequency_hz is not None
    kind = slice(0, 3) if left.axis.startswith("torque") else slice(3, 6)
    largest = float(np.nanmax(before[kind] ** 2, initial=1.0))
    return follows and left.share * left.floors**2 > _SECOND_CAUSE * largest
