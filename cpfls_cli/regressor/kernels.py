"""Compiled loops over samples: sums of a regressor's products without the regressor itself.

A sample fires at most two membership functions per input, so most columns of its three rows are zero; only the
others are computed, for a few samples at a time, so that the inner loops run over samples. Samples are taken in the
order of what they fire: those that fire the same rules have the same columns, and one product of matrices adds them up.
An inner loop writes one array: of several the compiler cannot tell that they are apart, and takes them one by one.
All loops stand in one module because the cache of compiled code follows its file, and behind one compiled function,
`_add_up`, because what a function calls is compiled again for each that calls it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.compiling import Function, compiled, part


def _inlined(function: Function) -> Function:
    """Copy into its one caller before anything is compiled: a part is compiled alone and then again in each caller."""
    return part(function, inline="always")


def _part_sum(function: Function) -> Function:
    """Compile, and let the processor take the terms of a sum in the order that suits its registers."""
    return part(function, fastmath={"reassoc", "contract"})


# Columns of `Table.blocks` and of `Table.partitions`.
_ROW, _COLUMN, _ROLL, _PITCH, _KIND, _FEATURES, _START, _OTHER_RULES = range(8)
_ANGLE, _FUNCTIONS, _FIRING_TOGETHER, _FIRST_INNER = range(4)


class Table(NamedTuple):
    """A model structure in numbers.

    Attributes
    ----------
    blocks : array of int, shape (blocks, 8)
        Row, column, partitions of roll and of pitch, kind of features (of roll, of pitch, of both), features, first
        column, rules of pitch.
    partitions : array of int, shape (partitions + 1, 4)
        Angle, membership functions, functions that fire at a time, first inner breakpoint. The last one stands for no
        partition: its one function always fires.
    active : int
        Columns that are not zero at a sample.
    parameters, breakpoints : int
        Columns and inner breakpoints in all.
    single : int
        Features of one angle beside the constant: 1, or twice the harmonic order.
    ranges : array, shape (2, 2)
        Minimum and maximum of the roll and pitch inputs.
    """

    blocks: IntArray
    partitions: IntArray
    active: int
    parameters: int
    breakpoints: int
    circular: bool
    data_range: bool
    harmonic: bool
    tensor: bool
    single: int
    ranges: Array


class Chunk(NamedTuple):
    """Consecutive samples.

    Attributes
    ----------
    attitude, rate, acceleration : array, shape (samples, 3)
    dense : array, shape (samples, 3, dense)
        Columns that no partition changes: the torque first, then those of the rigid body where it is free.
    inputs : array, shape (8, samples)
        See `cpfls_cli.regressor.table.mapped_inputs`; of the structure, so it is put in last.
    """

    attitude: Array
    rate: Array
    acceleration: Array
    dense: Array
    inputs: Array


_BATCH = 128
"""Samples worked on together: enough to spread the cost of a loop, few enough to stay in the fastest memory."""

# What is known of the samples of a batch stands in one array, a line for each quantity, the sample last: handing over
# one array costs less than many. They are samples that fire the same rules. The lines are, by their first one:
# antecedent and consequent of roll with their slopes, then of pitch;
_SEEN, _ANTECEDENT, _ANTECEDENT_SLOPE, _CONSEQUENT, _CONSEQUENT_SLOPE = 0, 0, 1, 2, 3
# attitude, rate and acceleration;
_ATTITUDE, _RATE, _ACCELERATION = 8, 11, 14
# by axis, how value, slope by roll and slope by pitch of one inertia function enter the torque;
_CARRIED = 17
# value, slope by roll and slope by pitch of each of the rules of one block that fire;
_FIRING = 26
# torque by axis of each of these rules, for each unit of its output, and torque of the slopes of one feature;
_ALONG, _BESIDE = 38, 50
# step of the output of a block at a breakpoint, see `_step`, and three lines to work in;
_STEP, _WORK = 51, 55
# by partition, degrees of the two functions that fire, their slopes by the angle, and the position between their peaks;
_DEGREE, _SLOPE, _POSITION, _OF_PARTITION = 58, 2, 4, 5
# from `_features_at` on, features of roll, of pitch and of both: value, slope by roll and slope by pitch of each.
_BOTH = 2


@part
def _features_at(table: Table, kind: int) -> int:
    """Find the first line of the features of a kind."""
    single = 1 + table.single
    return _DEGREE + _OF_PARTITION * len(table.partitions) + 3 * single * kind


@part
def _fours(count: int) -> int:
    return (count + 3) // 4 * 4


@part
def _new_batch(table: Table) -> Array:
    """Make room for a batch, with what is the same for all: features that are constant, functions that always fire."""
    single = 1 + table.single
    at = np.zeros((_features_at(table, _BOTH) + 3 * single * single, _BATCH))
    for index in range(len(table.partitions)):
        at[_DEGREE + _OF_PARTITION * index] = 1.0
    for kind in range(2):
        at[_features_at(table, kind)] = 1.0
    return at


@part
def _space(table: Table, dense: int) -> Array:
    """Make room for the rows of a batch."""
    return np.zeros(_fours(table.active + dense) * 3 * _BATCH)


@part
def _cells(table: Table, breakpoints: Array, seen: Array) -> IntArray:
    """Count out the cells that all breakpoints cut roll and pitch into, and find that of each sample."""
    cell = np.zeros(seen.shape[1], np.int64)
    for axis in range(2):
        cells, antecedent = 1, seen[4 * axis + _ANTECEDENT]
        for index in range(len(table.partitions)):
            if table.partitions[index, _ANGLE] == axis:
                cells += max(table.partitions[index, _FUNCTIONS] - 2, 0)
        cell *= cells
        for index in range(len(table.partitions)):
            if table.partitions[index, _ANGLE] == axis:
                for k in range(1, table.partitions[index, _FUNCTIONS] - 1):
                    at = breakpoints[index, k]
                    for n in range(len(cell)):
                        cell[n] += 1 if antecedent[n] >= at else 0
    return cell


@part
def _sorted(cell: IntArray) -> IntArray:
    """Put samples in the order of their cells, those of one cell in the order of time."""
    last = 0
    for n in range(len(cell)):
        last = max(last, cell[n])
    first = np.zeros(last + 2, np.int64)
    for n in range(len(cell)):
        first[cell[n] + 1] += 1
    for k in range(1, len(first)):
        first[k] += first[k - 1]
    order = np.empty(len(cell), np.int64)
    for n in range(len(cell)):
        order[first[cell[n]]] = n
        first[cell[n]] += 1
    return order


@part
def _z_function(u: float) -> tuple[float, float, float]:
    """Zadeh's z-function with its first and second derivative: the copy of `cpfls_cli.fuzzy.membership.z_function`."""
    first, rest = u < 0.5, 1.0 - u
    value = 1.0 - 2.0 * u * u if first else 2.0 * rest * rest
    return value, -4.0 * (u if first else rest), -4.0 if first else 4.0


