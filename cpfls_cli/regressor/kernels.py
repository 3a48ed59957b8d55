"""Compiled loops over samples: sums of a regressor's products without the regressor itself.

A sample fires at most two membership functions per input, so most columns of its three rows are zero; only the
others are computed, for a few samples at a time, so that the inner loops run over samples. All loops stand in one
module because the cache of compiled code follows its file.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, cast

import numba
import numpy as np

from cpfls_cli.arrays import Array, IntArray

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function, **options: Any) -> Function:
    """Compile at the first call on a machine; other threads run meanwhile, and dividing by zero gives infinity.

    Parameters
    ----------
    function : callable
    **options
        Of `numba.njit`.

    Returns
    -------
    callable
        Compiled anew in each process where no folder can be written that would keep it.
    """
    options |= {"nogil": True, "error_model": "numpy"}
    try:
        return cast(Function, numba.njit(cache=True, **options)(function))
    except RuntimeError:
        return cast(Function, numba.njit(**options)(function))


def _compiled(function: Function) -> Function:
    return compiled(function)


def _compiled_sum(function: Function) -> Function:
    """Compile, and let the processor take the terms of a sum in the order that suits its registers."""
    return compiled(function, fastmath={"reassoc", "contract"})


# Columns of `Table.blocks` and of `Table.partitions`.
_ROW, _COLUMN, _INPUTS, _FIRST, _SECOND, _FEATURES, _START, _OTHER_RULES = range(8)
_ANGLE, _FUNCTIONS, _FIRING, _FIRST_INNER = range(4)


class Table(NamedTuple):
    """A model structure in numbers.

    Attributes
    ----------
    blocks : array of int, shape (blocks, 8)
        Row, column, number of inputs, first and second partition, features, first column, rules of the second input.
    partitions : array of int, shape (partitions, 4)
        Angle, membership functions, functions that fire at a time, first inner breakpoint.
    active : int
        Columns that are not zero at a sample, rounded up to an even number.
    parameters, breakpoints : int
        Columns and inner breakpoints in all.
    circular, data_range, harmonic, tensor : bool
    single : int
        Features of one angle beside the constant: 1, or twice the harmonic order.
    ranges : array, shape (2, 2)
        Minimum and width of the roll and pitch inputs.
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
    """

    attitude: Array
    rate: Array
    acceleration: Array
    dense: Array


_BATCH = 64
"""Samples worked on together: enough to spread the cost of a loop, few enough to stay in the fastest memory."""


MOST_FUNCTIONS = 15
"""Membership functions of a partition at most, so that its intervals are digits of a pattern."""


class _Batch(NamedTuple):
    """What the samples of a batch fire; the sample is the last axis.

    Attributes
    ----------
    antecedent, antecedent_slope : shape (2, batch)
        Input of the membership functions by angle, and its slope.
    rule, degree, degree_slope : shape (partitions, 2, batch)
        Of the functions that fire along each input; the slope is by the angle.
    interval, position, width, input_slope : shape (partitions, batch)
        Where an input lies between breakpoints; its slope by the angle is zero outside the partition.
    pattern : shape (batch,)
        Equal for samples that fire the same rules.
    feature, feature_slope : shape (2, 1 + single, batch)
        Consequent features by angle.
    joint : shape (3, features, batch)
        Of one rule of roll and pitch: value, slope by roll, slope by pitch.
    carried : shape (blocks, 3, 3, batch)
        By axis: how value, slope by roll and slope by pitch of an inertia function enter the torque.
    column : shape (active, batch)
    rows : shape (active, 3 * batch)
        Columns that are not zero; the three axes of a sample stand side by side.
    output : shape (4, 3, batch)
        Of the rules of one block that fire: value, slope by roll, slope by pitch.
    total : shape (3, batch)
        Of one block: value, slope by roll, slope by pitch.
    step : shape (4, batch)
        Of the output of a block at a breakpoint; see `_step`.
    moved_column : shape (2 * partitions, batch)
        Inner breakpoints at both ends of the interval of each input; negative for none.
    moved : shape (2 * partitions + 1 or 2, 3 * batch)
        Derivatives of the torque by them; after them the residual.
    """

    antecedent: Array
    antecedent_slope: Array
    rule: IntArray
    degree: Array
    degree_slope: Array
    interval: IntArray
    position: Array
    width: Array
    input_slope: Array
    pattern: IntArray
    feature: Array
    feature_slope: Array
    joint: Array
    carried: Array
    column: IntArray
    rows: Array
    output: Array
    total: Array
    step: Array
    moved_column: IntArray
    moved: Array


@_compiled
def _even(count: int) -> int:
    return count + count % 2


@_compiled
def _new_batch(table: Table) -> _Batch:
    partitions, single = len(table.partitions), 1 + table.single
    return _Batch(
        antecedent=np.zeros((2, _BATCH)),
        antecedent_slope=np.zeros((2, _BATCH)),
        rule=np.zeros((partitions, 2, _BATCH), np.int64),
        degree=np.ones((partitions, 2, _BATCH)),
        degree_slope=np.zeros((partitions, 2, _BATCH)),
        interval=np.zeros((partitions, _BATCH), np.int64),
        position=np.zeros((partitions, _BATCH)),
        width=np.ones((partitions, _BATCH)),
        input_slope=np.zeros((partitions, _BATCH)),
        pattern=np.zeros(_BATCH, np.int64),
        feature=np.ones((2, single, _BATCH)),
        feature_slope=np.zeros((2, single, _BATCH)),
        joint=np.zeros((3, single * single, _BATCH)),
        carried=np.zeros((len(table.blocks), 3, 3, _BATCH)),
        column=np.full((table.active, _BATCH), -1),
        rows=np.zeros((table.active, 3 * _BATCH)),
        output=np.zeros((4, 3, _BATCH)),
        total=np.zeros((3, _BATCH)),
        step=np.zeros((4, _BATCH)),
        moved_column=np.full((2 * partitions, _BATCH), -1),
        moved=np.zeros((_even(2 * partitions + 1), 3 * _BATCH)),
    )


@_compiled
def _wrap(angle: float) -> float:
    turns: float = np.floor((angle + np.pi) / (2.0 * np.pi))
    return angle - 2.0 * np.pi * turns


@_compiled
def _seesaw(angle: float) -> tuple[float, float]:
    wrapped = _wrap(angle)
    if abs(wrapped) > 0.5 * np.pi:
        return (np.copysign(np.pi, wrapped) - wrapped) * (2.0 / np.pi), -2.0 / np.pi
    return wrapped * (2.0 / np.pi), 2.0 / np.pi


@_compiled
def _map_input(table: Table, axis: int, angle: float) -> tuple[float, float, float, float]:
    """Antecedent and consequent of an angle with their slopes; see `cpfls_cli.fuzzy.inputs.map_input`."""
    if table.data_range:
        value, slope = _seesaw(angle)
        if not table.circular:
            value, slope = _wrap(angle), 1.0
        scaled, scaled_slope = (value - table.ranges[axis, 0]) / table.ranges[axis, 1], slope / table.ranges[axis, 1]
        return scaled, scaled_slope, scaled, scaled_slope
    if table.circular:
        value, slope = _seesaw(angle)
        turns = angle / (2.0 * np.pi)
        return turns - np.floor(turns), 0.5 / np.pi, value, slope
    turns = _wrap(angle) / (2.0 * np.pi) + 0.5
    return turns, 0.5 / np.pi, turns, 0.5 / np.pi


@_compiled
def _see(table: Table, axis: int, attitude: Array, at: _Batch) -> None:
    """Map an angle of all samples to antecedent and consequent features."""
    order, feature, feature_slope = table.single // 2, at.feature[axis], at.feature_slope[axis]
    antecedent, slope = at.antecedent[axis], at.antecedent_slope[axis]
    for n in range(len(attitude)):
        angle = attitude[n, axis]
        antecedent[n], slope[n], consequent, consequent_slope = _map_input(table, axis, angle)
        if not table.harmonic:
            feature[1, n], feature_slope[1, n] = consequent, consequent_slope
            continue
        for k in range(1, order + 1):
            sine, cosine = np.sin(k * angle), np.cos(k * angle)
            feature[k, n], feature_slope[k, n] = sine, k * cosine
            feature[order + k, n], feature_slope[order + k, n] = cosine, -k * sine


@_compiled
def _locate(functions: int, breakpoints: Array, antecedent: Array, interval: IntArray, count: int) -> None:
    """Count the inner breakpoints left of each input; written so that it needs no branch."""
    for n in range(count):
        interval[n] = 0
    for k in range(1, functions - 1):
        for n in range(count):
            interval[n] += 1 if antecedent[n] >= breakpoints[k] else 0


@_compiled
def _z_function(u: float) -> tuple[float, float, float]:
    """Zadeh's z-function with its first and second derivative: the copy of `cpfls_cli.fuzzy.membership.z_function`."""
    first, rest = u < 0.5, 1.0 - u
    value = 1.0 - 2.0 * u * u if first else 2.0 * rest * rest
    return value, -4.0 * (u if first else rest), -4.0 if first else 4.0


