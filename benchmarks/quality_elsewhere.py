"""Whether searches rank alike on a problem that no setting was chosen on: another flight, other rules.

    python benchmarks/quality_elsewhere.py [SEEDS]

It needs the ``bench`` extra. The path that is otherwise held out, harmonic consequents, 4 membership functions, every
eighth sample.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np

from benchmarks.shared.searches import Search, searches, spent
from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import Study
from cpfls_cli.dynamics.rigid_body import inertia_tensor, newton_euler_torque
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.evaluator import Evaluator
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.trajectory.planning import plan

CONFIG = Path(__file__).resolve().parents[1] / "configs" / "paper-gentle.yaml"
CHANGES = (
    "trajectory.path=straight",
    "trajectory.direction=[1.0, -0.6, 0.2]",
    "trajectory.displacement_m=50.0",
    "trajectory.yaw_turn_rad=-6.283185307179586",
    "identification.consequents=harmonic",
    "identification.membership_functions=4",
    "identification.population=75",
    "identification.start=random",
)
COUNTS = (100, 300, 600)


def main(seeds: int) -> None:
    study = load_study(CONFIG, CHANGES)
    flight = flown(study)
    evaluator = model_evaluator(flight, flight[np.arange(0, len(flight), 8)], study.identification)
    print("Best mean squared error, N^2 m^2: median (range) over seeds\n")
    compared = searches(study.identification, IdentificationSettings())
    rows = [(name, *reached(search, evaluator, range(1, seeds + 1))) for name, search in compared.items()]
    table("quality_elsewhere", ("search", *(f"{count} evaluations" for count in COUNTS)), rows)


def flown(study: Study) -> TorqueData:
    path = plan(study.trajectory, gravity=study.vehicle.gravity_m_s2)
    motion = Motion(path.attitude, path.attitude_rate, path.attitude_acceleration)
    return TorqueData(path.time, motion, newton_euler_torque(*vars(motion).values(), inertia_tensor(study.vehicle)))


def reached(search: Search, evaluator: Evaluator, seeds: range) -> list[str]:
    courses = [spent(search, evaluator, seed, max(COUNTS)) for seed in seeds]
    best = np.array([np.minimum.accumulate(np.array(course.objectives)[:, 0]) for course in courses])
    at = best[:, np.array(COUNTS) - 1]
    return [f"{np.median(one):.3g} ({one.min():.3g} to {one.max():.3g})" for one in at.T]


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
