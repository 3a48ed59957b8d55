"""Print what the paper's structure misses on the full circle, and how much of it no flight can mend.

    python benchmarks/full_circle_limit.py

Partitions are searched for and chosen on three random flights kept for it; eight others judge: largest error over
largest torque of the worst axis, median (worst), and root mean square of the error over that of the torque. Random
states excite everything, so what remains after them is the structure's own. The second table takes the model of 24000
random states apart: the error of each function of the inertia matrix, and of its slopes, over the whole circle, as a
share of its own root mean square; beside it that of the same rules with sines and cosines for seesaws.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np

from benchmarks.shared.full_circle import (
    INERTIA,
    PAPER,
    judged,
    optimised_flight,
    random_flight,
    random_states,
    searched,
)
from benchmarks.shared.studies import paper_flight
from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.inertia_functions import InertiaFunctions
from cpfls_cli.dynamics.rigid_body import inertia_matrix, inertia_matrix_gradient
from cpfls_cli.identification.data import joined
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor.structure import INERTIA_FUNCTIONS

ERRORS = ("uniform", "searched", "rms, uniform", "rms, searched")
SEARCH = {"base": "none", "population": 20, "generations": 6}
SEESAW = IdentificationSettings(**vars(PAPER), **SEARCH)
HARMONIC = IdentificationSettings(**{**vars(PAPER), "consequents": "harmonic", "harmonic_order": 1}, **SEARCH)


def main() -> None:
    kept = joined([random_flight(seed) for seed in range(200, 203)])
    unseen = [random_flight(seed) for seed in range(100, 108)]
    trainings = {
        "the paper's path": paper_flight(),
        "random full rotations, 55 s": random_flight(1),
        "optimised full rotations, 55 s": optimised_flight(PAPER),
        "random full rotations, 220 s": joined([random_flight(seed) for seed in range(1, 5)]),
        "6000 random states": random_states(1),
        "24000 random states": random_states(2, 24000),
    }
    rows = []
    for name, training in trainings.items():
        found = searched(training, SEESAW, kept)
        errors = [judged(solved.model.torque, unseen) for solved in (found.uniform, found.held_out)]
        system = (found.uniform.rank, found.uniform.condition_number)
        rows.append((name, *system, *map(str, errors), errors[0].rms, errors[1].rms))
    columns = (
        "learned from",
        "rank of 113",
        "condition number",
        "uniform",
        "searched",
        "rms, uniform",
        "rms, searched",
    )
    table("full_circle_limit", columns, rows)
    print()
    models = (found.held_out.model, searched(training, HARMONIC, kept).held_out.model)
    shares = [shape_errors(model) for model in models]
    names = [function.name for function in INERTIA_FUNCTIONS]
    by_function = [(name, *shares[0][name], *shares[1][name]) for name in names]
    table("full_circle_functions", ("function", "seesaw", "its slopes", "harmonic", "their slopes"), by_function)


def shape_errors(model: InertiaFunctions) -> dict[str, tuple[float, float]]:
    """Error of each inertia function and of its slopes by roll and pitch, as shares of their root mean squares."""
    turn = np.linspace(0, 2 * np.pi, 200, endpoint=False) + 0.01
    roll, pitch = np.meshgrid(turn, turn)
    attitude = np.column_stack([roll.ravel(), pitch.ravel(), np.zeros(roll.size)])
    found = model.inertia(attitude)
    value, gradient = inertia_matrix(attitude, INERTIA), inertia_matrix_gradient(attitude, INERTIA)
    return {
        f.name: (
            share(found.value[:, f.row, f.column], value[:, f.row, f.column]),
            share(found.gradient[:, :, f.row, f.column], gradient[:, :, f.row, f.column]),
        )
        for f in INERTIA_FUNCTIONS
    }


def share(found: Array, true: Array) -> float:
    """Root mean square of the error over that of the truth; 0 where there is nothing to find."""
    size = float(np.sqrt(np.mean(true**2)))
    return float(np.sqrt(np.mean((found - true) ** 2))) / size if size > 0 else 0.0


if __name__ == "__main__":
    main()