@_compiled
def _fire(table: Table, index: int, breakpoints: Array, count: int, at: _Batch) -> None:
    """Find the two functions of a partition that fire; see `cpfls_cli.fuzzy.membership.memberships`."""
    axis, functions = table.partitions[index, _ANGLE], table.partitions[index, _FUNCTIONS]
    antecedent, antecedent_slope, interval = at.antecedent[axis], at.antecedent_slope[axis], at.interval[index]
    position, width, input_slope, pattern = at.position[index], at.width[index], at.input_slope[index], at.pattern
    left, right, left_slope, right_slope = (
        at.degree[index, 0],
        at.degree[index, 1],
        at.degree_slope[index, 0],
        at.degree_slope[index, 1],
    )
    rule, next_rule = at.rule[index, 0], at.rule[index, 1]
    _locate(functions, breakpoints, antecedent, interval, count)
    for n in range(count):
        start, end, x = breakpoints[interval[n]], breakpoints[interval[n] + 1], antecedent[n]
        wide = end > start
        inverse = 1.0 / (end - start if wide else 1.0)
        u = min(max(x, 0.0) - start, end - start) * inverse if wide else 1.0
        inside = antecedent_slope[n] if x >= 0.0 and x <= 1.0 else 0.0
        falling, falling_slope, _ = _z_function(u)
        slope = falling_slope * inside * inverse
        position[n], width[n], input_slope[n] = u, (end - start if wide else 1.0), inside
        left[n], right[n], left_slope[n], right_slope[n] = falling, 1.0 - falling, slope, -slope
    for n in range(count):
        last = table.circular and interval[n] + 2 == functions
        rule[n], next_rule[n] = interval[n], 0 if last else interval[n] + 1
        pattern[n] = pattern[n] * MOST_FUNCTIONS + interval[n]