@part
def _end_of_run(cell: IntArray, label: IntArray, order: IntArray, start: int) -> int:
    """Find where samples stop to fire the same rules under the same label, a batch after the start at the latest."""
    first, stop = order[start], start + 1
    while stop < min(start + _BATCH, len(order)) and cell[order[stop]] == cell[first]:
        if label[order[stop]] != label[first]:
            break
        stop += 1
    return stop


@part
def _take(chunk: Chunk, scale: Array, seen: Array, sample: IntArray, active: int, rows: Array, at: Array) -> None:
    """Take the samples of a batch out of a chunk, with their dense columns."""
    for n in range(len(sample)):
        i = sample[n]
        for k in range(8):
            at[_SEEN + k, n] = seen[k, i]
        for axis in range(3):
            at[_ATTITUDE + axis, n] = chunk.attitude[i, axis]
            at[_RATE + axis, n] = chunk.rate[i, axis]
            at[_ACCELERATION + axis, n] = chunk.acceleration[i, axis]
            for d in range(chunk.dense.shape[2]):
                rows[active + d, axis, n] = chunk.dense[i, axis, d] * scale[axis]


@part
def _find_features(table: Table, count: int, at: Array) -> None:
    """Find the consequent features of each angle, and their products."""
    single, order, joint = 1 + table.single, table.single // 2, _features_at(table, _BOTH)
    for axis in range(2):
        first, seen = _features_at(table, axis), _SEEN + 4 * axis
        for n in range(count):
            if not table.harmonic:
                at[first + 3, n], at[first + 4 + axis, n] = at[seen + _CONSEQUENT, n], at[seen + _CONSEQUENT_SLOPE, n]
                continue
            for k in range(1, order + 1):
                sine, cosine = np.sin(k * at[_ATTITUDE + axis, n]), np.cos(k * at[_ATTITUDE + axis, n])
                at[first + 3 * k, n], at[first + 3 * k + 1 + axis, n] = sine, k * cosine
                at[first + 3 * (order + k), n], at[first + 3 * (order + k) + 1 + axis, n] = cosine, -k * sine
    for i in range(single):
        for j in range(single if table.tensor or i == 0 else 1):
            f = i * single + j if table.tensor else (i if j == 0 else single - 1 + j)
            roll, pitch = _features_at(table, 0) + 3 * i, _features_at(table, 1) + 3 * j
            for n in range(count):
                at[joint + 3 * f, n] = at[roll, n] * at[pitch, n]
            for n in range(count):
                at[joint + 3 * f + 1, n] = at[roll + 1, n] * at[pitch, n]
            for n in range(count):
                at[joint + 3 * f + 2, n] = at[roll, n] * at[pitch + 2, n]


