"""Compiled loops over samples: sums of a regressor's products without the regressor itself.

A sample fires at most two membership functions per input, so most columns of its three rows are zero. Samples are taken
in the order of what they fire: those that fire the same rules have the same columns, and one product of matrices adds
them up. What is computed of them stands in one array, a line for each quantity, the sample last: first what is known,
then degrees of membership, then whatever `Program` writes as sums of products of lines, the columns last. Which lines
those are follows from the structure alone (`identification.samples`), so one short loop computes all of them: a loop
for each would take three times as long to compile. All loops stand in one module because the cache of compiled code
follows its file.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.compiling import Function, compiled, part


def _part_sum(function: Function) -> Function:
    """Compile, and let the processor take the terms of a sum in the order that suits its registers."""
    return part(function, fastmath={"reassoc", "contract"})


# Lines of every structure: ones; zeros; the step of the output of a block at a breakpoint, as value, slope by roll,
# slope by pitch, and value where the other input fires by its slope; the change of degree and of slope with the
# breakpoint; and three to work in.
ONE, ZERO, STEP, BY_DEGREE, BY_SLOPE, _WORK, FIRST_LINE = 0, 1, 2, 6, 7, 8, 11
# Columns of `Program.partitions`.
_ANTECEDENT, _FUNCTIONS, _RULES, _FIRST_INNER, _DEGREES = range(5)
# Lines of a partition: degrees of the two functions that fire, their slopes, and the position between their peaks.
SLOPE, _POSITION, OF_PARTITION = 2, 4, 5
# Factors of sums of products: 1, -1/2, -1, and the factors of the rows of each axis.
UNIT, HALF_LESS, LESS, OF_AXIS = 0, 1, 2, 3
OF_MOVE = 11
MOTION = 6
"""Lines of motion: rate, then acceleration."""


class Program(NamedTuple):
    """What is computed of each sample, as numbers of lines.

    `partitions`, 5 columns: line of the antecedent, membership functions, rules, first inner breakpoint, first line or
    -1 where one function always fires; the last one is no partition.

    `columns`, 7 columns, those that are not zero at a sample: the one of the first rule; by roll and by pitch
    partition, which of the two functions fires, and columns from one rule to the next.

    `sums`, 6 columns: line that two products are added up in, a negative one of columns, factor, and the lines
    multiplied; `once` of them do not belong to a move.

    `moves`, 11 columns, inputs with inner breakpoints: partition, columns from one of its rules to the next, the same
    of the other input; functions of that which fire, their first line; first column, features, their first row in
    `features`; ends of the sums by the breakpoint on the left and by that on the right.

    `features`: lines of value, slope by roll and slope by pitch, -1 for what is zero; `moved`: first line of
    derivatives by breakpoints.
    """

    partitions: IntArray
    columns: IntArray
    sums: IntArray
    moves: IntArray
    features: IntArray
    once: int
    moved: int


class Table(NamedTuple):
    """A model structure in numbers.

    Attributes
    ----------
    parameters, breakpoints : int
        Columns and inner breakpoints in all.
    harmonic_order : int
        0 for the seesaw.
    ranges : array, shape (2, 2)
        Minimum and maximum of the roll and pitch inputs.
    antecedents : tuple of int
        Lines of the inputs of the partitions.
    """

    program: Program
    parameters: int
    breakpoints: int
    circular: bool
    data_range: bool
    harmonic_order: int
    ranges: Array
    antecedents: tuple[int, ...]


class Chunk(NamedTuple):
    """Consecutive samples.

    Attributes
    ----------
    motion : array, shape (6 + 3 * dense, samples)
        Rate, acceleration, and the columns that no partition changes by axis: the torque first, then those of the rigid
        body where it is free.
    inputs : array, shape (lines, samples)
        See `cpfls_cli.identification.samples.mapped_inputs`; of the structure, so it is put in last.
    """

    motion: Array
    inputs: Array


class Runs(NamedTuple):
    """Samples in the order of what they fire.

    Attributes
    ----------
    sample : array of int, shape (samples,)
    stop : array of int, shape (runs,)
        Where those end that fire the same rules.
    longest : int
        Samples of a run.
    """

    sample: IntArray
    stop: IntArray
    longest: int


class _Space(NamedTuple):
    """Arrays to work in: made by NumPy, as numba compiles half a second for each that it makes."""

    lines: Array
    column: IntArray
    interval: IntArray
    places: IntArray
    weights: Array
    products: Array
    others: int
    crossed: int


_BATCH = 128
"""Samples worked on together: enough to spread the cost of a loop, few enough to stay in the fastest memory."""


@part
def _z_function(u: float) -> tuple[float, float, float]:
    """Zadeh's z-function with its first and second derivative: the copy of `cpfls_cli.fuzzy.basis.z_function`."""
    first, rest = u < 0.5, 1.0 - u
    value = 1.0 - 2.0 * u * u if first else 2.0 * rest * rest
    return value, -4.0 * (u if first else rest), -4.0 if first else 4.0