@_compiled
def _fire_all(table: Table, breakpoints: Array, attitude: Array, at: _Batch) -> None:
    """Fire all partitions at the samples of a batch; one function alone always fires, and stays at 1."""
    at.pattern[:] = 0
    for axis in range(2):
        _see(table, axis, attitude, at)
    for index in range(len(table.partitions)):
        if table.partitions[index, _FIRING] == 2:
            _fire(table, index, breakpoints[index], len(attitude), at)


@_compiled
def _join(table: Table, count: int, at: _Batch) -> None:
    """Combine the features of roll and pitch."""
    single = 1 + table.single
    for i in range(single):
        one, one_slope = at.feature[0, i], at.feature_slope[0, i]
        for j in range(single):
            if not table.tensor and i > 0 and j > 0:
                continue
            other, other_slope = at.feature[1, j], at.feature_slope[1, j]
            f = i * single + j if table.tensor else (i if j == 0 else single - 1 + j)
            value, by_roll, by_pitch = at.joint[0, f], at.joint[1, f], at.joint[2, f]
            for n in range(count):
                value[n] = one[n] * other[n]
                by_roll[n] = one_slope[n] * other[n]
                by_pitch[n] = one[n] * other_slope[n]


@_compiled
def _carry(block: IntArray, rate: Array, acceleration: Array, scale: Array, carried: Array) -> None:
    """Find how an inertia function enters the torque; method.md section 2."""
    row, column = block[_ROW], block[_COLUMN]
    share = 0.5 if row == column else 1.0
    for axis in range(3):
        from_axis = column if axis == row else row
        acts = 1.0 if axis in (row, column) else 0.0
        by_value, by_roll, by_pitch = carried[axis, 0], carried[axis, 1], carried[axis, 2]
        for n in range(len(rate)):
            energy = share * rate[n, row] * rate[n, column]
            moved = acts * rate[n, from_axis]
            by_value[n] = acts * acceleration[n, from_axis] * scale[axis]
            by_roll[n] = (moved * rate[n, 0] - (energy if axis == 0 else 0.0)) * scale[axis]
            by_pitch[n] = (moved * rate[n, 1] - (energy if axis == 1 else 0.0)) * scale[axis]


