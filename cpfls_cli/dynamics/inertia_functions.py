"""Inertia functions over the attitude: torque, inertia matrix and Coriolis matrix for any motion."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.dynamics.rigid_body import inertia_matrix, inertia_matrix_gradient, rigid_columns
from cpfls_cli.fuzzy.inputs import InputRange
from cpfls_cli.inertia import INERTIA_ENTRIES, symmetric
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.regressor.regressor import InertiaValues, Regressor
from cpfls_cli.regressor.structure import ModelStructure
from cpfls_cli.result import about, part
from cpfls_cli.rotations import wrapped

CELLS = 72
"""Cells per turn, 5 degrees each."""


def visited_cells(attitudes: Iterable[Array]) -> BoolArray:
    """Mark the cells of roll and pitch that data visit, and their neighbours.

    Parameters
    ----------
    attitudes : iterable of array, shape (samples, 3), rad
        Chunk by chunk.

    Returns
    -------
    array of bool, shape (72, 72)
        Roll along the first axis, from -180 degrees.
    """
    visited = np.zeros((CELLS, CELLS), dtype=bool)
    for attitude in attitudes:
        visited[_cells(attitude[:, 0]), _cells(attitude[:, 1])] = True
    shifts = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    return np.asarray(np.any([np.roll(visited, shift, axis=(0, 1)) for shift in shifts], axis=0))


def outside_visited(visited: BoolArray, attitude: Array) -> BoolArray:
    """Flag attitudes, rad, whose cell was not visited."""
    return np.asarray(~visited[_cells(attitude[:, 0]), _cells(attitude[:, 1])])


def _cells(angle: Array) -> IntArray:
    cells: IntArray = np.floor((wrapped(angle) + np.pi) * (CELLS / (2 * np.pi))).astype(np.int64)
    return np.clip(cells, 0, CELLS - 1)


_BATCH = 8192


@dataclass(frozen=True, eq=False)
class InertiaFunctions:
    """A grey-box model of rotational dynamics: inertia over attitude by fuzzy systems."""

    structure: ModelStructure = part()
    ranges: tuple[InputRange, InputRange] = part()
    """Of roll and pitch over the training data."""
    partitions: tuple[Array, ...] = about(
        "peaks of the membership functions on [0, 1], of each partition", "partition", brief=False
    )
    coefficients: Array = about(
        "of the rule consequents, by inertia function, rule and feature",
        "rule_coefficient",
        unit="kg m^2",
        frame="Euler angles (intrinsic ZYX)",
        brief=False,
    )
    rigid_body: Array = about(
        "Ixx Iyy Izz Ixy Ixz Iyz under the fuzzy part; zero for none", "6", unit="kg m^2", frame="body (FLU)"
    )
    visited: BoolArray = about(
        "cells of roll and pitch that training visited",
        "cell",
        "cell",
        frame="Euler angles (intrinsic ZYX)",
        brief=False,
    )

    def torque(self, motion: Motion) -> Array:
        """Predict the generalised torque, ``J qdd + C qd``.

        Returns
        -------
        array, shape (samples, 3), N m
        """
        batches = [motion[slice(start, start + _BATCH)] for start in range(0, len(motion), _BATCH)]
        fuzzy = [
            Regressor(self.structure, one, self.ranges).torque(self.partitions, self.coefficients) for one in batches
        ]
        return np.concatenate(
            [part + rigid_columns(one) @ self.rigid_body for part, one in zip(fuzzy, batches, strict=True)]
        )

    def inertia(self, attitude: Array) -> InertiaValues:
        """Evaluate J(q) and its gradient.

        Parameters
        ----------
        attitude : array, shape (samples, 3), rad
        """
        still = Motion(attitude, np.zeros_like(attitude), np.zeros_like(attitude))
        fuzzy = Regressor(self.structure, still, self.ranges).inertia(self.partitions, self.coefficients)
        tensor = symmetric(self.rigid_body)
        return InertiaValues(
            fuzzy.value + inertia_matrix(attitude, tensor), fuzzy.gradient + inertia_matrix_gradient(attitude, tensor)
        )

    def corrected(self, added: Array) -> InertiaFunctions:
        """Add an inertia tensor, shape (3, 3), kg m^2, body frame."""
        return replace(self, rigid_body=self.rigid_body + [added[entry] for entry in INERTIA_ENTRIES])

    def outside(self, attitude: Array) -> BoolArray:
        """Flag attitudes, shape (samples, 3), rad, outside the region that the training data visited."""
        return outside_visited(self.visited, attitude)

    @property
    def same_everywhere(self) -> bool:
        """Whether one rule acts at all attitudes, and training went all the way round in roll and in pitch."""
        one_rule = all(block.rules == 1 for block in self.structure.blocks)
        return one_rule and all(self.visited.any(axis=angle).all() for angle in (0, 1))
