"""The row space of a regressor read in chunks, and its samples in coordinates of that space."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy.linalg

from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError

Chunks = Callable[[], Iterable[Array]]
"""Starts one pass over a regressor: arrays of shape (samples of the chunk, 3, parameters), in order."""

# Work goes in blocks of this many samples whatever the chunks are, so that no rounding depends on the chunks.
BLOCK = 1024


class Spectrum:
    """Rank and condition number by the kept singular values of a regressor."""

    singular_values: Array

    @property
    def rank(self) -> int:
        """Numerical rank of all samples."""
        return len(self.singular_values)

    @property
    def condition_number(self) -> float:
        """Condition number of all samples over the kept singular values."""
        return float(self.singular_values[0] / self.singular_values[-1])


@dataclass(frozen=True)
class Survey(Spectrum):
    """Number of samples and row space of a regressor, found in one pass.

    `chunks` starts another pass; `basis` of the row space is orthonormal, shape (parameters, rank); the kept singular
    values of all samples descend, those below the tolerance, a fraction of the largest, count as zero.
    """

    chunks: Chunks
    samples: int
    basis: Array
    singular_values: Array
    rank_tolerance: float

    def projected(self) -> Iterator[Array]:
        """Yield all samples in coordinates of the row space, in blocks of shape (samples, 3, rank)."""
        for block in _blocks(self.chunks()):
            yield project(block, self.basis)


def survey(chunks: Chunks, rank_tolerance: float) -> Survey:
    """Count the samples of a regressor and find its row space, in one pass.

    The triangular factor ``T`` with ``T^T T = Q^T Q`` is accumulated by QR, which does not square the condition
    number; its right singular vectors are those of all rows.

    Parameters
    ----------
    chunks : callable
        Starts a pass over the regressor: an iterable of arrays of shape (samples, 3, parameters), not empty.
        Every pass must yield the same samples in the same order; how they are cut into chunks does not matter.

    Raises
    ------
    ComputationError
        If there is no sample, a shape is wrong, a value is not finite, or all values are zero.
    """
    samples, triangle = _accumulate(_blocks(_checked(chunks())))
    _, values, basis = scipy.linalg.svd(triangle, full_matrices=False)
    rank = int(np.count_nonzero(values > rank_tolerance * values[0]))
    if rank == 0:
        raise ComputationError("Q: every value is zero, so no sample is worth more than another")
    return Survey(chunks, samples, basis[:rank].T, values[:rank], rank_tolerance)


def project(rows: Array, vectors: Array) -> Array:
    """Multiply every sample's rows with the same vectors, in one matrix product, to shape (samples, 3, vectors)."""
    product: Array = rows.reshape(-1, rows.shape[2]) @ vectors
    return product.reshape(len(rows), 3, -1)


def _accumulate(blocks: Iterable[Array]) -> tuple[int, Array]:
    samples, triangle = 0, np.zeros((0, 0))
    for block in blocks:
        rows = block.reshape(-1, block.shape[2])
        stacked = np.vstack([triangle, rows]) if samples else rows
        triangle = np.asarray(scipy.linalg.qr(stacked, mode="r", check_finite=False)[0], dtype=np.float64)[
            : rows.shape[1]
        ]
        samples += len(block)
    if not samples:
        raise ComputationError("Q: there is no sample")
    return samples, triangle


def _blocks(chunks: Iterable[Array]) -> Iterator[Array]:
    """Cut chunks of any size into blocks of equal size, but for the last."""
    held: list[Array] = []
    for chunk in chunks:
        missing = BLOCK - sum(map(len, held))
        edges = [0, *range(missing, len(chunk), BLOCK), len(chunk)]
        for first, last in pairwise(edges):
            held.append(chunk[first:last])
            if sum(map(len, held)) == BLOCK:
                yield held[0] if len(held) == 1 else np.concatenate(held)
                held = []
    if held:
        yield np.concatenate(held)


def _checked(chunks: Iterable[Array]) -> Iterator[Array]:
    """Pass good chunks on; after the last one, refuse the regressor if a value was not finite."""
    samples, broken = 0, np.zeros(0, dtype=np.int64)
    columns: int | None = None
    for chunk in chunks:
        if chunk.ndim != 3 or chunk.shape[1] != 3 or 0 in chunk.shape or chunk.shape[2] != (columns or chunk.shape[2]):
            expected = "parameters" if columns is None else columns
            raise ComputationError(f"Q: expected shape (samples, 3, {expected}), got {chunk.shape}")
        columns = chunk.shape[2]
        bad = np.flatnonzero(~np.isfinite(chunk).all(axis=(1, 2)))
        broken = np.concatenate([broken, samples + bad])
        samples += len(chunk)
        if not broken.size:
            yield chunk
    if broken.size:
        raise ComputationError(
            f"Q: sample {broken[0]} is not finite ({broken.size} of {samples} samples in all); "
            "remove such samples before the reduction"
        )


@dataclass(frozen=True)
class RowSpace(Spectrum):
    """Samples of a regressor, expressed in an orthonormal basis of the row space of all its samples.

    `rows`: ``Q V_r``, the same nonzero singular values as Q, for every subset of samples; the rest as at `Survey`.
    """

    rows: Array
    singular_values: Array
    rank_tolerance: float

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.rows)

    @property
    def smallest_samples(self) -> int:
        """Fewest samples that can reach the rank, at three rows each."""
        return -(-self.rank // 3)


def space_of(surveyed: Survey, rows: Array) -> RowSpace:
    """Place some or all samples, projected, in the row space of a surveyed regressor."""
    return RowSpace(rows, surveyed.singular_values, surveyed.rank_tolerance)
