"""Samples to fit or to judge, and sums over them for any partitions without a regressor in memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.dynamics import rigid_columns
from cpfls_cli.fuzzy.basis import InputRange, map_input
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.regressor import kernels
from cpfls_cli.regressor.kernels import NOTHING, ONE, STEP, Chunk, Program, Runs, Table, motion_lines
from cpfls_cli.regressor.regressor import RIGID, Breakpoints
from cpfls_cli.regressor.structure import PITCH, ROLL, Block, ModelStructure, Partition

_Line = int | None
"""Number of a line; None where all would be zero."""

_Three = tuple[_Line, _Line, _Line]
"""Lines of value, slope by roll and slope by pitch."""

_ALWAYS: _Three = (ONE, None, None)
# Derivatives stand behind all other lines: their numbers are counted from here until those are known.
_BEHIND = 10**6


@dataclass
class _Writer:
    """Sums of products of lines, without what is zero or the same as an earlier one."""

    free: int
    lines: int = 0
    sums: list[tuple[int, ...]] = field(default_factory=list)

    def add(self, *products: tuple[_Line, _Line], to: int | None = None, factor: int = kernels.UNIT) -> _Line:
        """Write a sum to a line, the next free one where none is given, and give the line."""
        kept = [(a, b) for a, b in products if a is not None and b is not None]
        if to is None:
            if not kept:
                return None
            if len(kept) == 1 and ONE in kept[0] and factor == kernels.UNIT:
                return max(kept[0])
            to, self.free = self.free, self.free + 1
            self.lines = max(self.lines, self.free)
        *first, last = kept or [(kernels.ZERO, kernels.ZERO)]
        if len(first) > 1:
            both = self.add(*first)
            assert both is not None, "of two products that are kept"
            first = [(both, ONE)]
        (a, b), (c, d) = first[0] if first else (kernels.ZERO, kernels.ZERO), last
        self.sums.append((to, factor, a, b, c, d))
        return to

    def product(self, left: _Three, right: _Three) -> _Three:
        """Write the product of two functions of roll and pitch."""
        by_roll, by_pitch = (self.add((left[k], right[0]), (left[0], right[k])) for k in (1, 2))
        return self.add((left[0], right[0])), by_roll, by_pitch


class _Layout:
    """Lines of a structure."""

    def __init__(self, structure: ModelStructure) -> None:
        self.structure, settings = structure, structure.settings
        self.single = 2 * settings.harmonic_order if settings.consequents == "harmonic" else 1
        self.rate = self.antecedent(2)
        free = self.rate + kernels.MOTION
        self.degrees: list[_Line] = []
        for partition in structure.partitions:
            self.degrees.append(None if _always(structure, partition) else free)
            free += 0 if _always(structure, partition) else kernels.OF_PARTITION
        self.writer = _Writer(free, free)
        self.of_angle = [[_ALWAYS, *self._single(angle)] for angle in (ROLL, PITCH)]
        self.joint = self._joint(tensor=settings.products == "tensor")

    def antecedent(self, angle: int) -> int:
        """Find the first line of what is known of an angle."""
        return kernels.FIRST_LINE + angle * (2 + 2 * self.single)

    def program(self) -> Program:
        """Write the columns of all blocks, then the derivatives by their breakpoints."""
        blocks, writer = self.structure.blocks, self.writer
        carried = [self._carried(block) for block in blocks]
        kept, columns, features = writer.free, list[tuple[int, ...]](), list[_Three]()
        for block, own in zip(blocks, carried, strict=True):
            self._write_columns(block, own, columns)
            writer.free = kept
        once, moves = len(writer.sums), list[tuple[int, ...]]()
        for block, own in zip(blocks, carried, strict=True):
            for input_index in range(len(block.partitions)):
                moves += self._moves(block, own, input_index, len(features))
                writer.free = kept
            features += self._features(block)
        sums = np.array(writer.sums, dtype=np.int64)
        sums[:, 0] += (sums[:, 0] >= _BEHIND) * (writer.lines - _BEHIND)
        return Program(
            partitions=np.array(list(self._partitions()), dtype=np.int64),
            columns=np.array(columns, dtype=np.int64),
            sums=sums,
            moves=np.array(moves, dtype=np.int64).reshape(-1, kernels.OF_MOVE),
            features=np.array([[-1 if line is None else line for line in each] for each in features], dtype=np.int64),
            once=once,
            moved=writer.lines,
        )

    def _partitions(self) -> Iterator[tuple[int, ...]]:
        inner = 0
        for partition, degrees in zip(self.structure.partitions, self.degrees, strict=True):
            rules = partition.rules(circular=self.structure.circular)
            known = self.antecedent(partition.input), partition.functions, rules, inner
            yield (*known, -1 if degrees is None else degrees)
            inner += max(partition.functions - 2, 0)
        yield kernels.FIRST_LINE, 1, 1, 0, -1

    def _single(self, angle: int) -> Iterator[_Three]:
        first = self.antecedent(angle) + 2
        for value in range(first, first + self.single):
            yield _of(angle, value, value + self.single)

    def _joint(self, tensor: bool) -> list[_Three]:
        roll, pitch = self.of_angle
        if tensor:
            return [self.writer.product(left, right) for left in roll for right in pitch]
        return [*roll, *pitch[1:]]

    def _features(self, block: Block) -> list[_Three]:
        inputs = block.function.inputs
        if len(inputs) == 2:
            return self.joint
        return self.of_angle[inputs[0]] if inputs else [_ALWAYS]

    def _carried(self, block: Block) -> list[_Three]:
        """Write how an inertia function enters the torque about each axis; method.md section 2."""
        row, column, inputs, add = block.function.row, block.function.column, block.function.inputs, self.writer.add
        energy = None
        if inputs:
            factor = kernels.HALF_LESS if row == column else kernels.LESS
            energy = add((self.rate + row, self.rate + column), factor=factor)
        carried: list[_Three] = []
        for axis in range(3):
            other = column if axis == row else row
            moves = self.rate + other if axis in (row, column) else None
            by_roll, by_pitch = (
                add((moves, self.rate + angle), (energy if axis == angle else None, ONE)) if angle in inputs else None
                for angle in (ROLL, PITCH)
            )
            carried.append((None if moves is None else moves + 3, by_roll, by_pitch))
        return carried

    def _write_columns(self, block: Block, carried: list[_Three], columns: list[tuple[int, ...]]) -> None:
        add, features = self.writer.add, self._features(block)
        crossed = [[add((by[1], each[1]), (by[2], each[2])) for by in carried] for each in features]
        (roll, along), (pitch, across) = (self._place(block, angle) for angle in (ROLL, PITCH))
        for i, left in enumerate(self._firing(roll, ROLL)):
            for j, right in enumerate(self._firing(pitch, PITCH)):
                fires = self.writer.product(left, right)
                by_axis = [add(*zip(by, fires, strict=True)) for by in carried]
                for f, feature in enumerate(features):
                    for axis in range(3):
                        to, products = -1 - 3 * len(columns) - axis, (by_axis[axis], feature[0])
                        add(products, (fires[0], crossed[f][axis]), to=to, factor=kernels.OF_AXIS + axis)
                    columns.append((block.columns.start + f, roll, i, along, pitch, j, across))

    def _moves(self, block: Block, carried: list[_Three], input_index: int, first: int) -> Iterator[tuple[int, ...]]:
        """Write the derivatives of the torque by the breakpoints of one input, of known step, at both ends."""
        index, angle = block.partitions[input_index], block.function.inputs[input_index]
        if self.structure.partitions[index].functions <= 2:
            return
        add, (other, across) = self.writer.add, self._place(block, 1 - angle)
        ends = []
        for end in range(2):
            by_value = add((kernels.BY_DEGREE, STEP))
            by_own = add((kernels.BY_SLOPE, STEP), (kernels.BY_DEGREE, STEP + 1 + angle))
            by_other = add((kernels.BY_DEGREE, STEP + 2 - angle), (kernels.BY_DEGREE, STEP + 3))
            for axis, by in enumerate(carried):
                products = (by[0], by_value), (by[1 + angle], by_own), (by[2 - angle], by_other)
                add(*products, to=_BEHIND + 3 * (2 * index + end) + axis, factor=kernels.OF_AXIS + axis)
            ends.append(len(self.writer.sums))
        firing = self._firing(other, 1 - angle)
        strides = index, self._place(block, angle)[1], other, across
        yield (*strides, len(firing), firing[0][0] or ONE, block.columns.start, block.features, first, *ends)

    def _place(self, block: Block, angle: int) -> tuple[int, int]:
        """Find the partition of one input of a block, and how many columns lie between its rules."""
        inputs, none = block.function.inputs, len(self.degrees)
        if angle not in inputs:
            return none, 0
        behind = [self.structure.partitions[i] for i in block.partitions[inputs.index(angle) + 1 :]]
        rules = [partition.rules(circular=self.structure.circular) for partition in behind]
        return block.partitions[inputs.index(angle)], block.features * int(np.prod(rules, dtype=np.int64))

    def _firing(self, index: int, angle: int) -> list[_Three]:
        """Find the lines of the functions of a partition that fire at a time."""
        first = self.degrees[index] if index < len(self.degrees) else None
        return [_ALWAYS] if first is None else [_of(angle, first + i, first + kernels.SLOPE + i) for i in range(2)]


def _of(angle: int, value: int, slope: int) -> _Three:
    return (value, slope, None) if angle == ROLL else (value, None, slope)


def _always(structure: ModelStructure, partition: Partition) -> bool:
    """Tell whether one rule always fires: one alone, and two joined into one."""
    return partition.functions == 1 or (structure.circular and partition.functions == 2)


def structure_table(structure: ModelStructure, ranges: tuple[InputRange, InputRange]) -> Table:
    """Write a model structure as a table.

    Parameters
    ----------
    ranges : tuple of InputRange
        Of roll and pitch over the training data.
    """
    settings, program = structure.settings, _Layout(structure).program()
    return Table(
        program=program,
        parameters=structure.parameters,
        breakpoints=sum(max(partition.functions - 2, 0) for partition in structure.partitions),
        circular=structure.circular,
        data_range=settings.input_map == "data-range",
        harmonic_order=settings.harmonic_order if settings.consequents == "harmonic" else 0,
        ranges=np.array([(data_range.minimum, data_range.maximum) for data_range in ranges]),
        antecedents=tuple(np.unique(program.partitions[:, 0]).tolist()),
    )


def mapped_inputs(table: Table, attitude: Array) -> Array:
    """Map roll and pitch to antecedent and consequents with their slopes; see `cpfls_cli.fuzzy.basis.map_input`.

    Parameters
    ----------
    attitude : array, shape (samples, 3), rad

    Returns
    -------
    array, shape (4 + 4 * features, samples)
        Antecedent, its slope, consequent features and their slopes of roll, then of pitch. The slope of an antecedent
        beyond the partition is zero, as that of its membership functions is.
    """
    lines: list[Array] = []
    harmonics = np.arange(1, table.harmonic_order + 1)[:, None]
    for angle, ends in zip(attitude.T[:2], table.ranges.tolist(), strict=True):
        found = map_input(angle, "data-range" if table.data_range else "full-circle", table.circular, InputRange(*ends))
        inside = (found.antecedent >= 0.0) & (found.antecedent <= 1.0)
        lines += [found.antecedent, np.where(inside, found.antecedent_slope, 0.0)]
        if table.harmonic_order:
            sine, cosine = np.sin(harmonics * angle), np.cos(harmonics * angle)
            lines += [*sine, *cosine, *(harmonics * cosine), *(-harmonics * sine)]
        else:
            lines += [found.consequent, found.consequent_slope]
    # In one layout, whatever that of the attitude: for each the loops would be compiled anew.
    return np.ascontiguousarray(np.stack(lines))


def padded_breakpoints(partitions: Breakpoints) -> Array:
    """Stack the breakpoints of all partitions.

    Returns
    -------
    array, shape (partitions, most functions)
        Zero after the last breakpoint of a partition.
    """
    stacked = np.zeros((len(partitions), max(len(breakpoints) for breakpoints in partitions)))
    for row, breakpoints in zip(stacked, partitions, strict=True):
        row[: len(breakpoints)] = breakpoints
    return stacked


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