@_compiled
def _put_one(block: IntArray, carried: Array, angle: int, i: int, f: int, a: int, count: int, at: _Batch) -> None:
    """Write one column of an inertia function of one angle."""
    index, row, column = block[_FIRST], at.rows[a], at.column[a]
    degree, slope, rule = at.degree[index, i], at.degree_slope[index, i], at.rule[index, i]
    feature, feature_slope = at.feature[angle, f], at.feature_slope[angle, f]
    for n in range(count):
        column[n] = block[_START] + rule[n] * block[_FEATURES] + f
        value, gradient = degree[n] * feature[n], slope[n] * feature[n] + degree[n] * feature_slope[n]
        for axis in range(3):
            row[3 * n + axis] = carried[axis, 0, n] * value + carried[axis, 1 + angle, n] * gradient


@_compiled
def _put_two(block: IntArray, carried: Array, i: int, j: int, f: int, a: int, count: int, at: _Batch) -> None:
    """Write one column of an inertia function of roll and pitch."""
    first, second, row, column = block[_FIRST], block[_SECOND], at.rows[a], at.column[a]
    mu, mu_slope, rule = at.degree[first, i], at.degree_slope[first, i], at.rule[first, i]
    nu, nu_slope, other_rule = at.degree[second, j], at.degree_slope[second, j], at.rule[second, j]
    value, by_roll, by_pitch = at.joint[0, f], at.joint[1, f], at.joint[2, f]
    for n in range(count):
        column[n] = block[_START] + (rule[n] * block[_OTHER_RULES] + other_rule[n]) * block[_FEATURES] + f
        firing = mu[n] * nu[n]
        roll = mu_slope[n] * nu[n] * value[n] + firing * by_roll[n]
        pitch = mu[n] * nu_slope[n] * value[n] + firing * by_pitch[n]
        for axis in range(3):
            carry = carried[axis]
            row[3 * n + axis] = carry[0, n] * firing * value[n] + carry[1, n] * roll + carry[2, n] * pitch


@_compiled
def _put_constant(block: IntArray, carried: Array, a: int, count: int, at: _Batch) -> None:
    at.column[a, :count] = block[_START]
    for n in range(count):
        for axis in range(3):
            at.rows[a, 3 * n + axis] = carried[axis, 0, n]


@_compiled
def _prepare(table: Table, breakpoints: Array, chunk: Chunk, start: int, stop: int, scale: Array, at: _Batch) -> None:
    """Evaluate all of the samples of a batch that does not need the columns."""
    _fire_all(table, breakpoints, chunk.attitude[start:stop], at)
    _join(table, stop - start, at)
    for b in range(len(table.blocks)):
        _carry(table.blocks[b], chunk.rate[start:stop], chunk.acceleration[start:stop], scale, at.carried[b])


@_compiled
def _fill(table: Table, count: int, at: _Batch) -> None:
    """Find the columns of the samples of a batch that are not zero, and their rows in them."""
    a = 0
    for b in range(len(table.blocks)):
        block, carried = table.blocks[b], at.carried[b]
        if block[_INPUTS] == 0:
            _put_constant(block, carried, a, count, at)
            a += 1
            continue
        for i in range(table.partitions[block[_FIRST], _FIRING]):
            for j in range(table.partitions[block[_SECOND], _FIRING] if block[_INPUTS] == 2 else 1):
                for f in range(block[_FEATURES]):
                    if block[_INPUTS] == 2:
                        _put_two(block, carried, i, j, f, a, count, at)
                    else:
                        _put_one(block, carried, table.partitions[block[_FIRST], _ANGLE], i, f, a, count, at)
                    a += 1


@_compiled
def _end_of_run(pattern: IntArray, label: IntArray, first: int) -> int:
    """Find where samples stop to fire the same rules under the same label."""
    for n in range(first + 1, len(label)):
        if label[n] != label[first] or pattern[n] != pattern[first]:
            return n
    return len(label)


