"""A model structure as the table of numbers that compiled loops read."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.fuzzy.inputs import InputRange, map_input
from cpfls_cli.regressor.kernels import Table
from cpfls_cli.regressor.regressor import Breakpoints
from cpfls_cli.regressor.structure import PITCH, ROLL, Block, ModelStructure, Partition


def structure_table(structure: ModelStructure, ranges: tuple[InputRange, InputRange]) -> Table:
    """Write a model structure as a table.

    Parameters
    ----------
    ranges : tuple of InputRange
        Of roll and pitch over the training data.
    """
    settings = structure.settings
    harmonic = settings.consequents == "harmonic"
    firing = [_firing(structure, partition) for partition in structure.partitions]
    active = sum(block.features * int(np.prod([firing[i] for i in block.partitions])) for block in structure.blocks)
    inner = [max(partition.functions - 2, 0) for partition in structure.partitions]
    first = np.cumsum([0, *inner[:-1]])
    partitions = [
        (partition.input, partition.functions, together, int(start))
        for partition, together, start in zip(structure.partitions, firing, first, strict=True)
    ]
    # One that stands for no partition.
    partitions.append((ROLL, 1, 1, 0))
    return Table(
        blocks=np.array([_block(structure, block) for block in structure.blocks]),
        partitions=np.array(partitions),
        active=active,
        parameters=structure.parameters,
        breakpoints=sum(inner),
        circular=structure.circular,
        data_range=settings.input_map == "data-range",
        harmonic=harmonic,
        tensor=settings.products == "tensor",
        single=2 * settings.harmonic_order if harmonic else 1,
        ranges=np.array([(data_range.minimum, data_range.maximum) for data_range in ranges]),
    )


def mapped_inputs(table: Table, attitude: Array) -> Array:
    """Map roll and pitch to antecedent and consequent with their slopes; see `cpfls_cli.fuzzy.inputs.map_input`.

    Parameters
    ----------
    attitude : array, shape (samples, 3), rad

    Returns
    -------
    array, shape (8, samples)
        Antecedent, its slope, consequent and its slope of roll, then of pitch. The slope of an antecedent beyond the
        partition is zero, as that of its membership functions is.
    """
    lines: list[Array] = []
    for angle, ends in zip(attitude.T[:2], table.ranges.tolist(), strict=True):
        found = map_input(angle, "data-range" if table.data_range else "full-circle", table.circular, InputRange(*ends))
        inside = (found.antecedent >= 0.0) & (found.antecedent <= 1.0)
        slope = np.where(inside, found.antecedent_slope, 0.0)
        lines += [found.antecedent, slope, found.consequent, found.consequent_slope]
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


def _firing(structure: ModelStructure, partition: Partition) -> int:
    """Rules that fire at a time: two joined into one, or one alone, always do."""
    return 1 if partition.functions == 1 or (structure.circular and partition.functions == 2) else 2


def _block(structure: ModelStructure, block: Block) -> tuple[int, ...]:
    none, inputs = len(structure.partitions), block.function.inputs
    roll, pitch = (block.partitions[inputs.index(angle)] if angle in inputs else none for angle in (ROLL, PITCH))
    rules = structure.partitions[pitch].rules(circular=structure.circular) if pitch < none else 1
    kind = len(inputs) if len(inputs) != 1 else inputs[0]
    entry = block.function.row, block.function.column, roll, pitch, kind
    return (*entry, block.features, block.columns.start, rules)
