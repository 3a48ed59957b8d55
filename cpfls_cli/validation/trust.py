"""How far to trust a model in one word: one set of words, whoever found the model and however it was judged."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum

from cpfls_cli.playback.errors import CONTROL_HORIZON, ByHorizon


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
    trust: Trust, contradictions: Sequence[str], *, loop: bool = False, lacks: bool = False, identified: bool = True
) -> Trust:
    """Take back the word on a model whose flights contradict themselves: it repeats what is wrong with them.

    Where they show the loop, a forecast, judged or not, is one of vehicle and autopilot together, and says nothing of
    the vehicle; one that lacks an effect is no vehicle either, and neither is one whose constants are not identified.
    """
    if contradictions:
        return Trust.DO_NOT_USE
    if trust is not Trust.DO_NOT_USE and (loop or not identified):
        return Trust.LOOP if loop else worse(trust, Trust.NOT_DETERMINED)
    return Trust.LACKING if lacks and trust in GOOD else trust


def trust_by_playback(held_out: ByHorizon | None) -> Trust:
    """Judge a model by its playback along flights that it was not found in.

    Good for simulation where errors of rates, attitude, velocity and position, as far as the flights know them, add
    up to less over the horizon than those of what knows no model; for control where those of the rates do, over
    0.1 s at least. Nothing is good for either that loses in rates or attitude where control lives, that predicts rates
    there no better than mere decay, or whose velocity or position is worse than all of what knows no model.
    """
    if held_out is None:
        return Trust.NOT_JUDGED
    last = float(held_out.horizon_s[-1])
    reached = {signal: held_out.better_to(signal) for signal in held_out.signals}
    if reached["body_rate"] < min(CONTROL_HORIZON, last):
        return Trust.DO_NOT_USE
    if held_out.lost_to() or held_out.like_fading() or held_out.behind_both():
        return Trust.NOT_CONTROL
    simulates = "velocity" in reached and all(horizon >= last for horizon in reached.values())
    return Trust.SIMULATION if simulates else Trust.CONTROL