@_compiled_sum
def _multiply(left: Array, right: Array, start: int, stop: int, upper: bool, out: Array) -> None:
    """Set ``out = left right^T`` over a range of rows, two by two, as far as columns come in pairs.

    Of a symmetric product the upper triangle will do.
    """
    for a in range(0, len(left) - 1, 2):
        x0, x1 = left[a, start:stop], left[a + 1, start:stop]
        for b in range(a if upper else 0, len(right) - 1, 2):
            y0, y1 = right[b, start:stop], right[b + 1, start:stop]
            s00 = s01 = s10 = s11 = 0.0
            for r in range(len(x0)):
                s00 += x0[r] * y0[r]
                s01 += x0[r] * y1[r]
                s10 += x1[r] * y0[r]
                s11 += x1[r] * y1[r]
            out[a, b], out[a, b + 1], out[a + 1, b], out[a + 1, b + 1] = s00, s01, s10, s11


@_compiled
def _add(rows: IntArray, columns: IntArray, part: Array, upper: bool, total: Array) -> None:
    """Add products to the sums over all by the places of their columns; a negative place is none."""
    for a in range(len(rows)):
        if rows[a] >= 0:
            into, values = total[rows[a]], part[a]
            for b in range(a if upper else 0, len(columns)):
                if columns[b] >= 0:
                    into[columns[b]] += values[b]


@_compiled
def _take_dense(dense: Array, scale: Array, out: Array) -> None:
    for n in range(len(dense)):
        for axis in range(3):
            for d in range(dense.shape[2]):
                out[d, 3 * n + axis] = dense[n, axis, d] * scale[axis]


@_compiled
def _places(count: int) -> IntArray:
    """Places of columns that are padded to an even number."""
    places = np.full(_even(count), -1)
    places[:count] = np.arange(count)
    return places


@_compiled
def add_gram(
    table: Table, breakpoints: Array, chunk: Chunk, scale: Array, label: IntArray, gram: Array, moment: Array
) -> None:
    """Add ``Q^T Q`` and ``Q^T dense`` of the samples of a chunk to sums by label.

    Parameters
    ----------
    table : Table
    breakpoints : array, shape (partitions, most functions)
    chunk : Chunk
    scale : array, shape (3,)
        Factor of the rows about each axis.
    label : array of int, shape (samples,)
        Sum that a sample adds to.
    gram : array, shape (sums, parameters, parameters)
        Changed in place. An entry off the diagonal is meant as the sum of it and its mirror image.
    moment : array, shape (sums, parameters, dense)
        Changed in place.
    """
    at, active, places = _new_batch(table), table.active, _places(chunk.dense.shape[2])
    dense = np.zeros((len(places), 3 * _BATCH))
    square, cross = np.zeros((active, active)), np.zeros((active, len(places)))
    for start in range(0, len(label), _BATCH):
        stop = min(start + _BATCH, len(label))
        _prepare(table, breakpoints, chunk, start, stop, scale, at)
        _fill(table, stop - start, at)
        _take_dense(chunk.dense[start:stop], scale, dense)
        first = 0
        while first < stop - start:
            last = _end_of_run(at.pattern, label[start:stop], first)
            _multiply(at.rows, at.rows, 3 * first, 3 * last, True, square)
            _multiply(at.rows, dense, 3 * first, 3 * last, False, cross)
            column, sums = at.column[:, first], label[start + first]
            _add(column, column, square, True, gram[sums])
            _add(column, places, cross, False, moment[sums])
            first = last


@_compiled
def _slots(table: Table, block: IntArray) -> int:
    """Rules of a block that fire at a time."""
    slots = table.partitions[block[_FIRST], _FIRING] if block[_INPUTS] > 0 else 1
    return slots * table.partitions[block[_SECOND], _FIRING] if block[_INPUTS] == 2 else slots


@_compiled
def _output_one(block: IntArray, angle: int, slots: int, coefficients: Array, count: int, at: _Batch) -> None:
    """Find the outputs of the rules of one input that fire."""
    for i in range(slots):
        rule, value, slope = at.rule[block[_FIRST], i], at.output[i, 0], at.output[i, 1 + angle]
        value[:count], slope[:count] = 0.0, 0.0
        at.output[i, 2 - angle, :count] = 0.0
        for f in range(block[_FEATURES]):
            feature, feature_slope = at.feature[angle, f], at.feature_slope[angle, f]
            for n in range(count):
                coefficient = coefficients[block[_START] + rule[n] * block[_FEATURES] + f]
                value[n] += coefficient * feature[n]
                slope[n] += coefficient * feature_slope[n]


