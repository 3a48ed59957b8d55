"""The regressor Q(q, qd, qdd), which gives the torque from the linear parameters, and its slopes by the breakpoints."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.fuzzy.basis import (
    Basis,
    antecedent,
    antecedent_sensitivity,
    basis,
    features,
    rule_firing,
)
from cpfls_cli.fuzzy.inputs import InputRange, MappedInput, input_range, map_input
from cpfls_cli.fuzzy.membership import Memberships, MembershipSensitivity, breakpoints, uniform_weights
from cpfls_cli.regressor.motion import Carrier, Motion, carrier
from cpfls_cli.regressor.structure import PITCH, ROLL, Block, ModelStructure

Breakpoints = Sequence[Array]


@dataclass(frozen=True)
class InertiaValues:
    """Inertia matrix and its gradient at samples.

    Attributes
    ----------
    value : array, shape (samples, 3, 3), kg m^2
        J(q), symmetric.
    gradient : array, shape (samples, 3, 3, 3), kg m^2/rad
        The first index after the sample is the angle by input_index J is differentiated.
    """

    value: Array
    gradient: Array


def uniform_breakpoints(structure: ModelStructure) -> tuple[Array, ...]:
    """Give the equidistant partitions of a model.

    Returns
    -------
    tuple of array, shape (functions,)
    """
    return tuple(breakpoints(uniform_weights(partition.functions)) for partition in structure.partitions)


def data_ranges(structure: ModelStructure, attitude: Array) -> tuple[InputRange, InputRange]:
    """Find the ranges of roll and pitch over training data, for the input map `data-range`.

    Parameters
    ----------
    structure : ModelStructure
    attitude : array, shape (samples, 3), rad

    Returns
    -------
    tuple of InputRange
        Roll and pitch.
    """
    roll, pitch = (input_range(attitude[:, angle], structure.circular) for angle in (ROLL, PITCH))
    return roll, pitch


def joined_ranges(ranges: Iterable[tuple[InputRange, InputRange]]) -> tuple[InputRange, InputRange]:
    """Join the ranges of several parts of the training data.

    Parameters
    ----------
    ranges : iterable of tuple of InputRange
        Roll and pitch, part by part.
    """
    roll, pitch = (
        InputRange(min(part.minimum for part in parts), max(part.maximum for part in parts))
        for parts in zip(*ranges, strict=True)
    )
    return roll, pitch


class Regressor:
    """The regressor of one motion for any partitions of one model structure.

    What does not depend on the partitions is computed once; an optimiser then asks for matrices by breakpoints.

    Parameters
    ----------
    structure : ModelStructure
    motion : Motion
    ranges : tuple of InputRange
        Of roll and pitch over the training data.
    """

    def __init__(self, structure: ModelStructure, motion: Motion, ranges: tuple[InputRange, InputRange]) -> None:
        self.structure = structure
        self.motion = motion
        self.ranges = ranges
        self.mapped: tuple[MappedInput, ...] = tuple(
            map_input(motion.attitude[:, angle], structure.settings.input_map, structure.circular, ranges[angle])
            for angle in (ROLL, PITCH)
        )
        self.carriers: tuple[Carrier, ...] = tuple(carrier(block.function, motion) for block in structure.blocks)
        self.features: tuple[Basis | None, ...] = tuple(self._features(block) for block in structure.blocks)

    def matrix(self, partitions: Breakpoints) -> Array:
        """Build Q for given partitions.

        Parameters
        ----------
        partitions : sequence of array, shape (functions,)
            Breakpoints in the order of `ModelStructure.partitions`.

        Returns
        -------
        array, shape (samples, 3, parameters)

        References
        ----------
        Equation (17).
        """
        Q = np.empty((len(self.motion), 3, self.structure.parameters))
        for index, block in enumerate(self.structure.blocks):
            terms = self._torque_terms(block, self.carriers[index], self.basis(index, partitions))
            Q[:, :, block.columns] = terms
        return Q

    def torque(self, partitions: Breakpoints, coefficients: Array) -> Array:
        """Evaluate ``Q c`` without building Q.

        Parameters
        ----------
        partitions : sequence of array
        coefficients : array, shape (parameters,)

        Returns
        -------
        array, shape (samples, 3), N m
        """
        torque = np.zeros((len(self.motion), 3))
        for index, block in enumerate(self.structure.blocks):
            carried, evaluated = self.carriers[index], self.basis(index, partitions)
            of_block = coefficients[block.columns]
            along = np.zeros(len(self.motion))
            for angle, gradient in zip(block.function.inputs, evaluated.gradient, strict=True):
                slope = gradient @ of_block
                along += slope * self.motion.rate[:, angle]
                torque[:, angle] -= carried.energy * slope
            torque += carried.acceleration * (evaluated.value @ of_block)[:, None] + carried.rate * along[:, None]
        return torque

    def basis(self, index: int, partitions: Breakpoints) -> Basis:
        """Evaluate the basis of one inertia function.

        Parameters
        ----------
        index : int
            Index of the block.
        partitions : sequence of array
        """
        consequent = self.features[index]
        if consequent is None:
            return Basis(np.ones((len(self.motion), 1)), np.zeros((0, len(self.motion), 1)))
        return basis(self.antecedents(index, partitions), consequent)

    def antecedents(self, index: int, partitions: Breakpoints) -> list[Memberships]:
        """Evaluate the antecedents of one inertia function, one per input.

        Parameters
        ----------
        index : int
            Index of the block.
        partitions : sequence of array
        """
        block = self.structure.blocks[index]
        return [
            antecedent(self.mapped[angle], partitions[i], self.structure.circular)
            for angle, i in zip(block.function.inputs, block.partitions, strict=True)
        ]

    def firing(self, index: int, partitions: Breakpoints) -> Array:
        """Evaluate how strongly each rule of one inertia function fires.

        Parameters
        ----------
        index : int
            Index of the block.
        partitions : sequence of array

        Returns
        -------
        array, shape (samples, rules)
        """
        if self.features[index] is None:
            return np.ones((len(self.motion), 1))
        return rule_firing(self.antecedents(index, partitions))[0]

    def inertia(self, partitions: Breakpoints, coefficients: Array) -> InertiaValues:
        """Evaluate the fuzzy inertia matrix and its gradient.

        Parameters
        ----------
        partitions : sequence of array
        coefficients : array, shape (parameters,)
        """
        J = np.zeros((len(self.motion), 3, 3))
        dJ = np.zeros((len(self.motion), 3, 3, 3))
        for index, block in enumerate(self.structure.blocks):
            function, of_block = block.function, coefficients[block.columns]
            evaluated = self.basis(index, partitions)
            for row, column in {(function.row, function.column), (function.column, function.row)}:
                J[:, row, column] = evaluated.value @ of_block
                for angle, gradient in zip(function.inputs, evaluated.gradient, strict=True):
                    dJ[:, angle, row, column] = gradient @ of_block
        return InertiaValues(J, dJ)

    def _features(self, block: Block) -> Basis | None:
        if not block.partitions:
            return None
        settings = self.structure.settings
        angles = [self.motion.attitude[:, angle] for angle in block.function.inputs]
        mapped = [self.mapped[angle] for angle in block.function.inputs]
        return features(angles, mapped, settings.consequents, settings.harmonic_order, settings.products)

    def _torque_terms(self, block: Block, carried: Carrier, evaluated: Basis) -> Array:
        terms = carried.acceleration[:, :, None] * evaluated.value[:, None, :]
        along = np.zeros_like(evaluated.value)
        for angle, gradient in zip(block.function.inputs, evaluated.gradient, strict=True):
            along += gradient * self.motion.rate[:, angle, None]
            terms[:, angle, :] -= carried.energy[:, None] * gradient
        terms += carried.rate[:, :, None] * along[:, None, :]
        return terms


def torque_sensitivity(regressor: Regressor, partitions: Breakpoints, coefficients: Array) -> list[Array]:
    """Differentiate the model torque by every inner breakpoint, in closed form.

    Parameters
    ----------
    regressor : Regressor
    partitions : sequence of array, shape (functions,)
    coefficients : array, shape (parameters,)

    Returns
    -------
    list of array, shape (samples, 3, functions - 2)
        One per partition.
    """
    structure = regressor.structure
    sensitivity = [np.zeros((len(regressor.motion), 3, max(p.functions - 2, 0))) for p in structure.partitions]
    for index, block in enumerate(structure.blocks):
        for input_index, partition in enumerate(block.partitions):
            if structure.partitions[partition].functions > 2:
                sensitivity[partition] = _block_sensitivity(regressor, partitions, coefficients, index, input_index)
    return sensitivity


def _block_sensitivity(
    regressor: Regressor, partitions: Breakpoints, coefficients: Array, index: int, input_index: int
) -> Array:
    """Differentiate one inertia function's torque by the breakpoints along one of its inputs."""
    block = regressor.structure.blocks[index]
    value, gradient = _function_sensitivity(regressor, partitions, coefficients, index, input_index)
    carried = regressor.carriers[index]
    torque: Array = carried.acceleration[:, :, None] * value[:, None, :]
    for angle, by_angle in zip(block.function.inputs, gradient, strict=True):
        along = by_angle * regressor.motion.rate[:, angle, None]
        torque += carried.rate[:, :, None] * along[:, None, :]
        torque[:, angle, :] -= carried.energy[:, None] * by_angle
    return torque


