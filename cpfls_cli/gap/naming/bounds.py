"""Physical bounds: a coefficient that no vehicle has is no explanation."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.effects.effect import Effect
from cpfls_cli.vehicle.settings import VehicleSettings

_ERRORS = 2.0


def within_bounds(effect: Effect, linear: Array, error: Array, vehicle: VehicleSettings) -> tuple[BoolArray, bool]:
    """Hold coefficients against the bounds of their effect.

    What the data leave open is no reason to refuse: a coefficient counts as beyond a bound only by more than its
    uncertainty.

    Parameters
    ----------
    effect : Effect
    linear : array, shape (coefficient,)
        Linear coefficients of a fit.
    error : array, shape (coefficient,)
        Their standard errors.
    vehicle : VehicleSettings

    Returns
    -------
    keep : array of bool, shape (coefficient,)
        False where a coefficient lies beyond a bound at 0, so that 0 is the best that is possible.
    admissible : bool
        False where one lies beyond another bound.
    """
    keep = np.ones(len(linear), dtype=bool)
    listed = [each for each in effect.coefficients if len(linear) == len(effect.coefficients) or not each.secondary]
    if effect.physical is not None:
        ends = np.array([effect.physical(linear + way * _ERRORS * error) for way in (-1, 1)])
        physical = effect.physical(linear)
        low, high = np.array([each.bounds(vehicle) for each in listed])[: len(physical)].T
        unsure = np.isnan(ends).any(axis=0) | np.isnan(physical)
        return keep, bool(np.all(unsure | ((ends.max(axis=0) >= low) & (ends.min(axis=0) <= high))))
    low, high = np.array([each.bounds(vehicle) for each in listed]).T
    at_zero = ((linear < low) & (low == 0)) | ((linear > high) & (high == 0))
    beyond = (linear + _ERRORS * error < low) | (linear - _ERRORS * error > high)
    return ~at_zero, bool(not np.any(beyond & ~at_zero))


def information(effect: Effect, columns: int, vehicle: VehicleSettings) -> Array:
    """Give what bounds say of linear coefficients before any data.

    A coefficient that only one block of a flight determines would be anything where that block is left out; with its
    bound as the standard deviation of a normal prior it is small there.

    Parameters
    ----------
    effect : Effect
    columns : int
        Linear coefficients in use.
    vehicle : VehicleSettings

    Returns
    -------
    array, shape (coefficient,)
        One over the variance; 0 where the physical coefficients are not linear.
    """
    listed = [each for each in effect.coefficients if columns == len(effect.coefficients) or not each.secondary]
    if effect.physical is not None or len(listed) != columns:
        return np.zeros(columns)
    return np.array([1.0 / max(abs(bound) for bound in each.bounds(vehicle)) ** 2 for each in listed])