@part
def _clear(at: Array, first: int, stop: int) -> None:
    for line in range(first, stop):
        for n in range(at.shape[1]):
            at[line, n] = 0.0


@part
def _take(inputs: Array, motion: Array, sample: IntArray, factors: Array, rows: int, at: Array) -> None:
    """Take what is known of samples, with the columns that no partition changes."""
    for n in range(len(sample)):
        at[ONE, n], at[ZERO, n] = 1.0, 0.0
    for k in range(len(inputs)):
        for n in range(len(sample)):
            at[FIRST_LINE + k, n] = inputs[k, sample[n]]
    for k in range(len(motion)):
        line = FIRST_LINE + len(inputs) + k if k < MOTION else rows + k - MOTION
        factor = 1.0 if k < MOTION else factors[OF_AXIS + k % 3]
        for n in range(len(sample)):
            at[line, n] = factor * motion[k, sample[n]]


@part
def _fire(partitions: IntArray, breakpoints: Array, at: Array, interval: IntArray) -> None:
    """Find the two functions of each partition that fire; see `cpfls_cli.fuzzy.basis.memberships`."""
    for index in range(len(partitions)):
        antecedent, first, left = partitions[index, _ANTECEDENT], partitions[index, _DEGREES], 0
        if first < 0:
            continue
        for k in range(1, partitions[index, _FUNCTIONS] - 1):
            left += 1 if at[antecedent, 0] >= breakpoints[index, k] else 0
        interval[index] = left
        low, width = breakpoints[index, left], breakpoints[index, left + 1] - breakpoints[index, left]
        wide, inverse, position = width > 0.0, 1.0 / width if width > 0.0 else 1.0, first + _POSITION
        for n in range(at.shape[1]):
            at[position, n] = min(max(at[antecedent, n], 0.0) - low, width) * inverse if wide else 1.0
        for n in range(at.shape[1]):
            value, falling, _ = _z_function(at[position, n])
            slope = falling * at[antecedent + 1, n] * inverse
            at[first, n], at[first + 1, n] = value, 1.0 - value
            at[first + SLOPE, n], at[first + SLOPE + 1, n] = slope, -slope


@part
def _sum_up(sums: IntArray, first: int, stop: int, factors: Array, rows: int, at: Array) -> None:
    """Compute lines as sums of two products of lines; negative ones are counted from the columns on."""
    for index in range(first, stop):
        to, factor = sums[index, 0], factors[sums[index, 1]]
        a, b, c, d = sums[index, 2], sums[index, 3], sums[index, 4], sums[index, 5]
        to = to if to >= 0 else rows - 1 - to
        if a == ZERO:
            for n in range(at.shape[1]):
                at[to, n] = factor * (at[c, n] * at[d, n])
        else:
            for n in range(at.shape[1]):
                at[to, n] = factor * (at[a, n] * at[b, n] + at[c, n] * at[d, n])


@_part_sum
def _multiply(wide: Array, crossed: int, out: Array) -> None:
    """Set products of columns, four by two: of the first with themselves (upper triangle), of later ones with some.

    Columns come in fours; as many as `out` has are the first.
    """
    for a in range(0, out.shape[0], 4):
        first, stop = (a, out.shape[1]) if a < out.shape[1] else (0, crossed)
        for b in range(first, stop, 2):
            s00 = s01 = s10 = s11 = s20 = s21 = s30 = s31 = 0.0
            for r in range(wide.shape[1]):
                s00 += wide[a, r] * wide[b, r]
                s01 += wide[a, r] * wide[b + 1, r]
                s10 += wide[a + 1, r] * wide[b, r]
                s11 += wide[a + 1, r] * wide[b + 1, r]
                s20 += wide[a + 2, r] * wide[b, r]
                s21 += wide[a + 2, r] * wide[b + 1, r]
                s30 += wide[a + 3, r] * wide[b, r]
                s31 += wide[a + 3, r] * wide[b + 1, r]
            out[a, b], out[a, b + 1], out[a + 1, b], out[a + 1, b + 1] = s00, s01, s10, s11
            out[a + 2, b], out[a + 2, b + 1], out[a + 3, b], out[a + 3, b + 1] = s20, s21, s30, s31


