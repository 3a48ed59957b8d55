"""A- and D-optimal greedy selection with rank-three updates for all samples at once."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.reduction.factor import TriangularFactor
from cpfls_cli.reduction.survey import project
from cpfls_cli.reduction.ties import first_best

# Updates lose a little accuracy each; an exact refresh costs as much as some ten of them.
_REFRESH_STEPS = 100


class OptimalDesign:
    """Keep ``K_i = R_i G^-1 R_i^T`` and ``M_i = R_i G^-2 R_i^T`` of every sample as the selection grows.

    Parameters
    ----------
    rows : array, shape (samples, 3, columns)
    optimality : {"A", "D"}
        A minimises ``trace G^-1``, the sum of the parameters' variances; D maximises ``det G``.
    """

    def __init__(self, rows: Array, optimality: str) -> None:
        self._rows = rows
        self._optimality = optimality
        self._steps = 0

    def next_sample(self, factor: TriangularFactor, available: BoolArray) -> int:
        """Name the sample with the largest gain.

        The gain is ``trace((I + K_i)^-1 M_i)`` for A, the fall of ``trace G^-1``, and ``det(I + K_i)`` for D,
        the factor by which ``det G`` grows.

        Parameters
        ----------
        factor : TriangularFactor
            Factor of the samples chosen so far, of full rank; all but the first call must follow a call whose
            sample was added.
        available : array of bool, shape (samples,)

        References
        ----------
        method.md, section 6.
        """
        if self._steps % _REFRESH_STEPS == 0:
            self._refresh(factor)
        gain = variance_reduction(self._K, self._M) if self._optimality == "A" else information_growth(self._K)
        index = first_best(gain, available)
        self._update(factor, index)
        self._steps += 1
        return index

    def _refresh(self, factor: TriangularFactor) -> None:
        half = project(self._rows, factor.singular_vectors) / factor.singular_values
        self._K = half @ half.swapaxes(1, 2)
        if self._optimality == "A":
            half /= factor.singular_values
            self._M = half @ half.swapaxes(1, 2)

    def _update(self, factor: TriangularFactor, index: int) -> None:
        """Update by ``(G + R^T R)^-1 = G^-1 - B S B^T`` with ``B = G^-1 R^T`` and ``S = (I + R B)^-1``."""
        B = factor.solve(self._rows[index])
        S = np.linalg.inv(np.eye(3) + self._K[index])
        if self._optimality == "D":
            C = project(self._rows, B)
            self._K = self._K - project(C, S) @ C.swapaxes(1, 2)
            return
        both = project(self._rows, np.hstack([B, factor.solve(B.T)]))
        C, E = both[:, :, :3], both[:, :, 3:]
        CS = project(C, S)
        cross = CS @ E.swapaxes(1, 2)
        self._K = self._K - CS @ C.swapaxes(1, 2)
        self._M = self._M - cross - cross.swapaxes(1, 2) + project(CS, B.T @ B) @ CS.swapaxes(1, 2)


def information_growth(K: Array) -> Array:
    """Compute ``det(I + K_i)``, the factor by which a sample raises ``det G``.

    Parameters
    ----------
    K : array, shape (samples, 3, 3)
        ``R_i G^-1 R_i^T``.

    Returns
    -------
    array, shape (samples,)
    """
    return np.asarray(np.linalg.det(np.eye(3) + K))


def variance_reduction(K: Array, M: Array) -> Array:
    """Compute ``trace((I + K_i)^-1 M_i)``, by which a sample lowers ``trace G^-1``.

    Parameters
    ----------
    K, M : array, shape (samples, 3, 3)
        ``R_i G^-1 R_i^T`` and ``R_i G^-2 R_i^T``.

    Returns
    -------
    array, shape (samples,)
    """
    inverse = np.linalg.inv(np.eye(3) + K)
    return np.asarray(np.einsum("nij,nij->n", inverse, M))