@part
def _fire(partitions: IntArray, index: int, breakpoints: Array, count: int, at: Array) -> int:
    """Find the two functions of a partition that fire; see `cpfls_cli.fuzzy.membership.memberships`.

    Give the interval between breakpoints.
    """
    seen, first, left = _SEEN + 4 * partitions[index, _ANGLE], _DEGREE + _OF_PARTITION * index, 0
    for k in range(1, partitions[index, _FUNCTIONS] - 1):
        left += 1 if at[seen + _ANTECEDENT, 0] >= breakpoints[index, k] else 0
    low, width = breakpoints[index, left], breakpoints[index, left + 1] - breakpoints[index, left]
    wide, inverse, position = width > 0.0, 1.0 / width if width > 0.0 else 1.0, first + _POSITION
    for n in range(count):
        at[position, n] = min(max(at[seen + _ANTECEDENT, n], 0.0) - low, width) * inverse if wide else 1.0
    for n in range(count):
        at[first, n] = _z_function(at[position, n])[0]
    for n in range(count):
        at[first + 1, n] = 1.0 - at[first, n]
    for n in range(count):
        at[first + _SLOPE, n] = _z_function(at[position, n])[1] * at[seen + _ANTECEDENT_SLOPE, n] * inverse
    for n in range(count):
        at[first + _SLOPE + 1, n] = -at[first + _SLOPE, n]
    return left


@part
def _find_firing(block: IntArray, partitions: IntArray, count: int, at: Array) -> int:
    """Find how strongly the rules of a block fire, and their slopes by roll and pitch; give their number."""
    rule, slots, others = 0, partitions[block[_ROLL], _FIRING_TOGETHER], partitions[block[_PITCH], _FIRING_TOGETHER]
    for i in range(slots):
        for j in range(others):
            roll = _DEGREE + _OF_PARTITION * block[_ROLL] + i
            pitch, first = _DEGREE + _OF_PARTITION * block[_PITCH] + j, _FIRING + 3 * rule
            for n in range(count):
                at[first, n] = at[roll, n] * at[pitch, n]
            for n in range(count):
                at[first + 1, n] = at[roll + _SLOPE, n] * at[pitch, n]
            for n in range(count):
                at[first + 2, n] = at[roll, n] * at[pitch + _SLOPE, n]
            rule += 1
    return rule