@part
def _combine(wide: Array, rows: int, weights: Array, out: int) -> None:
    """Add up columns by weights, four at a time."""
    for a in range(0, len(weights), 4):
        w0, w1, w2, w3, p = weights[a], weights[a + 1], weights[a + 2], weights[a + 3], rows + a
        for r in range(wide.shape[1]):
            half = w0 * wide[p, r] + w1 * wide[p + 1, r]
            wide[out, r] += half + (w2 * wide[p + 2, r] + w3 * wide[p + 3, r])


@part
def _step(program: Program, number: int, coefficients: Array, interval: IntArray, at: Array) -> None:
    """Step of a block's output at a breakpoint of one input: what fires left of it less what fires right of it.

    The step of value, slope by roll and slope by pitch; and that of the value where the other input fires by its slope.
    """
    move, partitions = program.moves[number], program.partitions
    index, other, features, fires = move[0], move[2], move[7], move[4]
    rules, other_rules = partitions[index, _RULES], partitions[other, _RULES]
    left, right = interval[index] % rules * move[1], (interval[index] + 1) % rules * move[1]
    _clear(at, STEP, STEP + 4)
    for o in range(fires):
        fixed = move[6] + (interval[other] + o) % other_rules * move[3]
        _clear(at, _WORK, _WORK + 3)
        for f in range(features):
            difference = coefficients[fixed + left + f] - coefficients[fixed + right + f]
            for k in range(3):
                feature = program.features[move[8] + f, k]
                if feature >= 0:
                    for n in range(at.shape[1]):
                        at[_WORK + k, n] += difference * at[feature, n]
        for k in range(4 if fires > 1 else 3):
            fired, work = move[5] + o + (SLOPE if k == 3 else 0), _WORK + k % 3
            for n in range(at.shape[1]):
                at[STEP + k, n] += at[fired, n] * at[work, n]


@part
def _change(partitions: IntArray, index: int, interval: int, end: int, breakpoints: Array, at: Array) -> None:
    """Differentiate degree and slope of the functions around an interval by the breakpoint at one of its ends."""
    antecedent, position, k = partitions[index, _ANTECEDENT], partitions[index, _DEGREES] + _POSITION, interval + end
    width, sign, own_end = breakpoints[index, interval + 1] - breakpoints[index, interval], 1.0 - 2.0 * end, 1.0 - end
    per_width = 1.0 / width if width > 0.0 else 1.0
    moves = per_width if k >= 1 and k <= partitions[index, _FUNCTIONS] - 2 else 0.0
    for n in range(at.shape[1]):
        _, falling, bending = _z_function(at[position, n])
        slope, place = at[antecedent + 1, n], sign * at[position, n] - own_end
        at[BY_DEGREE, n] = falling * place * moves if slope != 0.0 else 0.0
        at[BY_SLOPE, n] = (bending * place + sign * falling) * moves * per_width * slope


@part
def _move_all(
    program: Program,
    breakpoints: Array,
    coefficients: Array,
    factors: Array,
    rows: int,
    interval: IntArray,
    at: Array,
    places: IntArray,
) -> None:
    """Differentiate the torque of a run by the breakpoints at both ends of the interval of each input.

    Set which inner breakpoints these are; negative for none.
    """
    partitions, first = program.partitions, program.once
    for index in range(len(partitions) - 1):
        for end in range(2):
            k = interval[index] + end
            inner = k >= 1 and k <= partitions[index, _FUNCTIONS] - 2
            places[2 * index + end] = partitions[index, _FIRST_INNER] + k - 1 if inner else -1
    for number in range(len(program.moves)):
        index = program.moves[number, 0]
        _step(program, number, coefficients, interval, at)
        for end in range(2):
            _change(partitions, index, interval[index], end, breakpoints, at)
            _sum_up(program.sums, first, program.moves[number, 9 + end], factors, rows, at)
            first = program.moves[number, 9 + end]


