"""Samples to fit or to judge, and sums over them for any partitions without a regressor in memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.dynamics import rigid_columns
from cpfls_cli.fuzzy.basis import InputRange
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.regressor import kernels
from cpfls_cli.regressor.kernels import NOTHING, Chunk, Runs, Table, motion_lines
from cpfls_cli.regressor.regressor import RIGID, Breakpoints
from cpfls_cli.regressor.structure import ModelStructure
from cpfls_cli.regressor.table import mapped_inputs, padded_breakpoints, structure_table

# Samples that are kept ready for the compiled loops, 136 bytes each to 424; more are made ready each time anew.
_KEPT = 200_000


@dataclass(frozen=True)
class Products:
    """Sums of products over samples, one for each label; the six rigid-body columns, if any, come first.

    Attributes
    ----------
    gram : array, shape (labels, columns, columns)
        ``A^T A`` of the columns.
    moment : array, shape (labels, columns)
        ``A^T tau``.
    square : array, shape (labels,)
        ``tau^T tau``.
    rows : array of int, shape (labels,)
        Rows summed over, three per sample.
    """

    gram: Array
    moment: Array
    square: Array
    rows: IntArray

    def sum(self, labels: Array | slice = slice(None)) -> Products:
        """Add up some labels; the result has one."""
        if len(self.rows) == 1 and isinstance(labels, slice):
            return self
        parts = (self.gram, self.moment, self.square, self.rows)
        return Products(*(np.sum(part[labels], axis=0, keepdims=True) for part in parts))


@dataclass(frozen=True)
class MovedProducts:
    """Products with the derivatives M of the model torque by the inner breakpoints, at fixed parameters.

    `columns`: ``A^T M``; `moved`: ``M^T M``; `residual`: ``M^T r``, r the residual; `square`: ``r^T r``.
    """

    columns: Array
    moved: Array
    residual: Array
    square: float


@dataclass(frozen=True)
class Ready:
    """Samples in the layout of the compiled loops, chunk by chunk: attitude, and `kernels.motion_lines`.

    Attributes
    ----------
    rigid : bool
        Whether columns of a rigid body come before the fuzzy ones.
    """

    source: TorqueSource
    rigid: bool

    def __reduce__(self) -> tuple[type[Ready], tuple[TorqueSource, bool]]:
        """Pickle the source alone; workers convert it themselves."""
        return type(self), (self.source, self.rigid)

    def __iter__(self) -> Iterator[tuple[Array, Array]]:
        """Convert one chunk after the other, or take those that are kept."""
        return iter(self._kept) if len(self.source) <= _KEPT else self._made()

    @cached_property
    def _kept(self) -> list[tuple[Array, Array]]:
        return list(self._made())

    def _made(self) -> Iterator[tuple[Array, Array]]:
        for data in self.source.chunks():
            motion, columns = data.motion, [data.torque[:, :, None]]
            dense = np.concatenate(columns + [rigid_columns(motion)] * self.rigid, axis=2)
            yield motion.attitude, motion_lines(motion.rate, motion.acceleration, dense)


@dataclass(frozen=True)
class Samples:
    """Samples whose rows are scaled by axis and added up by label.

    Attributes
    ----------
    ranges : tuple of InputRange
        Of roll and pitch over the training data.
    scale : array, shape (3,)
    label : array of int, shape (samples,)
        From 0.
    """

    ready: Ready
    structure: ModelStructure
    ranges: tuple[InputRange, InputRange]
    scale: Array
    label: IntArray
    labels: int

    def __reduce__(self) -> tuple[type[Samples], tuple[object, ...]]:
        """Pickle without what is kept for the compiled loops, as `Ready`."""
        return type(self), tuple(getattr(self, field.name) for field in fields(self))

    @classmethod
    def of(cls, ready: Ready, structure: ModelStructure, ranges: tuple[InputRange, InputRange]) -> Samples:
        """Take samples as they are, all under one label."""
        return cls(ready, structure, ranges, np.ones(3), np.zeros(len(ready.source), dtype=np.int64), 1)

    @cached_property
    def table(self) -> Table:
        """The structure as compiled loops read it."""
        return structure_table(self.structure, self.ranges)

    def products(self, partitions: Breakpoints) -> Products:
        """Add up the products of all columns with each other and with the torque."""
        P, dense = self.table.parameters, self._dense_products
        gram, moment = np.zeros((self.labels, P, P)), np.zeros((self.labels, P, dense.shape[1]))
        self._add_up(kernels.GRAM, padded_breakpoints(partitions), (NOTHING, NOTHING), (gram, moment, NOTHING))
        gram = gram + gram.swapaxes(1, 2)
        gram[:, np.arange(P), np.arange(P)] *= 0.5
        if self.ready.rigid:
            rigid = moment[:, :, 1:]
            gram = np.block([[dense[:, 1:, 1:], rigid.swapaxes(1, 2)], [rigid, gram]])
        columns = np.concatenate([dense[:, 1:, 0], moment[:, :, 0]], axis=1)
        return Products(gram, columns, dense[:, 0, 0], 3 * np.bincount(self.label, minlength=self.labels))

    def errors(self, partitions: Breakpoints, coefficients: Array, rigid_body: Array) -> tuple[Array, Array]:
        """Add up the squared residuals of a model and find the largest.

        Parameters
        ----------
        coefficients : array, shape (parameters,)
        rigid_body : array, shape (6,)
            Not used without a rigid body.

        Returns
        -------
        square : array, shape (labels,)
        largest : array, shape (labels,)
        """
        sums = square, largest, _ = np.zeros((self.labels, 1, 1)), np.zeros((self.labels, 1, 1)), NOTHING
        models = coefficients[None], self._weights(rigid_body)
        self._add_up(kernels.ERRORS, padded_breakpoints(partitions), models, sums)
        return square[:, 0, 0], largest[:, 0, 0]

    def projected(self, partitions: Breakpoints, parameters: Array, directions: Array) -> tuple[Array, Array]:
        """Multiply residual and columns directly, without the loss of digits of products of products.

        Parameters
        ----------
        parameters : array, shape (columns,)
        directions : array, shape (columns, n)

        Returns
        -------
        square : array, shape (n, n)
            ``(A V)^T (A V)`` of the directions V.
        back : array, shape (columns,)
            ``A^T r`` of the residual of the parameters.
        """
        rigid = RIGID if self.ready.rigid else 0
        # In the layout of `errors`, or the loops would be compiled anew.
        models = np.ascontiguousarray(np.vstack([parameters, -directions.T]))
        weights = np.hstack([np.zeros((len(models), 1)), -models[:, :rigid]])
        weights[0, 0] = 1.0
        square, columns = np.zeros((len(models), len(models))), 1 + rigid
        back, dense_back = np.zeros((self.table.parameters, 1)), np.zeros((columns, 1))
        coefficients, sums = np.ascontiguousarray(models[:, rigid:]), (square[None], back[None], dense_back)
        self._add_up(kernels.COMBINED, padded_breakpoints(partitions), (coefficients, weights), sums)
        return _mirrored(square)[1:, 1:], np.concatenate([dense_back[1:, 0], back[:, 0]])

    def moved(self, partitions: Breakpoints, coefficients: Array, rigid_body: Array) -> MovedProducts:
        """Add up the products with the derivatives of the torque by the inner breakpoints.

        Parameters
        ----------
        coefficients : array, shape (parameters,)
        rigid_body : array, shape (6,)
            Not used without a rigid body.
        """
        B, weights = self.table.breakpoints, self._weights(rigid_body)
        cross, square = np.zeros((self.table.parameters, B + 1)), np.zeros((B + 1, B + 1))
        dense = np.zeros((weights.shape[1], B + 1))
        sums = square[None], cross[None], dense
        self._add_up(kernels.MOVED, padded_breakpoints(partitions), (coefficients[None], weights), sums)
        square = _mirrored(square)
        return MovedProducts(
            np.vstack([dense[1:, :B], cross[:, :B]]), square[:B, :B], square[:B, B], float(square[B, B])
        )

    def _add_up(
        self, what: int, breakpoints: Array, models: tuple[Array, Array], sums: tuple[Array, Array, Array]
    ) -> None:
        """Add up sums over all samples, in place; see `kernels.add_sums`."""
        for chunk, runs, label in self._runs(breakpoints):
            kernels.add_sums(what, self.table, breakpoints, chunk, runs, self.scale, label, models, sums)

    @cached_property
    def _dense_products(self) -> Array:
        """Products of torque and rigid-body columns, shape (labels, dense, dense)."""
        columns = 1 + (RIGID if self.ready.rigid else 0)
        total = np.zeros((self.labels, columns, columns))
        for chunk, label in self._chunks():
            dense = chunk.motion[kernels.MOTION :].reshape(columns, 3, -1) * self.scale[:, None]
            for value in np.unique(label):
                rows = dense[:, :, label == value].reshape(columns, -1)
                total[value] += rows @ rows.T
        return total

    @cached_property
    def _kept(self) -> list[Chunk]:
        return list(self._mapped())

    def _mapped(self) -> Iterator[Chunk]:
        for attitude, motion in self.ready:
            yield Chunk(motion, mapped_inputs(self.table, attitude))

    def _chunks(self) -> Iterator[tuple[Chunk, IntArray]]:
        start = 0
        for chunk in self._kept if len(self.ready.source) <= _KEPT else self._mapped():
            stop = start + chunk.motion.shape[1]
            yield chunk, self.label[start:stop]
            start = stop

    def _runs(self, breakpoints: Array) -> Iterator[tuple[Chunk, Runs, IntArray]]:
        """Chunks with their samples in the order of what they fire, kept until other partitions are asked for."""
        kept = self._ordered.get(breakpoints.tobytes(), [])
        for number, (chunk, label) in enumerate(self._chunks()):
            if number == len(kept):
                kept.append(kernels.runs_of(self.table, breakpoints, chunk.inputs))
            yield chunk, kept[number], label
        self._ordered.clear()
        if len(self.ready.source) <= _KEPT:
            self._ordered[breakpoints.tobytes()] = kept

    @cached_property
    def _ordered(self) -> dict[bytes, list[Runs]]:
        return {}

    def _weights(self, rigid_body: Array) -> Array:
        return np.concatenate([[1.0], -rigid_body])[None] if self.ready.rigid else np.ones((1, 1))


def _mirrored(triangle: Array) -> Array:
    """Make a symmetric matrix of an upper triangle whose entries mean the sum with their mirror images."""
    total = triangle + triangle.T
    total[np.diag_indices(len(total))] *= 0.5
    return total
