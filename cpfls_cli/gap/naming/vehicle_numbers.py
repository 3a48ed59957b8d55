"""Wrong numbers of the vehicle: no missing effect, and called so."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import norm

from cpfls_cli.arrays import Array
from cpfls_cli.effects.catalogue.parameter_error import NUMBERS
from cpfls_cli.effects.registry import CATALOGUE, VEHICLE_NUMBERS
from cpfls_cli.gap.naming.estimate import Estimates
from cpfls_cli.gap.naming.results import Estimate, NamedEffect

_MATTERS = 0.02
"""Relative error of a moment of inertia or of the thrust from which on it is told."""

_LEAST_SHARE = 0.05

_PULLS = 2.0
"""Multiple of the pull of noise that an error has to exceed."""


def wrong_numbers(found: Estimates, effects: Sequence[NamedEffect], share: float, pull: Array) -> NamedEffect | None:
    """Name wrong numbers of the vehicle where they are sure, matter, and nothing named accounts for them.

    Parameters
    ----------
    found : Estimates
    effects : sequence of NamedEffect
        Already named.
    share : float
        Part of the gap of the model as given that refitting its numbers takes off.
    pull : array, shape (parameter,)
        Error of each number that noise in the motion can make: a noisy acceleration asks for less inertia.
    """
    pairs = zip(found.parameters, pull, strict=True)
    wrong = [number for number, drawn in pairs if abs(number.value) > _PULLS * drawn and _told(number, effects)]
    if not wrong or share < _LEAST_SHARE:
        return None
    p_value = min(2 * float(norm.sf(3.92 * abs(n.value) / (n.high - n.low))) if n.high > n.low else 0.0 for n in wrong)
    name, sentence = VEHICLE_NUMBERS.name, VEHICLE_NUMBERS.sentence
    return NamedEffect(name, None, np.zeros(0), tuple(wrong), p_value, share, 1.0, sentence)


def impossible(numbers: Sequence[Estimate]) -> tuple[str, ...]:
    """Say which numbers of the vehicle would have to be what no vehicle has: then the log is wrong, not the vehicle.

    Parameters
    ----------
    numbers : sequence of Estimate
        Relative errors.

    Returns
    -------
    tuple of str
        Sentences.
    """
    return tuple(
        f"{NUMBERS[number.name]} would have to be {1 + number.value:.3g} times that of the config, which no vehicle"
        " has: check signs, units and order of the gyroscope's and the rotors' columns"
        for number in numbers
        if number.name in NUMBERS and (number.high < number.plausible[0] or number.low > number.plausible[1])
    )


def _told(number: Estimate, effects: Sequence[NamedEffect]) -> bool:
    if number.name not in NUMBERS:
        return False
    half = 0.5 * (number.high - number.low)
    sure = abs(number.value) > 1.5 * half and abs(number.value) > _MATTERS
    return sure and abs(number.value) > _accounted(number.name, effects)


def _accounted(name: str, effects: Sequence[NamedEffect]) -> float:
    """Give the relative error that named effects leave in a number: they change it themselves."""
    accounted = 0.0
    for effect in effects:
        accounts = CATALOGUE[effect.name].accounts
        if accounts is not None:
            accounted += accounts(name, {c.name: c.value for c in effect.coefficients})
    return accounted
