"""What the flights could not show: effects without their signals, and effects whose motion was not flown."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.balance.balance_system import System
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.naming.results import NamedEffect, NotExcited

_USUAL_OF_BOUND = 0.2
"""A coefficient that is large but not unheard of, as a share of its bound."""

_VISIBLE = 0.2
"""Root mean square in floors from which an effect is seen."""


def not_excited(hypothesis: System, effects: Sequence[Effect], floor: Array) -> tuple[NotExcited, ...]:
    """List the effects that could be there unseen, and why.

    Parameters
    ----------
    hypothesis : System
    effects : sequence of Effect
    floor : array, shape (6,)
    """
    # The vehicle's own numbers are free in every fit, so beyond themselves they never show.
    names = {candidate.effect.name for candidate in hypothesis.free} | {c.effect.name for c in hypothesis.chosen}
    found = ((effect.name, _reason(hypothesis, effect, floor)) for effect in effects if effect.name not in names)
    return tuple(NotExcited(name, reason) for name, reason in found if reason)


def look_alikes(hypothesis: System, named: Sequence[NamedEffect]) -> tuple[str, ...]:
    """Say which effects look like a named one and cannot be ruled out, because the flights lack their signals.

    Returns
    -------
    tuple of str
        Sentences.
    """
    sentences = []
    for effect in named:
        if CATALOGUE[effect.name].kind in ("parameter", "sensor"):
            continue
        unseen = {}
        for name in CATALOGUE[effect.name].rivals:
            missing = [CATALOGUE[name].missing(signals) for signals in hypothesis.signals]
            if all(missing) and not {"command", "measured_rotor_speed"} & set(missing[0]):
                unseen[name] = missing[0]
        if unseen:
            lacking = sorted({signal.replace("_", " ") for signals in unseen.values() for signal in signals})
            sentences.append(
                f"{effect.name}: {', '.join(unseen)} would look alike and cannot be ruled out; log {', '.join(lacking)}"
            )
    return tuple(sentences)


def _reason(hypothesis: System, effect: Effect, floor: Array) -> str:
    missing = [effect.missing(signals) for signals in hypothesis.signals]
    if all(missing):
        if "command" in missing[0]:
            return "rotor speeds are measured, so what lies between command and speed does not show"
        return f"the flights lack {', '.join(name.replace('_', ' ') for name in missing[0])}"
    if effect.columns is None:
        return ""
    shape = {shape.name: shape.grid[len(shape.grid) // 2] for shape in effect.shapes}
    columns = hypothesis.columns(Candidate(effect, shape)) / floor[:, None]
    new = _beyond_base(hypothesis.base / floor[:, None], columns) * _usual(hypothesis, effect, columns.shape[2])
    # The best channel of the best coefficient decides.
    if np.sqrt((new**2).mean(axis=0)).max(initial=0.0) >= _VISIBLE:
        return ""
    return f"it would not show; {effect.excitation}"


def _usual(hypothesis: System, effect: Effect, width: int) -> Array:
    vehicle = hypothesis.flights[0].signals.vehicle
    bounds = [max(abs(bound) for bound in c.bounds(vehicle)) for c in effect.coefficients]
    if effect.unit_coefficient or not bounds:
        return np.ones(width)
    if effect.linear is not None:
        return np.abs(effect.linear(_USUAL_OF_BOUND * np.array(bounds)))
    return _USUAL_OF_BOUND * np.array(bounds)[:width]


def _beyond_base(base: Array, columns: Array) -> Array:
    flat, own = base.reshape(-1, base.shape[2]), columns.reshape(-1, columns.shape[2])
    length = np.linalg.norm(flat, axis=0)
    scaled = flat / np.where(length > 0, length, 1.0)
    return np.asarray((own - scaled @ np.linalg.lstsq(scaled, own, rcond=1e-9)[0]).reshape(columns.shape))