@part
def _carry(block: IntArray, scale: Array, count: int, at: Array) -> None:
    """Find how an inertia function enters the torque; method.md section 2."""
    row, column = block[_ROW], block[_COLUMN]
    share = 0.5 if row == column else 1.0
    for n in range(count):
        at[_WORK, n] = share * at[_RATE + row, n] * at[_RATE + column, n]
    for axis in range(3):
        from_axis, acts = column if axis == row else row, scale[axis] if axis in (row, column) else 0.0
        for n in range(count):
            at[_CARRIED + 3 * axis, n] = acts * at[_ACCELERATION + from_axis, n]
        for angle in range(2):
            energy = scale[axis] if axis == angle else 0.0
            for n in range(count):
                moved = at[_RATE + from_axis, n] * at[_RATE + angle, n]
                at[_CARRIED + 3 * axis + 1 + angle, n] = acts * moved - energy * at[_WORK, n]


@part
def _put(features: int, feature: int, slots: int, count: int, at: Array, rows: Array) -> None:
    """Write the columns of a block whose rules have fired, from the line of its first feature."""
    for rule in range(slots):
        fired = _FIRING + 3 * rule
        for axis in range(3):
            carried, along = _CARRIED + 3 * axis, _ALONG + 3 * rule + axis
            for n in range(count):
                slopes = at[carried + 1, n] * at[fired + 1, n] + at[carried + 2, n] * at[fired + 2, n]
                at[along, n] = at[carried, n] * at[fired, n] + slopes
    for f in range(features):
        value = feature + 3 * f
        for axis in range(3):
            carried = _CARRIED + 3 * axis
            for n in range(count):
                at[_BESIDE, n] = at[carried + 1, n] * at[value + 1, n] + at[carried + 2, n] * at[value + 2, n]
            for rule in range(slots):
                a, along, fired = rule * features + f, _ALONG + 3 * rule + axis, _FIRING + 3 * rule
                for n in range(count):
                    rows[a, axis, n] = at[along, n] * at[value, n] + at[fired, n] * at[_BESIDE, n]


@_inlined
def _fill(
    table: Table,
    breakpoints: Array,
    chunk: Chunk,
    scale: Array,
    seen: Array,
    sample: IntArray,
    space: Array,
    interval: IntArray,
    at: Array,
) -> Array:
    """Find the columns of the samples of a batch that are not zero, then the dense ones, and zeros up to fours.

    Give them with the three axes side by side, shape (columns, 3 * samples), and set the interval of each partition.
    """
    count, first, width = len(sample), 0, _fours(table.active + chunk.dense.shape[2])
    rows = space[: width * 3 * count].reshape(width, 3, count)
    rows[table.active + chunk.dense.shape[2] :] = 0.0
    _take(chunk, scale, seen, sample, table.active, rows, at)
    _find_features(table, count, at)
    for index in range(len(table.partitions)):
        if table.partitions[index, _FIRING_TOGETHER] == 2:
            interval[index] = _fire(table.partitions, index, breakpoints, count, at)
    for b in range(len(table.blocks)):
        block = table.blocks[b]
        _carry(block, scale, count, at)
        slots = _find_firing(block, table.partitions, count, at)
        _put(block[_FEATURES], _features_at(table, block[_KIND]), slots, count, at, rows[first:])
        first += slots * block[_FEATURES]
    return rows.reshape(width, 3 * count)


@part
def _rule(circular: bool, functions: int, interval: int, right: int) -> int:
    """Find the rule of one of the two functions of a partition that fire in an interval."""
    return 0 if circular and interval + 1 + right == functions else interval + right


@part
def _columns(table: Table, interval: IntArray, column: IntArray) -> None:
    """Find which columns those of a batch are that are not zero."""
    a, blocks, partitions, circular = 0, table.blocks, table.partitions, table.circular
    for b in range(len(blocks)):
        roll, pitch = blocks[b, _ROLL], blocks[b, _PITCH]
        for i in range(partitions[roll, _FIRING_TOGETHER]):
            for j in range(partitions[pitch, _FIRING_TOGETHER]):
                rule = _rule(circular, partitions[roll, _FUNCTIONS], interval[roll], i) * blocks[b, _OTHER_RULES]
                rule += _rule(circular, partitions[pitch, _FUNCTIONS], interval[pitch], j)
                for f in range(blocks[b, _FEATURES]):
                    column[a] = blocks[b, _START] + rule * blocks[b, _FEATURES] + f
                    a += 1


