"""Bands that hold the truth in 95 of 100 flights: of parameters, of the inertia matrix, of torque."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import stats

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.identification.model import Model
from cpfls_cli.inertia import INERTIA_PLACES, symmetric
from cpfls_cli.regressor.motion import RIGID, Motion, rigid_columns
from cpfls_cli.regressor.regressor import Regressor
from cpfls_cli.validation.bootstrap import Draws
from cpfls_cli.vehicle.rigid_body import inertia_matrix

COVERAGE = 0.95
_BATCH = 1024


def band(estimate: Array, drawn: Array, blocks: int) -> tuple[Array, Array]:
    """Put a band around an estimate.

    ``estimate +- t s``: s is the root mean square deviation of the draws, and t the quantile of Student's distribution
    with one degree of freedom less than there are blocks.

    Parameters
    ----------
    estimate : array, shape (...)
    drawn : array, shape (draws, ...)
    blocks : int

    Returns
    -------
    low, high : array, shape (...)
    """
    half = _quantile(blocks) * np.sqrt(np.mean((drawn - estimate) ** 2, axis=0))
    return estimate - half, estimate + half


def inertia_band(model: Model, draws: Draws, attitude: Array) -> tuple[Array, Array]:
    """Put a band around the inertia matrix of a model, entry by entry.

    Of a model without a ridge, attitudes that training did not visit have a band of what its structure does there, not
    of what the vehicle does: coefficients that no sample determines do not scatter.

    Parameters
    ----------
    model : Model
    draws : Draws
    attitude : array, shape (samples, 3), rad

    Returns
    -------
    low, high : array, shape (samples, 3, 3), kg m^2
    """
    half = np.zeros((len(attitude), 3, 3))
    deviations = _deviations(model, draws)
    for part in _batches(len(attitude)):
        for (row, column), rows, columns in _inertia_rows(model, attitude[part]):
            half[part, row, column] = half[part, column, row] = _spread(rows, deviations[columns])
    half *= _quantile(draws.blocks)
    value = model.inertia(attitude).value
    return value - half, value + half


def torque_band(model: Model, draws: Draws, motion: Motion) -> tuple[Array, Array]:
    """Put a band around the torque that a model predicts.

    It is the band of the prediction; a measured torque has its own noise beside it.

    Returns
    -------
    low, high : array, shape (samples, 3), N m
    """
    half = np.zeros((len(motion), 3))
    deviations = _deviations(model, draws)
    for part in _batches(len(motion)):
        own = motion[part]
        matrix = Regressor(model.structure, own, model.ranges).matrix(model.partitions)
        half[part] = _spread(np.concatenate([rigid_columns(own), matrix], axis=2), deviations)
    half *= _quantile(draws.blocks)
    value = model.torque(motion)
    return value - half, value + half


def _inertia_rows(model: Model, attitude: Array) -> Iterator[tuple[tuple[int, int], Array, IntArray]]:
    """Yield each entry of the inertia matrix: its place, its basis, shape (samples, columns), and their numbers."""
    still = Motion(attitude, np.zeros_like(attitude), np.zeros_like(attitude))
    regressor = Regressor(model.structure, still, model.ranges)
    rigid = np.stack([inertia_matrix(attitude, symmetric(unit)) for unit in np.eye(RIGID)], axis=-1)
    places = {(block.function.row, block.function.column): i for i, block in enumerate(model.structure.blocks)}
    for place in INERTIA_PLACES:
        rows, columns = rigid[:, *place], np.arange(RIGID, dtype=np.int64)
        if place in places:
            index = places[place]
            fuzzy = model.structure.blocks[index].columns
            rows = np.hstack([rows, regressor.basis(index, model.partitions).value])
            columns = np.append(columns, RIGID + np.arange(fuzzy.start, fuzzy.stop))
        yield place, rows, columns


def _deviations(model: Model, draws: Draws) -> Array:
    """Deviations of the draws from the model, rigid body first, shape (6 + parameters, draws)."""
    return np.hstack([draws.rigid_body - model.rigid_body, draws.coefficients - model.coefficients]).T


def _spread(rows: Array, deviations: Array) -> Array:
    return np.asarray(np.sqrt(np.mean((rows @ deviations) ** 2, axis=-1)))


def _quantile(blocks: int) -> float:
    return float(stats.t.ppf(0.5 + 0.5 * COVERAGE, max(blocks - 1, 1)))


def _batches(samples: int) -> Iterator[slice]:
    return (slice(start, start + _BATCH) for start in range(0, samples, _BATCH))
