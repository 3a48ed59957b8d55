"""Bands that hold the truth in 95 of 100 flights: of parameters, of the inertia matrix, of torque."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.dynamics.inertia_functions import InertiaFunctions
from cpfls_cli.dynamics.rigid_body import inertia_matrix, rigid_columns
from cpfls_cli.inertia import INERTIA_ENTRIES, symmetric
from cpfls_cli.regressor.motion import RIGID, Motion
from cpfls_cli.regressor.regressor import Regressor
from cpfls_cli.validation.physical import cell_centres
from cpfls_cli.validation.replay import CLEAR

if TYPE_CHECKING:
    from cpfls_cli.validation.bootstrap import Draws

COVERAGE = 0.95
# Attitudes at a time, which bounds the memory.
_BATCH = 1024

# Cells times draws at a time: 50 MB for the six entries.
_AT_ONCE = 1_000_000


def band(estimate: Array, drawn: Array, blocks: int) -> tuple[Array, Array]:
    """Put a band around an estimate.

    ``estimate +- t s``: s is the root mean square deviation of the draws, and t the quantile of Student's distribution
    with one degree of freedom less than there are blocks.

    Parameters
    ----------
    estimate : array, shape (...)
    drawn : array, shape (draws, ...)

    Returns
    -------
    low, high : array, shape (...)
    """
    half = _quantile(blocks) * np.sqrt(np.mean((drawn - estimate) ** 2, axis=0))
    return estimate - half, estimate + half


def inertia_band(
    model: InertiaFunctions, draws: Draws, attitude: Array, value: Array | None = None
) -> tuple[Array, Array]:
    """Put a band around the inertia matrix of a model, entry by entry.

    Of a model without a ridge, attitudes that training did not visit have a band of what its structure does there, not
    of what the vehicle does: coefficients that no sample determines do not scatter.

    Parameters
    ----------
    attitude : array, shape (samples, 3), rad
    value : array, shape (samples, 3, 3), or None
        The model's inertia matrix there, where it is at hand.

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
    if value is None:
        value = model.inertia(attitude).value
    return value - half, value + half


def torque_band(
    model: InertiaFunctions, draws: Draws, motion: Motion, value: Array | None = None
) -> tuple[Array, Array]:
    """Put a band around the torque that a model predicts.

    It is the band of the prediction; a measured torque has its own noise beside it.

    Parameters
    ----------
    value : array, shape (samples, 3), or None
        The model's torque, where it is at hand.

    Returns
    -------
    low, high : array, shape (samples, 3), N m
    """
    half = np.zeros((len(motion), 3))
    deviations = _deviations(model, draws)
    for part in _batches(len(motion)):
        some = motion[part]
        matrix = Regressor(model.structure, some, model.ranges).matrix(model.partitions)
        half[part] = _spread(np.concatenate([rigid_columns(some), matrix], axis=2), deviations)
    half *= _quantile(draws.blocks)
    if value is None:
        value = model.torque(motion)
    return value - half, value + half


def _inertia_rows(model: InertiaFunctions, attitude: Array) -> Iterator[tuple[tuple[int, int], Array, IntArray]]:
    """Yield the entries of the inertia matrix: row and column, basis, shape (samples, columns), and which columns."""
    still = Motion(attitude, np.zeros_like(attitude), np.zeros_like(attitude))
    regressor = Regressor(model.structure, still, model.ranges)
    rigid = np.stack([inertia_matrix(attitude, symmetric(unit)) for unit in np.eye(RIGID)], axis=-1)
    blocks = {(block.function.row, block.function.column): i for i, block in enumerate(model.structure.blocks)}
    for entry in INERTIA_ENTRIES:
        rows, columns = rigid[:, *entry], np.arange(RIGID, dtype=np.int64)
        if entry in blocks:
            index = blocks[entry]
            fuzzy = model.structure.blocks[index].columns
            rows = np.hstack([rows, regressor.basis(index, model.partitions).value])
            columns = np.append(columns, RIGID + np.arange(fuzzy.start, fuzzy.stop))
        yield entry, rows, columns


def _deviations(model: InertiaFunctions, draws: Draws) -> Array:
    """Deviations of the draws from the model, rigid body first, shape (6 + parameters, draws)."""
    return np.hstack([draws.rigid_body - model.rigid_body, draws.coefficients - model.coefficients]).T


def _spread(rows: Array, deviations: Array) -> Array:
    return np.asarray(np.sqrt(np.mean((rows @ deviations) ** 2, axis=-1)))


def _quantile(blocks: int) -> float:
    return float(stdtrit(max(blocks - 1, 1), 0.5 + 0.5 * COVERAGE))


def _batches(samples: int) -> Iterator[slice]:
    return (slice(start, start + _BATCH) for start in range(0, samples, _BATCH))


def definite_share(model: InertiaFunctions, draws: Draws) -> float | None:
    """Compute the share of draws whose D(q) is positive definite at the centres of all cells visited; None without any.

    Cells within 17 degrees of a vertical pitch are left out, as they are from the windows replayed: there the smallest
    eigenvalue of every body falls with the square of cos(pitch), and all noise is larger.
    """
    attitude = cell_centres(model.visited)
    attitude = attitude[np.abs(np.cos(attitude[:, 1])) >= CLEAR]
    if len(attitude) == 0:
        return None
    parameters = np.hstack([draws.rigid_body, draws.coefficients]).T
    basis, batch = list(_inertia_rows(model, attitude)), max(_AT_ONCE // len(attitude), 1)
    starts = range(0, parameters.shape[1], batch)
    definite = [_definite([rows @ parameters[columns, s : s + batch] for _, rows, columns in basis]) for s in starts]
    return float(np.mean(np.concatenate(definite)))


def _definite(entries: list[Array]) -> BoolArray:
    """Flag draws, shape (draws,), by the leading minors (Sylvester) of entries in the order of `INERTIA_ENTRIES`."""
    d11, d22, d33, d12, d13, d23 = entries
    minor = d11 * d22 - d12**2
    determinant = d33 * minor - d11 * d23**2 + 2 * d12 * d13 * d23 - d22 * d13**2
    return np.asarray(np.all((d11 > 0) & (minor > 0) & (determinant > 0), axis=0))