def _function_sensitivity(
    regressor: Regressor, partitions: Breakpoints, coefficients: Array, index: int, input_index: int
) -> tuple[Array, list[Array]]:
    """Differentiate f(q) and its gradient by breakpoints; the consequents do not depend on them."""
    block = regressor.structure.blocks[index]
    consequent = regressor.features[index]
    assert consequent is not None
    antecedents = regressor.antecedents(index, partitions)
    rules = [a.value.shape[1] for a in antecedents]
    per_rule = coefficients[block.columns].reshape(block.rules, block.features).T
    moved = antecedent_sensitivity(
        regressor.mapped[block.function.inputs[input_index]],
        partitions[block.partitions[input_index]],
        regressor.structure.circular,
    )
    outputs = _along(consequent.value @ per_rule, rules, input_index)
    value = _contract(outputs, moved.value, antecedents, input_index, slope=False)
    gradient = []
    for direction, slopes in enumerate(consequent.gradient):
        by_consequent = _contract(
            _along(slopes @ per_rule, rules, input_index), moved.value, antecedents, input_index, slope=False
        )
        gradient.append(by_consequent + _by_antecedent(outputs, moved, antecedents, input_index, direction))
    return value, gradient


def _by_antecedent(
    outputs: Array, moved: MembershipSensitivity, antecedents: list[Memberships], input_index: int, direction: int
) -> Array:
    if direction == input_index:
        return _contract(outputs, moved.slope, antecedents, input_index, slope=False)
    return _contract(outputs, moved.value, antecedents, input_index, slope=True)


def _along(rule_outputs: Array, rules: list[int], input_index: int) -> Array:
    """Arrange rule outputs as (samples, rules along the moved input, rules along the other)."""
    if len(rules) == 1:
        return rule_outputs[:, :, None]
    grid = rule_outputs.reshape(-1, *rules)
    return grid if input_index == 0 else grid.swapaxes(1, 2)


def _contract(outputs: Array, moved: Array, antecedents: list[Memberships], input_index: int, *, slope: bool) -> Array:
    """Sum rule outputs over both inputs' rules; the other input fires by its value or by its slope."""
    if len(antecedents) == 1:
        return np.asarray(np.einsum("nl,nlb->nb", outputs[:, :, 0], moved))
    other = antecedents[1 - input_index]
    fired = np.einsum("nlm,nm->nl", outputs, other.slope if slope else other.value)
    return np.asarray(np.einsum("nl,nlb->nb", fired, moved))
