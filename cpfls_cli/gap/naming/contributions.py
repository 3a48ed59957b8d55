"""How much of what the effects explain together is due to each of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.gap.balance.balance_system import is_free, system
from cpfls_cli.gap.balance.weak_flight import Candidate, WeakFlight
from cpfls_cli.gap.naming.estimate import Estimates


def shares(flights: Sequence[WeakFlight], chosen: Sequence[Candidate], found: Estimates, floor: Array) -> Array:
    """Split what the effects explain among them.

    The share of an effect is the part of the explained residual that points its way, in floors; the shares add up to
    1. Effects that work against each other can have more than 1, or less than 0.

    Parameters
    ----------
    flights : sequence of WeakFlight
    chosen : sequence of Candidate
    found : Estimates
        Of the hypothesis with all of them.
    floor : array, shape (6,)

    Returns
    -------
    array, shape (effect,)
    """
    everything = _left(flights, chosen, found, range(len(chosen)))
    total = (_left(flights, chosen, found, ()) - everything) / floor
    parts = [
        (_left(flights, chosen, found, [p for p in range(len(chosen)) if p != place]) - everything) / floor
        for place in range(len(chosen))
    ]
    along = np.array([(part * total).sum() for part in parts])
    return np.asarray(along / max(abs(along.sum()), 1e-12) if len(along) else along)


def _left(
    flights: Sequence[WeakFlight], chosen: Sequence[Candidate], found: Estimates, kept: Sequence[int] | range
) -> Array:
    """Give what some of the effects leave, with the coefficients of all of them."""
    there = system(flights, [chosen[place] for place in kept])
    parameters = found.linear[: len(found.linear) - sum(len(own) for own in found.of_effect)]
    own = [found.of_effect[place] for place in kept if is_free(chosen[place])]
    return np.asarray(there.residual - there.base @ np.concatenate([parameters, *own]))
