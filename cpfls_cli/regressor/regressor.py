"""The regressor Q(q, qd, qdd) of a motion, which gives the torque from the linear parameters; slopes by breakpoints."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cpfls_cli.arrays import Array, IntArray, require_columns
from cpfls_cli.fuzzy.basis import (
    Basis,
    InputRange,
    MappedInput,
    Memberships,
    antecedent,
    basis,
    breakpoints,
    features,
    input_range,
    map_input,
    rule_firing,
    uniform_weights,
)
from cpfls_cli.regressor.structure import PITCH, ROLL, Block, InertiaFunction, ModelStructure

RIGID = 6
"""Inertia parameters of a rigid body."""


@dataclass(frozen=True)
class Motion:
    """Attitude motion at samples.

    Attributes
    ----------
    attitude : array, shape (samples, 3), rad
        Roll, pitch, yaw.
    rate : array, shape (samples, 3), rad/s
        Euler rates.
    acceleration : array, shape (samples, 3), rad/s^2
        Euler accelerations.
    """

    attitude: Array
    rate: Array
    acceleration: Array

    def __post_init__(self) -> None:
        """Check the shapes."""
        for name in ("attitude", "rate", "acceleration"):
            require_columns(name, getattr(self, name), 3)

    def __len__(self) -> int:
        """Count the samples."""
        return len(self.attitude)

    def __getitem__(self, samples: slice | IntArray) -> Motion:
        """Take some of the samples."""
        return Motion(self.attitude[samples], self.rate[samples], self.acceleration[samples])


@dataclass(frozen=True)
class Carrier:
    """Factors with which one inertia function enters the torque.

    With E the symmetric matrix that has ones in the function's places, a function f(q) there gives the torque ``E qdd f
    + E qd (df/dt) - 1/2 (qd^T E qd) grad f``: the Christoffel form of equations (3) and (4). `acceleration` is E qdd,
    `rate` E qd, `energy` qd^T E qd / 2.
    """

    acceleration: Array
    rate: Array
    energy: Array


def carrier(function: InertiaFunction, motion: Motion) -> Carrier:
    """Evaluate the factors of an inertia function along a motion.

    method.md section 2: ``tau = J qdd + (dJ/dt) qd - 1/2 grad_q (qd^T J qd)``.
    """
    places = np.zeros((3, 3))
    places[function.row, function.column] = places[function.column, function.row] = 1.0
    rate = motion.rate @ places
    return Carrier(motion.acceleration @ places, rate, 0.5 * np.sum(motion.rate * rate, axis=1))


Breakpoints = Sequence[Array]
"""Of all partitions, in the order of `ModelStructure.partitions`, each of shape (functions,)."""


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
        by_inputs = {block.function.inputs: self._features(block) for block in structure.blocks}
        self.features: tuple[Basis, ...] = tuple(by_inputs[block.function.inputs] for block in structure.blocks)

    @cached_property
    def carriers(self) -> tuple[Carrier, ...]:
        """Factors of each inertia function along the motion."""
        return tuple(carrier(block.function, self.motion) for block in self.structure.blocks)

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
        """
        if self.structure.blocks[index].rules == 1:
            return self.features[index]
        return basis(self.antecedents(index, partitions), self.features[index])

    def antecedents(self, index: int, partitions: Breakpoints) -> list[Memberships]:
        """Evaluate the antecedents of one inertia function, one per input.

        Parameters
        ----------
        index : int
            Index of the block.
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

        Returns
        -------
        array, shape (samples, rules)
        """
        if self.structure.blocks[index].rules == 1:
            return np.ones((len(self.motion), 1))
        return rule_firing(self.antecedents(index, partitions))[0]

    def inertia(self, partitions: Breakpoints, coefficients: Array) -> InertiaValues:
        """Evaluate the fuzzy inertia matrix and its gradient.

        Parameters
        ----------
        coefficients : array, shape (parameters,)
        """
        J = np.zeros((len(self.motion), 3, 3))
        dJ = np.zeros((len(self.motion), 3, 3, 3))
        for index, block in enumerate(self.structure.blocks):
            function, of_block = block.function, coefficients[block.columns]
            evaluated = self.basis(index, partitions)
            row, column = function.row, function.column
            J[:, row, column] = J[:, column, row] = evaluated.value @ of_block
            for angle, gradient in zip(function.inputs, evaluated.gradient, strict=True):
                dJ[:, angle, row, column] = dJ[:, angle, column, row] = gradient @ of_block
        return InertiaValues(J, dJ)

    def _features(self, block: Block) -> Basis:
        if not block.partitions:
            return Basis(np.ones((len(self.motion), 1)), np.zeros((0, len(self.motion), 1)))
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
