"""What is left of a hypothesis in units of noise: floors of each channel over all flights."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Columns
from cpfls_cli.gap.balance.balance_system import System
from cpfls_cli.gap.balance.noise_floor import noise_floor
from cpfls_cli.gap.balance.weak_flight import columns_of

NEGLIGIBLE = 0.003
"""Share of the torque or force below which nobody could use a correction; sampling alone leaves about as much."""


def floors(hypothesis: System, coefficients: Array) -> Array:
    """Estimate the noise floor of each channel over all flights.

    Parameters
    ----------
    hypothesis : System
    coefficients : array, shape (column,)
        Of `hypothesis.base`.

    Returns
    -------
    array, shape (6,), N m and N
        1 for channels that no flight has.
    """
    square, count = np.zeros(6), np.zeros(6)
    for number, flight in enumerate(hypothesis.flights):
        floor = noise_floor(left_over(hypothesis, number, coefficients), flight.windows)
        square += len(flight) * flight.known * floor**2
        count += len(flight) * flight.known
    noise = np.sqrt(square / np.maximum(count, 1))
    return np.where(count > 0, np.maximum(noise, NEGLIGIBLE * _activity(hypothesis)), 1.0)


def left_over(hypothesis: System, number: int, coefficients: Array) -> Columns:
    """Compute what a fitted hypothesis leaves of one flight, sample by sample.

    Parameters
    ----------
    hypothesis : System
    number : int
        Of the flight.
    coefficients : array, shape (column,)

    Returns
    -------
    Columns
        Of shape (time, 6).
    """
    flight, signals = hypothesis.flights[number], hypothesis.signals[number]
    left = flight.residual(signals)
    direct, momentum = left.direct, left.momentum
    assert momentum is not None
    used = 0
    for candidate in hypothesis.free:
        width = hypothesis.columns(candidate).shape[2]
        own = coefficients[used : used + width]
        used += width
        direct, momentum = _less(direct, momentum, candidate, own, signals)
    for candidate in hypothesis.chosen:
        if candidate.effect.kind == "wrench" and candidate.effect.unit_coefficient:
            direct, momentum = _less(direct, momentum, candidate, np.ones(1), signals)
    return Columns(direct * flight.known, momentum * flight.known)


def _less(direct: Array, momentum: Array, candidate, own: Array, signals) -> tuple[Array, Array]:  # type: ignore[no-untyped-def] # noqa: ANN001
    if candidate.effect.missing(signals):
        return direct, momentum
    columns = columns_of(candidate, signals)
    return direct - columns.direct @ own, momentum if columns.momentum is None else momentum - columns.momentum @ own


def _activity(hypothesis: System) -> Array:
    """Root mean square of what inertia and rotors do in each channel, about its mean."""
    rows = np.concatenate([flight.averaged(flight.inertial) for flight in hypothesis.flights])
    torque = np.sqrt(np.mean(rows[:, :3] ** 2, axis=0))
    weight = np.sqrt(np.mean(rows[:, 3:] ** 2))
    return np.array([*np.maximum(torque, 0.3 * torque.max()), *[weight] * 3])