@_part_sum
def _multiply(left: Array, right: Array, count: int, upper: bool, out: Array) -> None:
    """Set ``out = left right^T`` over the first rows, four columns by two; of a symmetric product the upper triangle.

    The columns of `left` come in fours, those of `right` in twos.
    """
    for a in range(0, len(left), 4):
        for b in range(a if upper else 0, len(right), 2):
            s00 = s01 = s10 = s11 = s20 = s21 = s30 = s31 = 0.0
            for r in range(count):
                s00 += left[a, r] * right[b, r]
                s01 += left[a, r] * right[b + 1, r]
                s10 += left[a + 1, r] * right[b, r]
                s11 += left[a + 1, r] * right[b + 1, r]
                s20 += left[a + 2, r] * right[b, r]
                s21 += left[a + 2, r] * right[b + 1, r]
                s30 += left[a + 3, r] * right[b, r]
                s31 += left[a + 3, r] * right[b + 1, r]
            out[a, b], out[a, b + 1], out[a + 1, b], out[a + 1, b + 1] = s00, s01, s10, s11
            out[a + 2, b], out[a + 2, b + 1], out[a + 3, b], out[a + 3, b + 1] = s20, s21, s30, s31


@part
def _combine(rows: Array, column: IntArray, coefficients: Array, dense_weights: Array, count: int, out: Array) -> None:
    """Set the residual ``dense D - Q c`` of the first rows, four columns at a time."""
    weights = np.zeros(len(rows))
    for a in range(len(column)):
        weights[a] = -coefficients[column[a]]
    for d in range(len(dense_weights)):
        weights[len(column) + d] = dense_weights[d]
    out[:count] = 0.0
    for a in range(0, len(rows), 4):
        w0, w1, w2, w3 = weights[a], weights[a + 1], weights[a + 2], weights[a + 3]
        for r in range(count):
            half = w0 * rows[a, r] + w1 * rows[a + 1, r]
            out[r] += half + (w2 * rows[a + 2, r] + w3 * rows[a + 3, r])


@part
def _add_gram(rows: Array, column: IntArray, count: int, local: Array, gram: Array, moment: Array) -> None:
    """Add the products of the columns of a run with each other and with the dense ones."""
    active = len(column)
    _multiply(rows, rows, count, True, local)
    for a in range(active):
        for b in range(a, active):
            gram[column[a], column[b]] += local[a, b]
        for d in range(moment.shape[1]):
            moment[column[a], d] += local[a, active + d]


@part
def _add_errors(residual: Array, count: int, models: int, square: Array, largest: Array) -> None:
    """Add the squares of the residuals of a run, and find the largest of all."""
    for k in range(models):
        for r in range(count):
            square[k, 0] += residual[k, r] * residual[k, r]
            largest[k, 0] = max(largest[k, 0], abs(residual[k, r]))


@part
def _add_square(right: Array, places: IntArray, count: int, local: Array, square: Array) -> None:
    """Add the products of residuals or derivatives with each other by their places; a negative place is none."""
    _multiply(right, right, count, True, local)
    for a in range(len(places)):
        if places[a] >= 0:
            for b in range(a, len(places)):
                if places[b] >= 0:
                    square[places[a], places[b]] += local[a, b]


@part
def _add_cross(
    rows: Array,
    column: IntArray,
    right: Array,
    places: IntArray,
    count: int,
    local: Array,
    cross: Array,
    dense_cross: Array,
) -> None:
    """Add the products of all columns of a run with residuals or derivatives by their places."""
    _multiply(rows, right, count, False, local)
    for b in range(len(places)):
        if places[b] >= 0:
            for a in range(len(column)):
                cross[column[a], places[b]] += local[a, b]
            for d in range(len(dense_cross)):
                dense_cross[d, places[b]] += local[len(column) + d, b]


