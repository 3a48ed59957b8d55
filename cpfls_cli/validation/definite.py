"""How surely the inertia matrix of a model is positive definite: in which share of the bootstrap draws it is."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.dynamics.rigid_body import inertia_matrix
from cpfls_cli.identification.model import Model
from cpfls_cli.inertia import INERTIA_PLACES, symmetric
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.regressor.regressor import Regressor
from cpfls_cli.validation.bootstrap import Draws
from cpfls_cli.validation.physical import cell_centres
from cpfls_cli.validation.replay_windows import CLEAR

# Cells times draws at a time: 50 MB for the six entries.
_AT_ONCE = 1_000_000


def definite_share(model: Model, draws: Draws) -> float | None:
    """Count the draws whose D(q) is positive definite at the centres of all cells that training visited.

    Cells within 17 degrees of a vertical pitch are left out, as they are from the windows replayed: there the smallest
    eigenvalue of every body falls with the square of cos(pitch), and all noise is larger.

    Returns
    -------
    float or None
        Share of all draws; None where no such cell was visited.
    """
    attitude = cell_centres(model.visited)
    attitude = attitude[np.abs(np.cos(attitude[:, 1])) >= CLEAR]
    if len(attitude) == 0:
        return None
    parameters = np.hstack([draws.rigid_body, draws.coefficients]).T
    basis, batch = _basis(model, attitude), max(_AT_ONCE // len(attitude), 1)
    starts = range(0, parameters.shape[1], batch)
    definite = [_definite([rows @ parameters[:, s : s + batch] for rows in basis]) for s in starts]
    return float(np.mean(np.concatenate(definite)))


def _basis(model: Model, attitude: Array) -> list[Array]:
    """Rows that give each entry of D(q) from rigid body and coefficients, shape (attitudes, 6 + parameters)."""
    still = Motion(attitude, np.zeros_like(attitude), np.zeros_like(attitude))
    regressor = Regressor(model.structure, still, model.ranges)
    rigid = np.stack([inertia_matrix(attitude, symmetric(unit)) for unit in np.eye(6)], axis=-1)
    fuzzy = {place: np.zeros((len(attitude), len(model.coefficients))) for place in INERTIA_PLACES}
    for index, block in enumerate(model.structure.blocks):
        own = fuzzy[(block.function.row, block.function.column)]
        own[:, block.columns] = regressor.basis(index, model.partitions).value
    return [np.hstack([rigid[:, *place], fuzzy[place]]) for place in INERTIA_PLACES]


def _definite(entries: list[Array]) -> BoolArray:
    """Tell by the leading minors (Sylvester) for each draw, shape (draws,), from entries (attitudes, draws)."""
    of = dict(zip(INERTIA_PLACES, entries, strict=True))
    d11, d22, d33 = (of[(i, i)] for i in range(3))
    d12, d13, d23 = of[(0, 1)], of[(0, 2)], of[(1, 2)]
    minor = d11 * d22 - d12**2
    determinant = d33 * minor - d11 * d23**2 + 2 * d12 * d13 * d23 - d22 * d13**2
    return np.asarray(np.all((d11 > 0) & (minor > 0) & (determinant > 0), axis=0))
