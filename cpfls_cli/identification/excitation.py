"""What the training data excited: cells of attitude, rules, axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.fuzzy.inputs import wrap
from cpfls_cli.regressor.regressor import Breakpoints, Regressor

CELLS = 72
"""Cells per turn, 5 degrees each."""

SILENT_FIRING = 1e-3
DETERMINED_SHARE = 0.5


@dataclass(frozen=True)
class RuleExcitation:
    """How far data excite each rule.

    Attributes
    ----------
    name : tuple of str
        Inertia function and rule, as ``D23 rule 4``.
    firing : array, shape (rules,)
        Largest firing strength over the samples.
    determined : array, shape (rules,)
        Share of the rule's coefficient directions that the samples determine.
    """

    name: tuple[str, ...]
    firing: Array
    determined: Array

    @property
    def excited(self) -> BoolArray:
        """Whether a rule fires at all and data determine at least half of its coefficients."""
        return np.asarray((self.firing > SILENT_FIRING) & (self.determined >= DETERMINED_SHARE))


def visited_cells(attitude: Array) -> BoolArray:
    """Mark the cells of roll and pitch that data visit, and their neighbours.

    Parameters
    ----------
    attitude : array, shape (samples, 3), rad

    Returns
    -------
    array of bool, shape (72, 72)
        Roll along the first axis, from -180 degrees.
    """
    visited = np.zeros((CELLS, CELLS), dtype=bool)
    visited[_cells(attitude[:, 0]), _cells(attitude[:, 1])] = True
    shifts = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    return np.asarray(np.any([np.roll(visited, shift, axis=(0, 1)) for shift in shifts], axis=0))


def outside_visited(visited: BoolArray, attitude: Array) -> BoolArray:
    """Flag attitudes whose cell was not visited.

    Parameters
    ----------
    visited : array of bool, shape (72, 72)
    attitude : array, shape (samples, 3), rad

    Returns
    -------
    array of bool, shape (samples,)
    """
    return np.asarray(~visited[_cells(attitude[:, 0]), _cells(attitude[:, 1])])


def rule_excitation(
    regressor: Regressor, partitions: Breakpoints, Q: Array, noise: float, inertia: float, rank_tolerance: float
) -> RuleExcitation:
    """Measure how far samples excite each rule.

    A direction of the coefficients counts as determined where noise in the torque moves it by less than the
    inertia itself: its singular value is above noise over inertia, and above the rank tolerance.

    Parameters
    ----------
    regressor : Regressor
    partitions : sequence of array
    Q : array, shape (samples, 3, parameters)
        The regressor's matrix for these partitions.
    noise : float, N m
        Root mean square of what no model explains.
    inertia : float, kg m^2
        Typical moment of inertia.
    rank_tolerance : float

    Returns
    -------
    RuleExcitation
    """
    rows = Q.reshape(-1, Q.shape[2])
    _, singular_values, Vt = linalg.svd(rows, full_matrices=False, check_finite=False)
    floor = max(rank_tolerance * singular_values[0], noise / inertia if inertia > 0 else 0.0)
    share = np.sum(Vt[singular_values > floor] ** 2, axis=0)
    names, firing, determined = [], [], []
    for index, block in enumerate(regressor.structure.blocks):
        names += [f"{block.function.name} rule {rule + 1}" for rule in range(block.rules)]
        firing.append(np.max(regressor.firing(index, partitions), axis=0))
        determined.append(np.mean(share[block.columns].reshape(block.rules, block.features), axis=1))
    return RuleExcitation(tuple(names), np.concatenate(firing), np.concatenate(determined))


def _cells(angle: Array) -> IntArray:
    cells: IntArray = np.floor((wrap(angle) + np.pi) * (CELLS / (2 * np.pi))).astype(np.int64)
    return np.clip(cells, 0, CELLS - 1)
