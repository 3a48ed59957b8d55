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
    RIGID_BODY = "not-better-than-rigid-body"
    DO_NOT_USE = "do-not-use"


def capped(trust: Trust, contradictions: Sequence[str]) -> Trust:
    """Take back the word on a model whose flights contradict themselves: it repeats what is wrong with them."""
    return Trust.DO_NOT_USE if contradictions else trust
