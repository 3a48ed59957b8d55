"""The mean of a residual over two signals, on a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array

_OUTER_PERCENT = 1.0


@dataclass(frozen=True)
class HeatMap:
    """Mean residual in the cells of a grid over two signals.

    Attributes
    ----------
    edges : tuple of array, shape (bins + 1,)
        Of the first and the second signal.
    mean : array, shape (bins, bins)
        In the unit of the residual; not a number in empty cells.
    count : array, shape (bins, bins)
        Windows in each cell.
    """

    edges: tuple[Array, Array]
    mean: Array
    count: Array


def heat_map(residual: Array, first: Array, second: Array, bins: int = 12) -> HeatMap:
    """Average a residual over the cells of two signals.

    The outer cells also take the one per cent of windows beyond each end of the grid, so that a few windows do not
    stretch it.

    Parameters
    ----------
    residual : array, shape (window,)
    first, second : array, shape (window,)
        Windows where one is not a number are left out.
    bins : int
        Cells along each signal.
    """
    known = np.isfinite(residual) & np.isfinite(first) & np.isfinite(second)
    signals = [first[known], second[known]]
    edges = [_edges(signal, bins) for signal in signals]
    cells = [np.clip(np.searchsorted(e, s, side="right") - 1, 0, bins - 1) for e, s in zip(edges, signals, strict=True)]
    flat = cells[0] * bins + cells[1]
    count = np.bincount(flat, minlength=bins**2).astype(float)
    total = np.bincount(flat, weights=residual[known], minlength=bins**2)
    mean = np.divide(total, count, out=np.full(bins**2, np.nan), where=count > 0)
    return HeatMap((edges[0], edges[1]), mean.reshape(bins, bins), count.reshape(bins, bins))


def _edges(signal: Array, bins: int) -> Array:
    if not len(signal):
        return np.linspace(0.0, 1.0, bins + 1)
    low, high = np.percentile(signal, [_OUTER_PERCENT, 100 - _OUTER_PERCENT])
    # A signal that stands still still needs cells of some width.
    return np.linspace(low, high if high > low else low + max(1e-9, 1e-9 * abs(low)), bins + 1)
