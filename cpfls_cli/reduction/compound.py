"""A compound design criterion: the condition number, made smooth, beside the information kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array

# The six different elements of a symmetric 3 x 3 matrix, and where in it each of them stands.
_ELEMENTS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
_PLACES = (0, 1, 2, 1, 3, 4, 2, 4, 5)
# A sample may be all that holds a direction; I - K is then singular.
_SMALLEST_REST = 1e-9


@dataclass(frozen=True)
class Compound:
    """``log (trace G^p)^(1/p) + log (trace G^-p)^(1/p) - w log (det G)^(1/columns)``, to be made small.

    The first two terms lie above ``log(lambda_max / lambda_min)`` by at most ``(2/p) log(columns)`` (K-optimality).
    Alone they are also lowered by leaving out the samples that say most; the third (D-optimality) is the price of that.

    Attributes
    ----------
    power : float
        The exponent p: 1 weighs all directions, more weighs the extreme ones.
    information : float
        The weight w.

    References
    ----------
    Ye, Zhou 2013: Minimizing the condition number to construct design points for polynomial regression models. Cook,
    Wong 1994: On the equivalence of constrained and compound optimal designs.
    """

    power: float
    information: float

    def value(self, eigenvalues: Array) -> float:
        """Compute the criterion from the positive eigenvalues of G, array of shape (columns,), ascending."""
        low, high = eigenvalues[0], eigenvalues[-1]
        sums = np.sum((eigenvalues / low) ** -self.power) * np.sum((eigenvalues / high) ** self.power)
        smooth = np.log(sums) / self.power + np.log(high / low)
        return float(smooth - self.information * np.mean(np.log(eigenvalues)))

    def merits(self, rows: Array, eigenvalues: Array, vectors: Array, *, chosen: bool) -> Array:
        """Estimate by how much each sample lowers the criterion.

        With ``K = R G^-1 R^T`` the estimate is ``trace((I +- K)^-1 R G^-(p+1) R^T) / trace G^-p - trace(R G^(p-1)
        R^T) / trace G^p +- w/columns log det(I +- K)``: plus for a sample to add, minus for one that is in. Its first
        order is the derivative. The last term is exact, the first at p = 1: its inverse keeps a sample from being
        credited with more than its three rows can do.

        Parameters
        ----------
        rows : array, shape (samples, 3, columns)
        eigenvalues : array, shape (columns,), ascending
            Of the chosen samples' Gram matrix G.
        vectors : array, shape (columns, columns)
            Its eigenvectors.
        chosen : bool
            Whether these samples are in G.

        Returns
        -------
        array, shape (samples,)
        """
        low = (eigenvalues / eigenvalues[0]) ** -self.power
        high = (eigenvalues / eigenvalues[-1]) ** self.power
        whitened = (rows.reshape(-1, rows.shape[2]) @ (vectors / np.sqrt(eigenvalues))).reshape(rows.shape)
        weights = np.stack([np.ones_like(low), low / low.sum(), high / high.sum()], axis=1)
        elements = np.stack([(whitened[:, i] * whitened[:, j]) @ weights for i, j in _ELEMENTS], axis=1)
        K, M, loss = (elements[:, _PLACES, k].reshape(-1, 3, 3) for k in range(3))
        sign = -1.0 if chosen else 1.0
        rest = (1.0 + _SMALLEST_REST) * np.eye(3) + sign * K
        gain = np.einsum("nij,nji->n", np.linalg.inv(rest), M) - np.einsum("nii->n", loss)
        return np.asarray(gain + sign * self.information / len(eigenvalues) * np.log(np.linalg.det(rest)))
