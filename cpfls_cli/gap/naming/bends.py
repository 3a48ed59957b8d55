"""Formulas that bend over speed: what a formula that is right in slow flight misses in fast flight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from cpfls_cli.effects.effect import Columns, Effect
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.weak_flight import Candidate, WeakFlight


def bends_of(named: Sequence[Candidate], flights: Sequence[WeakFlight]) -> list[Effect]:
    """Make an effect of the bend of each formula in the air velocity u: the formula times ``|u|^2 / (|u|^2 + U^2)``.

    U is the root mean square of u over the flights. Bounded, because powers hang on the fastest seconds of a flight.
    """
    flown = [flight.signals for flight in flights if "velocity" in flight.signals.available]
    squared = [(signals.air_velocity**2).sum(axis=1) for signals in flown]
    usual = float(np.sqrt(np.mean(np.concatenate(squared)))) if squared else np.inf
    effects = (each.effect for each in named)
    of_speed = (each for each in effects if each.kind == "wrench" and "velocity" in each.needs)
    return [_bend(effect, usual) for effect in of_speed if not (effect.shapes or effect.physical)]


def _bend(effect: Effect, usual: float) -> Effect:
    def columns(signals: Signals, shape: Mapping[str, float]) -> Columns:
        assert effect.columns is not None
        squared = (signals.air_velocity**2).sum(axis=1)
        return Columns(effect.columns(signals, shape).direct * (squared / (squared + usual**2))[:, None, None])

    either = tuple(replace(each, low=-each.high) for each in effect.coefficients)
    return replace(effect, name=f"a bend of {effect.name} over speed", columns=columns, coefficients=either)
