"""The model's columns written out, block of samples after block, for what sums of products cannot tell."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.fit import Fit
from cpfls_cli.identification.least_squares import LeastSquares, Triangle
from cpfls_cli.identification.samples import Samples
from cpfls_cli.regressor.motion import RIGID, rigid_columns
from cpfls_cli.regressor.regressor import Breakpoints, Regressor

# Samples written out at a time: some 10 MB for 113 parameters.
_BLOCK = 4096


def decomposed(learned: Samples, partitions: Breakpoints, fit: Fit, rank_tolerance: float) -> tuple[Fit, LeastSquares]:
    """Solve for the linear parameters by a singular value decomposition of all rows.

    Parameters
    ----------
    learned : Samples
    partitions : sequence of array, shape (functions,)
    fit : Fit
        Gives ridge weight and column sizes.
    rank_tolerance : float

    Returns
    -------
    fit : Fit
        With the parameters of the decomposition.
    unpenalised : LeastSquares
        Of the parameters in use, without any penalty.
    """
    rigid, off = learned.ready.rigid, np.isinf(fit.ridge_weight)
    triangle = Triangle.of(_rows(learned, partitions, fit, fuzzy=not off))
    unpenalised = triangle.solve(rank_tolerance)
    if off:
        return replace(fit, rigid_body=unpenalised.coefficients), unpenalised
    parameters, rows = learned.structure.parameters, 3 * len(learned.ready.source)
    if not rigid:
        # Sums of products leave only rounding of an error far below the torque.
        error = triangle.square(unpenalised.coefficients) / rows
        return replace(fit, coefficients=unpenalised.coefficients, mean_squared_error=error), unpenalised
    penalty = np.sqrt(fit.ridge_weight * rows) * np.eye(parameters, RIGID + parameters, RIGID)
    found = triangle.below(penalty).solve(rank_tolerance).coefficients
    return replace(fit, coefficients=found[RIGID:] / fit.column_size, rigid_body=found[:RIGID]), unpenalised


def regressor_blocks(learned: Samples) -> Iterator[tuple[TorqueData, Regressor]]:
    """Yield the samples block by block, small enough to write out, with their regressors."""
    for data in learned.ready.source.chunks():
        for start in range(0, len(data), _BLOCK):
            block = data[start : start + _BLOCK]
            yield block, Regressor(learned.structure, block.motion, learned.ranges)


def _rows(learned: Samples, partitions: Breakpoints, fit: Fit, *, fuzzy: bool) -> Iterator[tuple[Array, Array]]:
    for data, regressor in regressor_blocks(learned):
        columns = [rigid_columns(data.motion)] if learned.ready.rigid else []
        if fuzzy:
            columns.append(regressor.matrix(partitions) / fit.column_size)
        scaled = np.concatenate(columns, axis=2) * learned.scale[:, None]
        yield scaled.reshape(-1, scaled.shape[2]), (data.torque * learned.scale).reshape(-1)
