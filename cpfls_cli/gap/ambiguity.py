"""Effects that the flights cannot tell from the one that was chosen, and the flight that would."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import wilcoxon

from cpfls_cli.arrays import Array
from cpfls_cli.gap.balance_system import System
from cpfls_cli.gap.results import Alternative
from cpfls_cli.gap.scoring import Scored, primary
from cpfls_cli.gap.weak_flight import CHANNELS, Candidate

_SPANS = 0.999
_CLOSE = 0.01
_VISIBLE = 0.25
_ERRORS = 2.0
_CHANCE = 0.02
_NEAR = 0.6


def unbeaten(own: Scored, ranking: Sequence[Scored], above_floor: float) -> list[Scored]:
    """List the candidates that the chosen one does not beat.

    Beaten is what leaves more by more than the scatter over blocks and by more than a few hundredths of the gap.

    Parameters
    ----------
    own : Scored
    ranking : sequence of Scored
    above_floor : float

    Returns
    -------
    list of Scored
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

    Returns
    -------
    Scored
    """
    best = ranking[0]
    rivals = [other for other in unbeaten(best, ranking, above_floor) if other.gain > (1 - _CLOSE) * best.gain]
    return min([best, *rivals], key=lambda scored: (_numbers(scored), -scored.gain))


def alternatives(
    own: Scored, ranking: Sequence[Scored], hypothesis: System, floor: Array, above_floor: float
) -> list[Alternative]:
    """List what is as good as the chosen effect; an effect that holds it as a special case is none.

    Parameters
    ----------
    own : Scored
    ranking : sequence of Scored
    hypothesis : System
        Without the chosen effect.
    floor : array, shape (6,)
    above_floor : float

    Returns
    -------
    list of Alternative
    """
    name = own.candidate.effect.name
    return [
        Alternative(
            other.candidate.effect.name,
            name,
            float(other.gain / own.gain),
            own.candidate.effect.rivals.get(other.candidate.effect.name)
            or other.candidate.effect.rivals.get(name)
            or own.candidate.effect.excitation,
        )
        for other in unbeaten(own, ranking, above_floor)
        if _numbers(other) <= _numbers(own) or not spans(other.candidate, own, hypothesis, floor)
    ]


def spans(general: Candidate, special: Scored, hypothesis: System, floor: Array) -> bool:
    """Tell whether one effect can stand for all that another one explains.

    Parameters
    ----------
    general : Candidate
    special : Scored
    hypothesis : System
    floor : array, shape (6,)

    Returns
    -------
    bool
    """
    explained = primary(special.candidate, hypothesis.columns(special.candidate)) @ special.coefficients / floor
    columns = np.concatenate([hypothesis.base, primary(general, hypothesis.columns(general))], axis=2) / floor[:, None]
    base = (hypothesis.base / floor[:, None]).reshape(-1, hypothesis.base.shape[2])
    new = _outside(base, explained.reshape(-1))
    left = _outside(columns.reshape(-1, columns.shape[2]), explained.reshape(-1))
    return bool(left @ left <= (1 - _SPANS) * (new @ new))


def _outside(columns: Array, values: Array) -> Array:
    length = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(length > 0, length, 1.0)
    return np.asarray(values - scaled @ np.linalg.lstsq(scaled, values, rcond=1e-9)[0])


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