@part
def _step(
    table: Table, block: IntArray, input_index: int, coefficients: Array, interval: IntArray, count: int, at: Array
) -> None:
    """Step of a block's output at a breakpoint of one input: what fires left of it less what fires right of it.

    The step of value, slope by roll and slope by pitch; and that of the value where the other input fires by its slope.
    """
    index, other, features = block[_ROLL + input_index], block[_PITCH - input_index], block[_FEATURES]
    along, across = (block[_OTHER_RULES], 1) if input_index == 0 else (1, block[_OTHER_RULES])
    circular, functions = table.circular, table.partitions[index, _FUNCTIONS]
    left = _rule(circular, functions, interval[index], 0) * along
    right = _rule(circular, functions, interval[index], 1) * along
    at[_STEP : _STEP + 4, :count] = 0.0
    for o in range(table.partitions[other, _FIRING_TOGETHER]):
        fixed = _rule(circular, table.partitions[other, _FUNCTIONS], interval[other], o) * across
        at[_WORK : _WORK + 3, :count] = 0.0
        for f in range(features):
            difference = coefficients[block[_START] + (left + fixed) * features + f]
            difference -= coefficients[block[_START] + (right + fixed) * features + f]
            feature = _features_at(table, block[_KIND]) + 3 * f
            for k in range(3):
                for n in range(count):
                    at[_WORK + k, n] += difference * at[feature + k, n]
        degree = _DEGREE + _OF_PARTITION * other + o
        for k in range(3):
            for n in range(count):
                at[_STEP + k, n] += at[degree, n] * at[_WORK + k, n]
        for n in range(count):
            at[_STEP + 3, n] += at[degree + _SLOPE, n] * at[_WORK, n]


@part
def _move(table: Table, index: int, interval: int, breakpoints: Array, count: int, at: Array, moved: Array) -> None:
    """Differentiate the torque of an inertia function by the breakpoints around one of its inputs, of known step."""
    angle, functions = table.partitions[index, _ANGLE], table.partitions[index, _FUNCTIONS]
    own, other, position = _STEP + 1 + angle, _STEP + 2 - angle, _DEGREE + _OF_PARTITION * index + _POSITION
    slope, width = (
        _SEEN + 4 * angle + _ANTECEDENT_SLOPE,
        breakpoints[index, interval + 1] - breakpoints[index, interval],
    )
    per_width = 1.0 / width if width > 0.0 else 1.0
    for end in range(2):
        k, row, sign, own_end = interval + end, 2 * index + end, 1.0 - 2.0 * end, 1.0 - end
        moves = per_width if k >= 1 and k <= functions - 2 else 0.0
        # How the degree changes, the slope by this angle, and that by the other.
        for n in range(count):
            change = _z_function(at[position, n])[1] * (sign * at[position, n] - own_end) * moves
            at[_WORK, n] = change if at[slope, n] != 0.0 else 0.0
        for n in range(count):
            _, falling, bending = _z_function(at[position, n])
            change = (bending * (sign * at[position, n] - own_end) + sign * falling) * moves * per_width
            at[_WORK + 1, n] = change * at[slope, n] * at[_STEP, n] + at[_WORK, n] * at[own, n]
        for n in range(count):
            at[_WORK + 2, n] = at[_WORK, n] * (at[other, n] + at[_STEP + 3, n])
        for n in range(count):
            at[_WORK, n] *= at[_STEP, n]
        for axis in range(3):
            by_value, by_own, by_other = (
                _CARRIED + 3 * axis,
                _CARRIED + 3 * axis + 1 + angle,
                _CARRIED + 3 * axis + 2 - angle,
            )
            for n in range(count):
                by_slopes = at[by_own, n] * at[_WORK + 1, n] + at[by_other, n] * at[_WORK + 2, n]
                moved[row, axis, n] = at[by_value, n] * at[_WORK, n] + by_slopes


