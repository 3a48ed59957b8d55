"""What the catalogue does not explain: on which axis, with which signal or frequency, and how surely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.gap.balance.balance_system import System
from cpfls_cli.gap.balance.floor import left_over
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.naming.energy import energy_words
from cpfls_cli.gap.naming.results import Unexplained
from cpfls_cli.gap.naming.scatter import scatter_size, scatter_variance
from cpfls_cli.gap.residual.dependence import Dependence, rank_dependence
from cpfls_cli.gap.residual.narrow_band import NarrowBand, narrow_band
from cpfls_cli.gap.residual.state_signals import joined_states, state_signals, without_actuation
from cpfls_cli.gap.settings import GapSettings

_LARGE = 1.5
"""Root mean square in floors that is a gap whatever it depends on."""

_SMALL = 1.12
"""Root mean square in floors below which nothing is called a gap."""

_PER_WINDOW = 6

_TELLS = 0.05
"""Share that a signal or a band has to explain to be named."""


@dataclass(frozen=True)
class Leftover:
    """What is left of a fit.

    Attributes
    ----------
    floors : array, shape (6,)
        Root mean square of each channel, in floors; 0 where unknown.
    dependence : tuple of Dependence
    scatter : float
        Mean square of the relative scatter of the effects over a window.
    unexplained : tuple of Unexplained
        Channels with a gap.
    """

    floors: Array
    dependence: tuple[Dependence, ...]
    scatter: float
    unexplained: tuple[Unexplained, ...]


def leftover(
    hypothesis: System,
    linear: Array,
    floor: Array,
    block: IntArray,
    settings: GapSettings,
    rng: np.random.Generator,
) -> Leftover:
    """Look at what a fit leaves.

    Parameters
    ----------
    hypothesis : System
    linear : array, shape (column,)
        Coefficients of its base.
    floor : array, shape (6,)
    block : array of int, shape (window,)
    settings : GapSettings
    rng : numpy.random.Generator
    """
    left = hypothesis.residual - hypothesis.base @ linear
    variance = scatter_variance(hypothesis)
    scatter = scatter_size(variance, left, floor)
    in_floors = left / np.sqrt(floor**2 + scatter * variance)
    sizes = np.sqrt(np.mean(in_floors**2, axis=0))
    states = joined_states([state_signals(f, s) for f, s in zip(hypothesis.flights, hypothesis.signals, strict=True)])
    dependence = rank_dependence(
        in_floors, hypothesis.flight_index, block, without_actuation(states), settings.shifts, rng
    )
    band = _band(hypothesis, linear, settings, rng)
    rates = np.concatenate([flight.windows.average(flight.signals.body_rate) for flight in hypothesis.flights])
    # A force turns nothing.
    energy = [*energy_words(left[:, :3], rates, block), *["neither"] * 3]
    unexplained = [
        _unexplained(channel, float(size), dependence, band, own, settings)
        for channel, size, own in zip(CHANNELS, sizes, energy, strict=True)
        if size > _SMALL
    ]
    return Leftover(sizes, dependence, scatter, tuple(found for found in unexplained if found is not None))


def _band(hypothesis: System, linear: Array, settings: GapSettings, rng: np.random.Generator) -> NarrowBand | None:
    """Look for a narrow band, with windows close enough that none is mistaken for another."""
    rows, rates = [], []
    for number, flight in enumerate(hypothesis.flights):
        own = flight.windows
        dense = replace(own, hop=max(1, len(own.weight) // _PER_WINDOW))
        left = left_over(hypothesis, number, linear)
        direct = dense.average(left.direct)
        rows.append(direct if left.momentum is None else direct + dense.derivative(left.momentum))
        rates.append(dense.average(flight.signals.body_rate))
    hop = max(1, len(hypothesis.flights[0].windows.weight) // _PER_WINDOW) * hypothesis.flights[0].windows.period
    return narrow_band(rows, rates, hop, settings.shifts, rng)


def _unexplained(
    channel: str,
    size: float,
    dependence: Sequence[Dependence],
    band: NarrowBand | None,
    energy: str,
    settings: GapSettings,
) -> Unexplained | None:
    signal = next((d for d in dependence if d.channel == channel), None)
    band = band if band is not None and band.channel == channel else None
    follows = signal is not None and signal.p_value <= settings.significance and signal.r2 > _TELLS
    rings = band is not None and band.p_value <= settings.significance and band.share > _TELLS
    if not (size > _LARGE or follows or rings):
        return None
    share = max(signal.r2 if follows and signal else 0.0, band.share if rings and band else 0.0)
    return Unexplained(
        channel,
        size,
        signal.signal if follows and signal else None,
        share,
        band.frequency_hz if rings and band else None,
        band.energy if rings and band else energy,
    )
