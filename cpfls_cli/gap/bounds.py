"""Physical bounds: a coefficient that no vehicle has is no explanation."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.effects.effect import Effect
from cpfls_cli.vehicle.settings import VehicleSettings


def within_bounds(effect: Effect, linear: Array, vehicle: VehicleSettings) -> tuple[BoolArray, bool]:
    """Hold coefficients against the bounds of their effect.

    Parameters
    ----------
    effect : Effect
    linear : array, shape (coefficient,)
        NaN-free; linear coefficients of a fit.
    vehicle : VehicleSettings

    Returns
    -------
    keep : array of bool, shape (coefficient,)
        False where a coefficient lies beyond a bound at 0, so that 0 is the best that is possible.
    admissible : bool
        False where one lies beyond another bound.
    """
    keep = np.ones(len(linear), dtype=bool)
    if effect.physical is not None:
        physical = effect.physical(linear)
        bounds = np.array([c.bounds(vehicle) for c in effect.coefficients])[: len(physical)]
        open_ = np.isnan(physical)
        return keep, bool(np.all(open_ | ((physical >= bounds[:, 0]) & (physical <= bounds[:, 1]))))
    bounds = np.array([c.bounds(vehicle) for c in effect.coefficients])
    below, above = linear < bounds[:, 0], linear > bounds[:, 1]
    at_zero = (below & (bounds[:, 0] == 0)) | (above & (bounds[:, 1] == 0))
    return ~at_zero, bool(not np.any((below | above) & ~at_zero))
