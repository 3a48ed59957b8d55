"""Effects that the flights cannot tell from the one that was chosen, and the flight that would."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import wilcoxon

from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.naming.results import Alternative
from cpfls_cli.gap.naming.scoring import Scored

_CLOSE = 0.01
_VISIBLE = 0.25
_ERRORS = 2.0
_CHANCE = 0.02
_NEAR = 0.6


def unbeaten(own: Scored, ranking: Sequence[Scored], above_floor: float) -> list[Scored]:
    """List the candidates that the chosen one does not beat.

    Beaten is what leaves more by more than the scatter over blocks and by more than a few hundredths of the gap.
    """
    return [
        other
        for other in ranking
        if other.candidate.effect.name != own.candidate.effect.name
        and other.gain > _NEAR * own.gain
        and not _beats(own, other, above_floor)
    ]


def simplest(ranking: Sequence[Scored], above_floor: float) -> Scored:
    """Choose among the best candidates the one with the fewest free numbers.

    Parameters
    ----------
    ranking : sequence of Scored
        Best first.
    above_floor : float
    """
    best = ranking[0]
    rivals = [other for other in unbeaten(best, ranking, above_floor) if other.gain > (1 - _CLOSE) * best.gain]
    return min([best, *rivals], key=lambda scored: (_numbers(scored), -scored.gain))


def alternatives(own: Scored, ranking: Sequence[Scored], above_floor: float) -> list[Alternative]:
    """List what is as good as the chosen effect; an effect that holds it as a special case is none."""
    effect = own.candidate.effect
    return [
        Alternative(
            other.name,
            effect.name,
            float(scored.gain / own.gain),
            effect.rivals.get(other.name) or other.rivals.get(effect.name) or effect.excitation,
        )
        for scored in unbeaten(own, ranking, above_floor)
        if effect.name not in (other := scored.candidate.effect).holds
    ]


def _beats(own: Scored, other: Scored, above_floor: float) -> bool:
    margin = other.block_error - own.block_error
    # Close is what leaves next to nothing of a large gap, or next to nothing beside what the chosen one leaves itself.
    close = min(_CLOSE * above_floor, _VISIBLE * own.block_error.sum() / len(CHANNELS))
    if margin.sum() <= close or len(margin) < 2:
        return False
    spread = float(np.std(margin, ddof=1) * np.sqrt(len(margin)))
    # Effects act in some blocks and not in others: where sizes differ that much, ranks tell more than the mean.
    return bool(margin.sum() > _ERRORS * spread or wilcoxon(margin, alternative="greater").pvalue < _CHANCE)


def _numbers(scored: Scored) -> int:
    effect = scored.candidate.effect
    return len(effect.shapes) + (0 if effect.unit_coefficient else len(scored.coefficients))