@_inlined
def _move_all(
    table: Table,
    breakpoints: Array,
    coefficients: Array,
    scale: Array,
    interval: IntArray,
    count: int,
    moved: Array,
    at: Array,
) -> None:
    """Differentiate the torque of a batch by the breakpoints at both ends of the interval of each input."""
    moved[:] = 0.0
    for b in range(len(table.blocks)):
        block = table.blocks[b]
        _carry(block, scale, count, at)
        for input_index in range(2):
            index = block[_ROLL + input_index]
            if table.partitions[index, _FUNCTIONS] > 2:
                _step(table, block, input_index, coefficients, interval, count, at)
                _move(table, index, interval[index], breakpoints, count, at, moved)


@part
def _inner(table: Table, interval: IntArray, places: IntArray) -> None:
    """Find which inner breakpoints those at both ends of the intervals of a batch are; negative for none."""
    for index in range(len(table.partitions)):
        for end in range(2):
            k = interval[index] + end
            inner = k >= 1 and k <= table.partitions[index, _FUNCTIONS] - 2
            places[2 * index + end] = table.partitions[index, _FIRST_INNER] + k - 1 if inner else -1


_GRAM, _ERRORS, _COMBINED, _MOVED = range(4)


@compiled
def _add_up(
    what: int,
    table: Table,
    breakpoints: Array,
    chunk: Chunk,
    scale: Array,
    label: IntArray,
    models: tuple[Array, Array],
    sums: tuple[Array, Array, Array],
) -> None:
    """Go through a chunk, run by run of samples that fire the same rules, and add up what is asked for.

    Parameters
    ----------
    models : tuple of array
        Coefficients, shape (models, parameters), and dense weights, shape (models, dense).
    sums : tuple of array
        See what calls this. Shapes (sums, n, n), (sums, parameters, m) and (dense, m), changed in place.
    """
    coefficients, dense_weights = models
    square, cross, dense_cross = sums
    active, dense, moves = table.active, chunk.dense.shape[2], 2 * len(table.partitions)
    at, space, seen = _new_batch(table), _space(table, dense), chunk.inputs
    cell, column = _cells(table, breakpoints, seen), np.zeros(active, np.int64)
    interval = np.zeros(len(table.partitions), np.int64)
    order, start = _sorted(cell), 0
    # Lines beside the columns: the derivatives and the residual, or the residual of each model.
    beside = moves + 1 if what == _MOVED else len(coefficients)
    crossed, high, width = 1 if what == _COMBINED else beside, _fours(active + dense), _fours(beside)
    places, right_space = np.zeros(beside, np.int64), np.zeros(width * 3 * _BATCH)
    local, local_square = np.zeros((high, high if what == _GRAM else width)), np.zeros((width, width))
    for k in range(beside):
        places[k] = table.breakpoints if what == _MOVED else k
    while start < len(order):
        stop = _end_of_run(cell, label, order, start)
        count, own = 3 * (stop - start), label[order[start]]
        rows = _fill(table, breakpoints, chunk, scale, seen, order[start:stop], space, interval, at)
        _columns(table, interval, column)
        if what == _GRAM:
            _add_gram(rows, column, count, local, square[own], cross[own])
        else:
            right = right_space[: width * count].reshape(width, count)
            if what == _MOVED:
                moved = right.reshape(width, 3, stop - start)
                _move_all(table, breakpoints, coefficients[0], scale, interval, stop - start, moved, at)
                _inner(table, interval, places)
            for k in range(len(coefficients)):
                _combine(rows, column, coefficients[k], dense_weights[k], count, right[moves if what == _MOVED else k])
            if what == _ERRORS:
                _add_errors(right, count, len(coefficients), square[own], cross[own])
            else:
                _add_square(right, places, count, local_square, square[own])
                some = right[: crossed + crossed % 2]
                _add_cross(rows, column, some, places[:crossed], count, local, cross[own], dense_cross)
        start = stop


_NOTHING = np.zeros((0, 0))


