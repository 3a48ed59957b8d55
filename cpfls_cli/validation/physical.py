"""Whether a model makes physical sense: whether it is a body wherever training was, and everywhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.dynamics.inertia_functions import CELLS, InertiaFunctions
from cpfls_cli.dynamics.rigid_body import not_positive_definite, vertical
from cpfls_cli.result import about


@dataclass(frozen=True, eq=False)
class Physics:
    """Physical plausibility of a model over the cells of roll and pitch that training visited."""

    cells: int = about("cells of roll and pitch that training visited, those near a pitch of +-90 deg left out")
    indefinite: int = about("of them where D(q) is not positive definite")
    smallest_eigenvalue: float = about(
        "smallest eigenvalue of D(q) over these cells", unit="kg m^2", frame="Euler angles (intrinsic ZYX)", gaps=True
    )
    worst_attitude: Array = about(
        "roll and pitch where it is smallest", "2", unit="rad", frame="Euler angles (intrinsic ZYX)", gaps=True
    )
    indefinite_anywhere: int = about("cells of all roll and pitch where D(q) is not positive definite")
    every_cell: int = about("all cells but those near a pitch of +-90 deg")


def physical_sense(model: InertiaFunctions) -> Physics:
    """Check the plausibility of a model at the cells that training visited, and its D(q) at all cells."""
    attitude, everywhere = cell_centres(model.visited), cell_centres(np.ones_like(model.visited))
    anywhere = int(np.sum(not_positive_definite(model.inertia(everywhere).value, everywhere)))
    if len(attitude) == 0:
        return Physics(0, 0, float("nan"), np.full(2, np.nan), anywhere, len(everywhere))
    values = model.inertia(attitude).value
    smallest = np.linalg.eigvalsh(values)[:, 0]
    worst = int(np.argmin(smallest))
    return Physics(
        cells=len(attitude),
        indefinite=int(np.sum(not_positive_definite(values, attitude))),
        smallest_eigenvalue=float(smallest[worst]),
        worst_attitude=attitude[worst, :2],
        indefinite_anywhere=anywhere,
        every_cell=len(everywhere),
    )


def cell_centres(visited: BoolArray) -> Array:
    """Compute the attitudes, rad, yaw 0, at the centres of visited cells but those near a pitch of +-90 degrees.

    Roll is along the first axis of the cells, from -180 degrees.
    """
    roll, pitch = np.nonzero(visited)
    centres = (np.stack([roll, pitch, np.zeros_like(roll)], axis=1) + 0.5) * (2 * np.pi / CELLS) - np.pi
    attitude = centres * [1.0, 1.0, 0.0]
    return np.asarray(attitude[~vertical(attitude)])