@part
def _columns(columns: IntArray, partitions: IntArray, interval: IntArray, column: IntArray) -> None:
    """Find which columns those of a run are that are not zero."""
    for a in range(len(columns)):
        roll, pitch = columns[a, 1], columns[a, 4]
        column[a] = columns[a, 0]
        column[a] += (interval[roll] + columns[a, 2]) % partitions[roll, _RULES] * columns[a, 3]
        column[a] += (interval[pitch] + columns[a, 5]) % partitions[pitch, _RULES] * columns[a, 6]


@part
def _add_gram(products: Array, column: IntArray, gram: Array, moment: Array) -> None:
    """Add the products of the columns of a run with each other and with the dense ones."""
    active = len(column)
    for a in range(active):
        for b in range(a, active):
            gram[column[a], column[b]] += products[a, b]
        for d in range(moment.shape[1]):
            moment[column[a], d] += products[a, active + d]


@part
def _add_errors(wide: Array, square: Array, largest: Array) -> None:
    """Add the squares of the residuals of a run, and find the largest of all."""
    for k in range(len(square)):
        for r in range(wide.shape[1]):
            square[k, 0] += wide[k, r] * wide[k, r]
            largest[k, 0] = max(largest[k, 0], abs(wide[k, r]))


@part
def _add_products(
    products: Array, places: IntArray, column: IntArray, square: Array, cross: Array, dense_cross: Array
) -> None:
    """Add products of residuals or derivatives with each other and with all columns, by their places.

    A negative place is none, and so is one that `cross` does not have.
    """
    rows = products.shape[1]
    for b in range(len(places)):
        at = places[b]
        if at >= 0:
            for a in range(b + 1):
                if places[a] >= 0:
                    square[places[a], at] += products[a, b]
            if at < cross.shape[1]:
                for a in range(len(column)):
                    cross[column[a], at] += products[rows + a, b]
                for d in range(len(dense_cross)):
                    dense_cross[d, at] += products[rows + len(column) + d, b]


GRAM, ERRORS, COMBINED, MOVED = range(4)
"""What `add_sums` adds up."""
NOTHING = np.zeros((0, 0))


@compiled
def _add_up(
    what: int,
    program: Program,
    breakpoints: Array,
    chunk: Chunk,
    runs: Runs,
    label: IntArray,
    factors: Array,
    models: tuple[Array, Array],
    sums: tuple[Array, Array, Array],
    space: _Space,
) -> None:
    """Go through a chunk, run by run of samples that fire the same rules, and add up what is asked for.

    `models`: coefficients, shape (models, parameters), and dense weights, shape (models, dense); `sums`, see what calls
    this, of shapes (sums, n, n), (sums, parameters, m) and (dense, m), are changed in place.
    """
    coefficients, dense_weights = models
    square, cross, dense_cross = sums
    inputs, motion, sample, column = chunk.inputs, chunk.motion, runs.sample, space.column
    # With the three axes side by side: derivatives and residuals, then the columns.
    active, rows = len(column), program.moved + 3 * space.others
    wide_lines, lines = space.others + len(space.weights), rows + 3 * len(space.weights)
    start, run = 0, 0
    while start < len(sample):
        stop = min(start + _BATCH, runs.stop[run])
        run += 1 if stop == runs.stop[run] else 0
        count, own, some = stop - start, label[sample[start]], sample[start:stop]
        start = stop
        at = space.lines[: lines * count].reshape(lines, count)
        wide = space.lines[program.moved * count : lines * count].reshape(wide_lines, 3 * count)
        _clear(at, program.moved, rows)
        _clear(at, rows + 3 * active + len(motion) - MOTION, lines)
        _take(inputs, motion, some, factors, rows + 3 * active, at)
        _fire(program.partitions, breakpoints, at, space.interval)
        _sum_up(program.sums, 0, program.once, factors, rows, at)
        _columns(program.columns, program.partitions, space.interval, column)
        if what == MOVED:
            _move_all(program, breakpoints, coefficients[0], factors, rows, space.interval, at, space.places)
        for k in range(len(coefficients)):
            for a in range(active):
                space.weights[a] = -coefficients[k, column[a]]
            for d in range(dense_weights.shape[1]):
                space.weights[active + d] = dense_weights[k, d]
            _combine(wide, space.others, space.weights, len(space.places) - len(coefficients) + k)
        if what == ERRORS:
            _add_errors(wide, square[own], cross[own])
            continue
        _multiply(wide, space.crossed, space.products)
        if what == GRAM:
            _add_gram(space.products, column, square[own], cross[own])
        else:
            _add_products(space.products, space.places, column, square[own], cross[own], dense_cross)


