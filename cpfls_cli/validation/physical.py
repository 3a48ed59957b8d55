"""Whether a model makes sense beside the data: a body wherever training was, and the same one period away."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.dynamics.equations_of_motion import coriolis_matrix
from cpfls_cli.dynamics.inertia_functions import CELLS, InertiaFunctions
from cpfls_cli.dynamics.rigid_body import not_positive_definite, vertical
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.judge import score_of
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.regressor.regressor import InertiaValues
from cpfls_cli.result import about

_AWAY = 2 * np.pi * np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Physics:
    """Physical plausibility of a model over the cells of roll and pitch that training visited.

    Torque that is D and C does work on kinetic energy alone: its energy is rounding for every model with Christoffel
    symbols.
    """

    cells: int = about("cells of roll and pitch that training visited, those near a pitch of +-90 deg left out")
    indefinite: int = about("of them where D(q) is not positive definite")
    smallest_eigenvalue: float = about(
        "smallest eigenvalue of D(q) over these cells", unit="kg m^2", frame="Euler angles (intrinsic ZYX)", gaps=True
    )
    worst_attitude: Array = about(
        "roll and pitch where it is smallest", "2", unit="rad", frame="Euler angles (intrinsic ZYX)", gaps=True
    )
    energy: float = about("largest size of qd^T (dD/dt - 2 C) qd over its own terms: rounding")
    indefinite_anywhere: int = about("cells of all roll and pitch where D(q) is not positive definite")
    every_cell: int = about("all cells but those near a pitch of +-90 deg")


def physical_sense(model: InertiaFunctions, rng: np.random.Generator) -> Physics:
    """Check the plausibility of a model at the cells that training visited, and its D(q) at all cells.

    An attitude rate is drawn for every cell. Spong, Hutchinson and Vidyasagar, Robot Modeling and Control, section 6.5
    (skew symmetry, passivity).
    """
    attitude, everywhere = cell_centres(model.visited), cell_centres(np.ones_like(model.visited))
    anywhere = int(np.sum(not_positive_definite(model.inertia(everywhere).value, everywhere)))
    if len(attitude) == 0:
        return Physics(0, 0, float("nan"), np.full(2, np.nan), 0.0, anywhere, len(everywhere))
    values, rate = model.inertia(attitude), rng.standard_normal(attitude.shape)
    smallest = np.linalg.eigvalsh(values.value)[:, 0]
    worst = int(np.argmin(smallest))
    return Physics(
        cells=len(attitude),
        indefinite=int(np.sum(not_positive_definite(values.value, attitude))),
        smallest_eigenvalue=float(smallest[worst]),
        worst_attitude=attitude[worst, :2],
        energy=energy_share(values, coriolis_matrix(values, rate), rate),
        indefinite_anywhere=anywhere,
        every_cell=len(everywhere),
    )


def energy_share(values: InertiaValues, coriolis: Array, rate: Array) -> float:
    """Compute the largest power of ``dD/dt - 2 C`` relative to the sizes of its terms; 0 where no term is."""
    along = np.einsum("nkij,nk->nij", values.gradient, rate)
    outer = rate[:, :, None] * rate[:, None, :]
    terms = np.stack([along * outer, -2.0 * coriolis * outer], axis=1)
    power, size = np.abs(np.sum(terms, axis=(1, 2, 3))), np.sum(np.abs(terms), axis=(1, 2, 3))
    return float(np.max(power / np.where(size > 0, size, 1.0)))


def cell_centres(visited: BoolArray) -> Array:
    """Compute the attitudes, rad, yaw 0, at the centres of visited cells but those near a pitch of +-90 degrees.

    Roll is along the first axis of the cells, from -180 degrees.
    """
    roll, pitch = np.nonzero(visited)
    centres = (np.stack([roll, pitch, np.zeros_like(roll)], axis=1) + 0.5) * (2 * np.pi / CELLS) - np.pi
    attitude = centres * [1.0, 1.0, 0.0]
    return np.asarray(attitude[~vertical(attitude)])


@dataclass(frozen=True, eq=False)
class PeriodErrors:
    """Torque errors one period away, the worse of one turn in roll and one turn back in pitch."""

    parts: tuple[str, ...] = about("parts judged one period (2 pi in roll and pitch) away", "period_part")
    mse: Array = about(
        "mean squared torque error there", "period_part", "axis", unit="(N m)^2", frame="Euler angles (intrinsic ZYX)"
    )
    max_error: Array = about(
        "largest torque error there", "period_part", "axis", unit="N m", frame="Euler angles (intrinsic ZYX)"
    )


def one_period_away(model: InertiaFunctions, parts: Mapping[str, TorqueSource]) -> PeriodErrors | None:
    """Compute the errors of a model with roll one turn on, and with pitch one turn back, against the same torque.

    None where the inputs of the model are not those of the full circle.
    """
    if model.structure.settings.input_map != "full-circle":
        return None

    def away(shift: Array) -> Callable[[Motion], Array]:
        return lambda motion: model.torque(replace(motion, attitude=motion.attitude + shift))

    scores = [[score_of(data, away(shift)) for shift in _AWAY] for data in parts.values()]
    return PeriodErrors(
        parts=tuple(parts),
        mse=np.max([[score.mse for score in both] for both in scores], axis=1),
        max_error=np.max([[score.max_error for score in both] for both in scores], axis=1),
    )