@_compiled
def _output_two(block: IntArray, i: int, j: int, coefficients: Array, count: int, at: _Batch, out: Array) -> None:
    """Find the output of one rule of roll and pitch that fires."""
    rule, other_rule = at.rule[block[_FIRST], i], at.rule[block[_SECOND], j]
    value, by_roll, by_pitch = out[0], out[1], out[2]
    out[:, :count] = 0.0
    for f in range(block[_FEATURES]):
        joint, joint_roll, joint_pitch = at.joint[0, f], at.joint[1, f], at.joint[2, f]
        for n in range(count):
            coefficient = coefficients[
                block[_START] + (rule[n] * block[_OTHER_RULES] + other_rule[n]) * block[_FEATURES] + f
            ]
            value[n] += coefficient * joint[n]
            by_roll[n] += coefficient * joint_roll[n]
            by_pitch[n] += coefficient * joint_pitch[n]


@_compiled
def _outputs(table: Table, block: IntArray, coefficients: Array, count: int, at: _Batch) -> None:
    """Find the outputs of all rules of a block that fire: value, slope by roll, slope by pitch."""
    if block[_INPUTS] == 0:
        at.output[0, 0, :count] = coefficients[block[_START]]
    elif block[_INPUTS] == 1:
        _output_one(block, table.partitions[block[_FIRST], _ANGLE], _slots(table, block), coefficients, count, at)
    else:
        others = table.partitions[block[_SECOND], _FIRING]
        for i in range(table.partitions[block[_FIRST], _FIRING]):
            for j in range(others):
                _output_two(block, i, j, coefficients, count, at, at.output[i * others + j])


@_compiled
def _sum_one(block: IntArray, angle: int, slots: int, count: int, at: _Batch) -> None:
    """Add up the rules of one input: value, slope by roll, slope by pitch."""
    value, gradient = at.total[0], at.total[1 + angle]
    for i in range(slots):
        degree, degree_slope = at.degree[block[_FIRST], i], at.degree_slope[block[_FIRST], i]
        output, slope = at.output[i, 0], at.output[i, 1 + angle]
        for n in range(count):
            value[n] += degree[n] * output[n]
            gradient[n] += degree_slope[n] * output[n] + degree[n] * slope[n]


@_compiled
def _sum_two(block: IntArray, i: int, j: int, output: Array, count: int, at: _Batch) -> None:
    """Add one rule of roll and pitch: value, slope by roll, slope by pitch."""
    mu, mu_slope = at.degree[block[_FIRST], i], at.degree_slope[block[_FIRST], i]
    nu, nu_slope = at.degree[block[_SECOND], j], at.degree_slope[block[_SECOND], j]
    value, by_roll, by_pitch = at.total[0], at.total[1], at.total[2]
    output_value, output_roll, output_pitch = output[0], output[1], output[2]
    for n in range(count):
        firing = mu[n] * nu[n]
        value[n] += firing * output_value[n]
        by_roll[n] += mu_slope[n] * nu[n] * output_value[n] + firing * output_roll[n]
        by_pitch[n] += mu[n] * nu_slope[n] * output_value[n] + firing * output_pitch[n]


@_compiled
def _subtract(table: Table, block: IntArray, carried: Array, count: int, at: _Batch, residual: Array) -> None:
    """Subtract the torque of a block, whose rules have given their outputs, from a residual."""
    at.total[:, :count] = 0.0
    if block[_INPUTS] == 0:
        at.total[0, :count] = at.output[0, 0, :count]
    elif block[_INPUTS] == 1:
        _sum_one(block, table.partitions[block[_FIRST], _ANGLE], _slots(table, block), count, at)
    else:
        others = table.partitions[block[_SECOND], _FIRING]
        for i in range(table.partitions[block[_FIRST], _FIRING]):
            for j in range(others):
                _sum_two(block, i, j, at.output[i * others + j], count, at)
    value, roll, pitch = at.total[0], at.total[1], at.total[2]
    for axis in range(3):
        by_value, by_roll, by_pitch = carried[axis, 0], carried[axis, 1], carried[axis, 2]
        for n in range(count):
            residual[3 * n + axis] -= by_value[n] * value[n] + by_roll[n] * roll[n] + by_pitch[n] * pitch[n]


