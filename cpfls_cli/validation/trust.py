"""How far to trust a model in one word: one set of words, whoever found the model and however it was judged."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum


class Trust(StrEnum):
    """How far to trust a model, the best word first."""

    SIMULATION = "good-for-simulation"
    CONTROL = "good-for-control"
    INSIDE = "good-inside-region"
    NOT_JUDGED = "not-judged"
    LACKING = "lacks-an-effect"
    NOT_CONTROL = "not-for-control"
    NOT_DETERMINED = "not-determined"
    LOOP = "shows-the-loop"
    RIGID_BODY = "not-better-than-rigid-body"
    DO_NOT_USE = "do-not-use"


GOOD = (Trust.SIMULATION, Trust.CONTROL)
"""Words that call a model good wherever it flies."""


def worse(*words: Trust) -> Trust:
    """Give the worst of some words."""
    return max(words, key=list(Trust).index)


def capped(
    trust: Trust, contradictions: Sequence[str], *, loop: bool = False, lacks: bool = False, told: bool = True
) -> Trust:
    """Take back the word on a model whose flights contradict themselves: it repeats what is wrong with them.

    Where they show the loop, a forecast, judged or not, is one of vehicle and autopilot together, and says nothing of
    the vehicle; one that lacks an effect is no vehicle either, and neither is one whose constants are not told.
    """
    if contradictions:
        return Trust.DO_NOT_USE
    if trust is not Trust.DO_NOT_USE and (loop or not told):
        return Trust.LOOP if loop else worse(trust, Trust.NOT_DETERMINED)
    return Trust.LACKING if lacks and trust in GOOD else trust
