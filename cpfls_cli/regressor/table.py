"""A model structure as the numbers that compiled loops follow."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.fuzzy.basis import InputRange, map_input
from cpfls_cli.regressor import kernels
from cpfls_cli.regressor.kernels import ONE, STEP, Program, Table
from cpfls_cli.regressor.regressor import Breakpoints
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
    """Sums of products of lines, without what is zero or stands in a line already."""

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