@_compiled
def _combine_dense(dense: Array, weights: Array, scale: Array, out: Array) -> None:
    """Set a combination of the dense columns of samples."""
    for n in range(len(dense)):
        for axis in range(3):
            total = 0.0
            for d in range(dense.shape[2]):
                total += dense[n, axis, d] * weights[d]
            out[3 * n + axis] = total * scale[axis]


@_compiled
def _subtract_columns(
    rows: Array, column: IntArray, coefficients: Array, start: int, stop: int, residual: Array
) -> None:
    """Subtract combinations of the columns of samples that fire alike, two columns at a time."""
    for a in range(0, len(column), 2):
        first, second = rows[a, start:stop], rows[a + 1, start:stop]
        for k in range(len(coefficients)):
            one = coefficients[k, column[a]]
            other = coefficients[k, column[a + 1]] if column[a + 1] >= 0 else 0.0
            total = residual[k, start:stop]
            for r in range(len(total)):
                total[r] -= one * first[r] + other * second[r]


@_compiled
def _residual(
    table: Table, coefficients: Array, dense: Array, dense_weights: Array, scale: Array, at: _Batch, residual: Array
) -> None:
    """Set the residual ``dense D - Q c`` of the samples of a batch, whose columns need not be known."""
    _combine_dense(dense, dense_weights, scale, residual)
    for b in range(len(table.blocks)):
        _outputs(table, table.blocks[b], coefficients, len(dense), at)
        _subtract(table, table.blocks[b], at.carried[b], len(dense), at, residual)


@_compiled
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
    at, residual = _new_batch(table), np.zeros(3 * _BATCH)
    for start in range(0, len(label), _BATCH):
        stop = min(start + _BATCH, len(label))
        _prepare(table, breakpoints, chunk, start, stop, scale, at)
        for k in range(len(coefficients)):
            _residual(table, coefficients[k], chunk.dense[start:stop], dense_weights[k], scale, at, residual)
            for n in range(stop - start):
                sums = label[start + n]
                for axis in range(3):
                    value = residual[3 * n + axis]
                    square[sums, k] += value * value
                    largest[sums, k] = max(largest[sums, k], abs(value))


