"""The paper's study on its gentle path in memory: its flight, and the samples worth learning from."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import Study
from cpfls_cli.dynamics import newton_euler_torque
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.regressor import Motion, Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import model_structure
from cpfls_cli.trajectory.planning import plan
from tests.builders.reductions import reduce

CONFIG = Path(__file__).resolve().parents[2] / "configs" / "paper-gentle.yaml"


@lru_cache
def paper_study() -> Study:
    return load_study(CONFIG)


@lru_cache
def paper_flight() -> TorqueData:
    """Fly the paper's training path: 5487 samples, free of noise."""
    study = paper_study()
    path = plan(study.trajectory, gravity=study.vehicle.gravity_m_s2)
    motion = Motion(path.attitude, path.attitude_rate, path.attitude_acceleration)
    return TorqueData(
        path.time, motion, newton_euler_torque(*vars(motion).values(), symmetric(study.vehicle.inertia_kg_m2))
    )


@lru_cache
def paper_selection() -> TorqueData:
    """Select the study's 685 samples."""
    selection = reduce(regressor_matrix(paper_flight().motion), paper_study().reduction)
    return paper_flight()[np.sort(selection.indices)]


def regressor_matrix(motion: Motion) -> Array:
    """Build the regressor at uniform partitions, which the reduction works on."""
    structure = model_structure(paper_study().identification)
    ranges = data_ranges(structure, motion.attitude)
    return Regressor(structure, motion, ranges).matrix(uniform_breakpoints(structure))
