"""Which signals of a log move the vehicle and know nothing of its gusts: what the pilot's sticks make."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.look.flight import LogFlight
from cpfls_cli.look.reasons import AT_REST, NO_STICK, needed_s, too_little

MADE_BY_STICKS = 0.95
"""Share of the variance of a setpoint that the stick explains, from which it is not fed by the state."""
_RATE_HZ = 25.0
_LAGS_S = (0.0, 0.04, 0.08, 0.12, 0.2, 0.32)
_SLOW_S = 2.0
"""Slower motion of a setpoint, such as trim and heading, is left out."""
_AT_REST = 0.01
"""Standard deviation of a stick, share of its full throw, below which it rests."""


class Exogenous(NamedTuple):
    """Instruments of one axis on the common clock, that nearest to the command first, or why there is none."""

    candidates: tuple[tuple[str, Array], ...]
    reason: str


def exogenous(flight: LogFlight, axis: int, usable: BoolArray) -> Exogenous:
    """List signals that are exogenous: the stick, and setpoints that follow it alone.

    A setpoint of an outer loop contains the measured state, and with it the gusts. The stick explains such a setpoint
    only as far as the state follows the stick; one that it explains all but wholly is its image.
    """
    stick, every = flight.stick[:, axis], usable & np.isfinite(flight.stick[:, axis])
    if every.sum() < needed_s(1.0) * flight.rate_hz:
        short = np.isfinite(stick).any()
        return Exogenous((), too_little(every, flight.rate_hz, 1.0) if short else NO_STICK)
    if float(np.std(stick[every])) < _AT_REST:
        return Exogenous((), AT_REST)
    found = [("stick", stick)]
    for name, values in (("attitude setpoint", flight.attitude_setpoint), ("rate setpoint", flight.rate_setpoint)):
        setpoint = values[:, axis]
        both = every & np.isfinite(setpoint)
        if both.sum() >= 0.5 * every.sum() and explained(setpoint, stick, both, flight.rate_hz) >= MADE_BY_STICKS:
            found.insert(0, (name, setpoint))
    return Exogenous(tuple(found), "")


def explained(setpoint: Array, stick: Array, usable: BoolArray, rate_hz: float) -> float:
    """Compute the share of a setpoint's variance that a stick explains by its values of the last third of a second.

    The smaller one of the setpoint and of its changes: what a slow stick asks for may hide faster answers to the state.
    """
    step = max(round(rate_hz / _RATE_HZ), 1)
    count = len(stick) // step
    good = usable[: count * step].reshape(count, step).all(axis=1)
    slow = np.ones(max(round(_SLOW_S * rate_hz / step), 3))

    def sampled(values: Array) -> Array:
        mean = np.where(usable, values, 0.0)[: count * step].reshape(count, step).mean(axis=1)
        weight = np.maximum(np.convolve(good, slow, "same"), 1.0)
        return np.asarray(np.where(good, mean - np.convolve(np.where(good, mean, 0.0), slow, "same") / weight, 0.0))

    shapes = [sampled(each) for each in (stick, stick * np.abs(stick), stick**3)]
    lags = [round(lag * rate_hz / step) for lag in _LAGS_S]
    columns = np.stack([np.roll(shape, lag) for lag in dict.fromkeys(lags) for shape in shapes], axis=1)
    whole = np.convolve(good, np.concatenate([np.zeros(max(lags)), np.ones(max(lags) + 1)]), "same") > max(lags)
    if whole.sum() < 2 * columns.shape[1]:
        return 0.0
    target, pairs = sampled(setpoint), whole & np.concatenate([[False], whole[:-1]])
    changes = [np.concatenate([[0.0], np.diff(target)]), np.diff(columns, axis=0, prepend=columns[:1])]
    return min(_share(target[whole], columns[whole]), _share(changes[0][pairs], changes[1][pairs]))


def _share(target: Array, columns: Array) -> float:
    rest = target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]
    power = float(target @ target)
    return 1.0 - float(rest @ rest) / power if power > 0 else 0.0