@_compiled
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
        ``Y^T Y``, changed in place.
    back : array, shape (parameters, 1)
        Q^T times the first residual, changed in place.
    dense_back : array, shape (dense, 1)
        The dense columns times the first residual, changed in place.
    """
    at, models, every = _new_batch(table), len(coefficients), _places(chunk.dense.shape[2])
    residual, dense = np.zeros((_even(models), 3 * _BATCH)), np.zeros((len(every), 3 * _BATCH))
    part, first_only = np.zeros((len(residual), len(residual))), np.array([0, -1])
    local, local_dense = np.zeros((table.active, 2)), np.zeros((len(every), 2))
    for start in range(0, len(chunk.attitude), _BATCH):
        stop = min(start + _BATCH, len(chunk.attitude))
        _prepare(table, breakpoints, chunk, start, stop, scale, at)
        _fill(table, stop - start, at)
        _take_dense(chunk.dense[start:stop], scale, dense)
        for k in range(models):
            _combine_dense(chunk.dense[start:stop], dense_weights[k], scale, residual[k])
        first = 0
        while first < stop - start:
            last = _end_of_run(at.pattern, at.pattern[: stop - start], first)
            column = at.column[:, first]
            _subtract_columns(at.rows, column, coefficients, 3 * first, 3 * last, residual)
            _multiply(at.rows, residual[:2], 3 * first, 3 * last, False, local)
            _add(column, first_only, local, False, back)
            first = last
        _multiply(residual, residual, 0, 3 * (stop - start), False, part)
        square += part[:models, :models]
        _multiply(dense, residual[:2], 0, 3 * (stop - start), False, local_dense)
        _add(every, first_only, local_dense, False, dense_back)


@_compiled
def _add_difference(left: Array, right: Array, firing: Array, count: int, total: Array) -> None:
    for n in range(count):
        total[n] += firing[n] * (left[n] - right[n])


@_compiled
def _step(table: Table, block: IntArray, input_index: int, count: int, at: _Batch) -> None:
    """Step of a block's output at a breakpoint of one input: what fires left of it less what fires right of it.

    The step of value, slope by roll and slope by pitch; and that of the value where the other input fires by its slope.
    """
    step = at.step
    step[:, :count] = 0.0
    if block[_INPUTS] == 1:
        for k in range(3):
            for n in range(count):
                step[k, n] = at.output[0, k, n] - at.output[1, k, n]
        return
    other = block[_SECOND - input_index]
    others = table.partitions[other, _FIRING]
    for o in range(others):
        left, right = (o, others + o) if input_index == 0 else (2 * o, 2 * o + 1)
        for k in range(3):
            _add_difference(at.output[left, k], at.output[right, k], at.degree[other, o], count, step[k])
        _add_difference(at.output[left, 0], at.output[right, 0], at.degree_slope[other, o], count, step[3])


@_compiled
def _move(table: Table, block: IntArray, carried: Array, input_index: int, count: int, at: _Batch) -> None:
    """Differentiate the torque of an inertia function by the breakpoints around one of its inputs."""
    index = block[_FIRST + input_index]
    angle, functions, first = (
        table.partitions[index, _ANGLE],
        table.partitions[index, _FUNCTIONS],
        table.partitions[index, _FIRST_INNER],
    )
    _step(table, block, input_index, count, at)
    value, by_own, by_other, beside = at.step[0], at.step[1 + angle], at.step[2 - angle], at.step[3]
    position, width = at.position[index], at.width[index]
    input_slope, interval = at.input_slope[index], at.interval[index]
    for end in range(2):
        moved, column = at.moved[2 * index + end], at.moved_column[2 * index + end]
        for n in range(count):
            k, u = interval[n] + end, position[n]
            inner = k >= 1 and k <= functions - 2
            column[n] = first + k - 1 if inner else -1
            moves = 1.0 if inner and input_slope[n] != 0.0 else 0.0
            _, falling, bending = _z_function(u)
            towards = u - 1.0 if end == 0 else -u
            per_width = moves / width[n]
            degree = falling * towards * per_width
            slope = (bending * towards + (1.0 - 2.0 * end) * falling) * per_width / width[n] * input_slope[n]
            own_slope = slope * value[n] + degree * by_own[n]
            other_slope = degree * (by_other[n] + beside[n])
            for axis in range(3):
                carry = carried[axis, 0, n] * degree * value[n] + carried[axis, 1 + angle, n] * own_slope
                moved[3 * n + axis] = carry + carried[axis, 2 - angle, n] * other_slope


@_compiled
def _move_all(table: Table, coefficients: Array, count: int, at: _Batch) -> None:
    for b in range(len(table.blocks)):
        block = table.blocks[b]
        _outputs(table, block, coefficients, count, at)
        for input_index in range(block[_INPUTS]):
            if table.partitions[block[_FIRST + input_index], _FUNCTIONS] > 2:
                _move(table, block, at.carried[b], input_index, count, at)


@_compiled
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
    at, active, every = _new_batch(table), table.active, _places(chunk.dense.shape[2])
    moves, dense, moved = 2 * len(table.partitions), np.zeros((len(every), 3 * _BATCH)), at.moved
    places = np.full(len(moved), -1)
    local, local_dense = np.zeros((active, len(moved))), np.zeros((len(every), len(moved)))
    local_square = np.zeros((len(moved), len(moved)))
    places[moves] = table.breakpoints
    for start in range(0, len(chunk.attitude), _BATCH):
        stop = min(start + _BATCH, len(chunk.attitude))
        _prepare(table, breakpoints, chunk, start, stop, scale, at)
        _fill(table, stop - start, at)
        _move_all(table, coefficients, stop - start, at)
        _take_dense(chunk.dense[start:stop], scale, dense)
        _combine_dense(chunk.dense[start:stop], dense_weights, scale, moved[moves])
        first = 0
        while first < stop - start:
            last = _end_of_run(at.pattern, at.pattern[: stop - start], first)
            column = at.column[:, first]
            _subtract_columns(
                at.rows, column, coefficients.reshape(1, -1), 3 * first, 3 * last, moved[moves : moves + 1]
            )
            _multiply(at.rows, moved, 3 * first, 3 * last, False, local)
            _multiply(dense, moved, 3 * first, 3 * last, False, local_dense)
            _multiply(moved, moved, 3 * first, 3 * last, True, local_square)
            places[:moves] = at.moved_column[:, first]
            _add(column, places, local, False, cross)
            _add(every, places, local_dense, False, dense_cross)
            _add(places, places, local_square, True, square)
            first = last
