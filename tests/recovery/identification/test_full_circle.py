"""Rigid bodies come back from flights of full rotations, and from no path that stays near hover."""

import numpy as np
import pytest

from cpfls_cli.dynamics import newton_euler_torque
from cpfls_cli.excitation import optimised_rotation
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.identify import identify
from cpfls_cli.identification.settings import IdentificationSettings, LocalSearchSettings
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.regressor.structure import StructureSettings
from cpfls_cli.trajectory.planning import plan
from cpfls_cli.trajectory.rotation import full_rotation
from cpfls_cli.trajectory.settings import RotationSettings, TrajectorySettings
from cpfls_cli.vehicle.settings import VehicleSettings

INERTIA = [0.6, 0.8, 1.2]
DURATION, SAMPLES = 20.0, 800
EXACT = {"harmonic_order": 2, "products": "tensor", "membership_functions": 1, "base": "none"}
PAPER = {"consequents": "seesaw", "products": "additive", "membership_functions": 5, "base": "none"}
UNSEARCHED = {"population": 2, "generations": 0, "local_search": LocalSearchSettings(enabled=False)}


def driven(motion, inertia=INERTIA):
    torque = newton_euler_torque(*vars(motion).values(), symmetric(inertia))
    return TorqueData(0.01 * np.arange(len(motion)), motion, torque)


def flown(path, inertia=INERTIA):
    return driven(Motion(*vars(path.sample(path.times(SAMPLES))).values()), inertia)


def rotations(seed, inertia=INERTIA):
    return flown(full_rotation(RotationSettings(), DURATION, np.random.default_rng(seed)), inertia)


def near_hover():
    """The paper's training path, which never leaves 20 degrees."""
    path = plan(TrajectorySettings(sample_time_s=0.1), gravity=9.81)
    return driven(Motion(path.attitude, path.attitude_rate, path.attitude_acceleration))


def identified(training, structure, **parts):
    settings = IdentificationSettings(**structure, **UNSEARCHED)
    return identify(training, training, parts, settings, np.random.default_rng(1))


@pytest.mark.parametrize("seed", range(3))
def test_one_rule_of_harmonics_is_exact_on_any_other_flight(seed):
    inertia = [*np.random.default_rng(seed).uniform(0.5, 1.5, 3), 0.0, 0.0, 0.0]
    found = identified(rotations(seed, inertia), EXACT, other=rotations(50 + seed, inertia))
    assert (found.system.rank, found.system.parameters) == (61, 61)
    assert found.scores["other"]["model"].worst_relative_error < 1e-8


def test_products_of_inertia_are_beyond_a_structure_without_d12():
    """Equation (15) has no D12: where Ixy is not zero, only a rigid body underneath has it."""
    inertia = [0.6, 0.8, 1.2, 0.1, 0.0, 0.05]
    training, other = rotations(1, inertia), rotations(51, inertia)
    alone = identified(training, EXACT, other=other).scores["other"]
    over = identified(training, {**EXACT, "base": "rigid-body"}, other=other).scores["other"]
    assert alone["model"].worst_relative_error > 0.05
    assert over["model"].worst_relative_error < 1e-8


def test_on_a_path_optimised_for_it_the_model_is_very_well_conditioned():
    structure, vehicle = StructureSettings(), VehicleSettings()
    rng, settings = np.random.default_rng(1), RotationSettings(starts=2, iterations=30)
    path = optimised_rotation(settings, DURATION, structure, vehicle, rng).path
    assert identified(flown(path), EXACT).system.condition_number < 5


@pytest.fixture(scope="module")
def learned():
    """Both structures, learned from both paths, judged on one more flight of rotations."""
    trainings = {"near hover": near_hover(), "rotations": rotations(1)}
    structures = {"paper": PAPER, "exact": EXACT}
    other = rotations(51)
    return {
        (path, name): identified(training, structure, other=other)
        for path, training in trainings.items()
        for name, structure in structures.items()
    }


def test_the_paper_s_structure_has_full_rank_on_rotations_and_half_of_it_near_hover(learned):
    assert learned["rotations", "paper"].system.rank == 113
    assert 50 < learned["near hover", "paper"].system.rank < 65


@pytest.mark.parametrize("structure", ["paper", "exact"])
def test_what_is_learned_near_hover_does_not_hold_on_the_circle(learned, structure):
    near, far = (learned[path, structure].scores["other"] for path in ("near hover", "rotations"))
    assert near["model"].worst_relative_error > 3 * far["model"].worst_relative_error
    assert near["rigid-body"].worst_relative_error < 1e-8
