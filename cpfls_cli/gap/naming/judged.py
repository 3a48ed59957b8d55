"""Each chosen effect judged beside the others: how sure, how much, and what could stand in its place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.effects.effect import Effect
from cpfls_cli.gap.balance.weak_flight import Candidate, WeakFlight
from cpfls_cli.gap.naming.ambiguity import alternatives
from cpfls_cli.gap.naming.estimate import Estimates
from cpfls_cli.gap.naming.results import Alternative, NamedEffect
from cpfls_cli.gap.naming.scoring import Scored
from cpfls_cli.gap.naming.search import Step, look
from cpfls_cli.gap.naming.told_effect import told_effect
from cpfls_cli.gap.settings import GapSettings


@dataclass(frozen=True)
class Judged:
    """A chosen effect and its rivals."""

    effect: NamedEffect
    alternatives: tuple[Alternative, ...]


def judge_effect(
    flights: Sequence[WeakFlight],
    chosen: Sequence[Candidate],
    place: int,
    found: Estimates,
    share: float,
    effects: Sequence[Effect],
    settings: GapSettings,
    rng: np.random.Generator,
) -> Judged:
    """Judge a chosen effect as if it were the last one to be found.

    Parameters
    ----------
    flights : sequence of WeakFlight
    chosen : sequence of Candidate
    place : int
        Of the effect among them.
    found : Estimates
    share : float
        Of what all effects explain.
    effects : sequence of Effect
    settings : GapSettings
    rng : numpy.random.Generator
    """
    candidate = chosen[place]
    others = [other for other in chosen if other is not candidate]
    step = look(flights, others, effects, settings, rng, also=(candidate,))
    own = next(scored for scored in step.ranking if scored.candidate.effect.name == candidate.effect.name)
    effect = NamedEffect(
        candidate.effect.name,
        candidate,
        found.of_effect[place],
        found.effects[place],
        step.p_value(own.gain),
        share,
        _frequency(own, step),
        told_effect(candidate.effect, found.effects[place], flights[0].signals.vehicle),
    )
    return Judged(effect, tuple(alternatives(own, step.ranking, step.above_floor)))


def _frequency(own: Scored, step: Step) -> float:
    """Give the share of the blocks without which the effect would still explain most."""
    total = np.array([scored.block_error.sum() - scored.block_error for scored in step.ranking if _real(scored)])
    names = [scored.candidate.effect.name for scored in step.ranking if _real(scored)]
    if own.candidate.effect.name not in names:
        return 0.0
    return float(np.mean(np.argmin(total, axis=0) == names.index(own.candidate.effect.name)))


def _real(scored: Scored) -> bool:
    return bool(np.isfinite(scored.gain))