def add_gram(
    table: Table, breakpoints: Array, chunk: Chunk, scale: Array, label: IntArray, gram: Array, moment: Array
) -> None:
    """Add ``Q^T Q`` and ``Q^T dense`` of the samples of a chunk to sums by label.

    Parameters
    ----------
    breakpoints : array, shape (partitions, most functions)
    scale : array, shape (3,)
        Factor of the rows about each axis.
    label : array of int, shape (samples,)
        Sum that a sample adds to.
    gram : array, shape (sums, parameters, parameters)
        Changed in place. An entry off the diagonal is meant as the sum of it and its mirror image.
    moment : array, shape (sums, parameters, dense)
        Changed in place.
    """
    _add_up(_GRAM, table, breakpoints, chunk, scale, label, (_NOTHING, _NOTHING), (gram, moment, _NOTHING))


def add_errors(
    table: Table,
    breakpoints: Array,
    chunk: Chunk,
    scale: Array,
    label: IntArray,
    coefficients: Array,
    dense_weights: Array,
    square: Array,
    largest: Array,
) -> None:
    """Add the squared residuals ``dense D - Q c`` of a chunk by label, and find the largest of all.

    Parameters
    ----------
    table, breakpoints, chunk, scale
        See `add_gram`.
    label : array of int, shape (samples,)
        Sum that a sample adds to.
    coefficients : array, shape (models, parameters)
        c of several models.
    dense_weights : array, shape (models, dense)
        D.
    square : array, shape (sums, models)
        Sums of squares over samples and axes, changed in place.
    largest : array, shape (sums, models)
        Largest absolute residuals, changed in place.
    """
    models, sums = (coefficients, dense_weights), (square[:, :, None], largest[:, :, None], _NOTHING)
    _add_up(_ERRORS, table, breakpoints, chunk, scale, label, models, sums)


def add_combined(
    table: Table,
    breakpoints: Array,
    chunk: Chunk,
    scale: Array,
    coefficients: Array,
    dense_weights: Array,
    square: Array,
    back: Array,
    dense_back: Array,
) -> None:
    """Add the products of residuals ``Y = dense D - Q c`` of a chunk for several c.

    Parameters
    ----------
    table, breakpoints, chunk, scale
        See `add_gram`.
    coefficients : array, shape (models, parameters)
    dense_weights : array, shape (models, dense)
    square : array, shape (models, models)
        ``Y^T Y``, upper triangle, changed in place.
    back : array, shape (parameters, 1)
        Q^T times the first residual, changed in place.
    dense_back : array, shape (dense, 1)
        The dense columns times the first residual, changed in place.
    """
    label, models = np.zeros(len(chunk.attitude), np.int64), (coefficients, dense_weights)
    _add_up(_COMBINED, table, breakpoints, chunk, scale, label, models, (square[None], back[None], dense_back))


def add_moved(
    table: Table,
    breakpoints: Array,
    chunk: Chunk,
    scale: Array,
    coefficients: Array,
    dense_weights: Array,
    cross: Array,
    dense_cross: Array,
    square: Array,
) -> None:
    """Add the products of the residual and of its derivatives by the inner breakpoints at fixed coefficients.

    The residual is ``r = dense D - Q c`` and its derivatives are ``-M``; all products are with ``[M, r]``.

    Parameters
    ----------
    table, breakpoints, chunk, scale
        See `add_gram`.
    coefficients : array, shape (parameters,)
        c.
    dense_weights : array, shape (dense,)
        D.
    cross : array, shape (parameters, inner breakpoints + 1)
        ``Q^T [M, r]``, changed in place.
    dense_cross : array, shape (dense, inner breakpoints + 1)
        ``dense^T [M, r]``, changed in place.
    square : array, shape (inner breakpoints + 1, inner breakpoints + 1)
        ``[M, r]^T [M, r]``, upper triangle, changed in place; entries mean the sum with their mirror images.
    """
    label, models = np.zeros(len(chunk.attitude), np.int64), (coefficients[None], dense_weights[None])
    _add_up(_MOVED, table, breakpoints, chunk, scale, label, models, (square[None], cross[None], dense_cross))