def motion_lines(rate: Array, acceleration: Array, dense: Array) -> Array:
    """Arrange `Chunk.motion`.

    Parameters
    ----------
    rate, acceleration : array, shape (samples, 3)
    dense : array, shape (samples, 3, dense)
    """
    lines = [rate.T, acceleration.T, dense.transpose(2, 1, 0).reshape(-1, len(dense))]
    return np.ascontiguousarray(np.concatenate(lines))


def runs_of(table: Table, breakpoints: Array, inputs: Array) -> Runs:
    """Put samples in the order of the cells that all breakpoints cut roll and pitch into, those of one by time."""
    partitions, cell, cells = table.program.partitions[:-1], np.zeros(inputs.shape[1], np.int64), 1
    antecedents, functions = partitions[:, _ANTECEDENT], partitions[:, _FUNCTIONS]
    place = np.arange(breakpoints.shape[1])
    for line in table.antecedents:
        own = breakpoints[antecedents == line]
        inner = np.sort(own[(place > 0) & (place < functions[antecedents == line, None] - 1)])
        if len(inner):
            cell = cell * (len(inner) + 1) + np.searchsorted(inner, inputs[line - FIRST_LINE], "right")
            cells *= len(inner) + 1
    # Small numbers are sorted by their digits.
    sample = np.argsort(cell.astype(np.uint16 if cells < 2**16 else np.int64), kind="stable")
    ordered = cell[sample]
    stop = np.append(np.flatnonzero(ordered[1:] != ordered[:-1]) + 1, len(sample))
    return Runs(sample, stop, int(np.diff(stop, prepend=0).max()))


def _by_label(runs: Runs, label: IntArray) -> Runs:
    """End runs where the label changes, too."""
    labels = label[runs.sample]
    changes = np.flatnonzero(labels[1:] != labels[:-1]) + 1
    return runs._replace(stop=np.union1d(runs.stop, changes)) if len(changes) else runs


def add_sums(
    what: int,
    table: Table,
    breakpoints: Array,
    chunk: Chunk,
    runs: Runs,
    scale: Array,
    label: IntArray,
    models: tuple[Array, Array],
    sums: tuple[Array, Array, Array],
) -> None:
    """Add up sums over the samples of a chunk, by its runs and labels, in place.

    `scale`: factor of the rows about each axis; `models`: coefficients c, shape (models, parameters), and weights D of
    the dense columns, shape (models, dense), of residuals ``r = dense D - Q c``, `NOTHING` twice where there are none.
    Labels count for the first two only; the others have one, 0. `sums`, see `_add_up`:

    - `GRAM`: ``Q^T Q`` and ``Q^T dense``, `NOTHING`; an entry off the diagonal means the sum with its mirror image.
    - `ERRORS`: squares of r over samples and axes, and the largest of all, shape (labels, models, 1) each, `NOTHING`.
    - `COMBINED`: products of the residuals of all models, upper triangle; Q^T, and the dense columns, times the first.
    - `MOVED`: products of ``[M, r]`` with itself, upper triangle, whose entries mean the sum with their mirror images,
      and of Q and of the dense columns with it, where -M are the derivatives of the one r by the inner breakpoints.
    """
    program, dense = table.program, (len(chunk.motion) - MOTION) // 3
    active, partitions = len(program.columns), len(program.partitions)
    # The derivatives and the residual, or the residual of each model.
    places = np.arange(len(models[0])) if what != MOVED else np.full(2 * partitions - 1, table.breakpoints)
    width, others = fours(active + dense), fours(len(places))
    space = _Space(
        lines=np.empty((program.moved + 3 * (width + others)) * min(_BATCH, runs.longest)),
        column=np.zeros(active, np.int64),
        interval=np.zeros(partitions, np.int64),
        places=places,
        weights=np.zeros(width),
        products=np.empty((width + others, width if what == GRAM else others)),
        others=others,
        crossed=2 if what == COMBINED else others,
    )
    factors = np.array([1.0, -0.5, -1.0, *scale])
    own = np.zeros_like(label) if what in (COMBINED, MOVED) else label
    _add_up(what, program, breakpoints, chunk, _by_label(runs, own), own, factors, models, sums, space)


def fours(count: int) -> int:
    """Round up to a multiple of four."""
    return (count + 3) // 4 * 4
