"""Print what models of the paper's vehicle miss on a path unlike the one that they learned from.

    python benchmarks/unseen_path.py

The unseen path is that of `make reproduce`: straight along another direction, yaw the other way round; beside it stand
random flights of full rotations, the median of eight. Errors are the largest error over the largest torque of the worst
axis: of equidistant partitions, of a genetic algorithm, and of its member that is best on a flight kept for the choice.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np

from benchmarks.shared.full_circle import (
    INERTIA,
    PAPER,
    Solved,
    judged,
    optimised_flight,
    random_flight,
    searched,
    torque_data,
    uniform_model,
)
from benchmarks.shared.studies import paper_flight, paper_study
from cpfls_cli.arrays import Array
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.judge import fit_baselines
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.trajectory.planning import plan

UNSEEN = {"path": "straight", "direction": (1.0, -0.6, 0.2), "displacement_m": 50.0, "yaw_turn_rad": -2 * np.pi}
SEARCH = {"base": "none", "population": 30, "generations": 10}
KINDS = ("uniform", "genetic", "held-out")
ERRORS = [f"{part}: {kind}" for part in ("unseen", "rotations") for kind in KINDS]
COLUMNS = ("training path", "model", "rank", "condition number", *ERRORS)
Parts = Sequence[Sequence[TorqueData]]
STRUCTURES = {
    "seesaw, 5 functions, data-range": {**vars(PAPER), "input_map": "data-range"},
    "seesaw, 5 functions, full-circle": vars(PAPER),
    "harmonic 2 tensor, 1 function": {},
}


def main() -> None:
    paper = paper_flight()
    rotations, kept = optimised_flight(PAPER), random_flight(200)
    parts = ([unseen_flight()], [random_flight(seed) for seed in range(100, 108)])
    rows = []
    for path, training in {"the paper's": paper, "full rotations, optimised": rotations}.items():
        for name, keys in STRUCTURES.items():
            found = searched(training, IdentificationSettings(**{**keys, **SEARCH}), kept)
            shown = (found.uniform, found.by_objectives, found.held_out)
            rows.append((path, name, *row(shown if found.evaluations > 1 else shown[:1], parts)))
        over_rigid_body = uniform_model(training, IdentificationSettings(base="rigid-body"))
        rows.append((path, "harmonic 2 tensor over a rigid body", *row((over_rigid_body,), parts)))
        rows += [
            (path, baseline.name, "", "", *errors([baseline.torque], parts))
            for baseline in fit_baselines(training, np.ones(3), 1e-9)[:2]
        ]
    table("unseen_path", COLUMNS, rows)


def unseen_flight() -> TorqueData:
    study = paper_study()
    path = plan(replace(study.trajectory, **UNSEEN), study.vehicle.gravity_m_s2)
    return torque_data(Motion(path.attitude, path.attitude_rate, path.attitude_acceleration), INERTIA)


def row(models: tuple[Solved, ...], parts: Parts) -> tuple[str, ...]:
    first = models[0]
    system = f"{first.rank} of {first.model.structure.parameters}", f"{first.condition_number:.3g}"
    return *system, *errors([solved.model.torque for solved in models], parts)


def errors(torques: Sequence[Callable[[Motion], Array]], parts: Parts) -> list[str]:
    """Errors of up to three models on each part, the median over its flights."""
    return [
        f"{np.median(judged(torques[number], part).largest):.2g}" if number < len(torques) else ""
        for part in parts
        for number in range(len(KINDS))
    ]


if __name__ == "__main__":
    main()
