"""The path, the counts of parameters and the table of the vehicle as the paper prints them."""

import numpy as np
import pytest

from cpfls_cli.errors import SettingError
from cpfls_cli.regressor.regressor import Motion, Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.trajectory.planning import plan
from cpfls_cli.trajectory.settings import TrajectorySettings
from cpfls_cli.vehicle.rotors import allocation_matrix, rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings


@pytest.fixture(scope="module", params=[("along-path", [10.662, 9.480]), ("per-axis", [19.864, 17.762])])
def paper_path(request):
    measure, tilt = request.param
    return plan(TrajectorySettings(displacement_measure=measure), 9.81), tilt


def test_size_is_the_papers(paper_path):
    # Table 4: 5487 points at dt = 0.01 s.
    assert len(paper_path[0].time) == 5487
    assert paper_path[0].time[-1] == pytest.approx(54.86, abs=1e-12)


def test_maxima_are_the_papers(paper_path):
    # Section 9: the printed dynamic boundaries of the base trajectory.
    printed = {
        "displacement": 64,
        "velocity": 8,
        "acceleration": 2,
        "jerk": 1,
        "snap": 1,
        "crackle": 2,
        "pop": 2 * np.pi,
    }
    assert paper_path[0].maxima == pytest.approx(printed, rel=1e-12)


def test_largest_roll_and_pitch(paper_path):
    # Pinned because partitions scaled to the data range depend on it; method.md: the path stays within +-20 deg.
    trajectory, tilt = paper_path
    np.testing.assert_allclose(np.degrees(np.abs(trajectory.attitude[:, :2]).max(axis=0)), tilt, atol=1e-3)


PAPER = {"consequents": "seesaw", "products": "additive"}
ADDITIVE = {"consequents": "harmonic", "harmonic_order": 1, "products": "additive"}
TENSOR = {"consequents": "harmonic", "products": "tensor"}


@pytest.mark.parametrize(
    ("settings", "parameters", "genes"),
    [
        ({**PAPER, "membership_functions": 5}, 113, 24),
        # 5 rules per input and 25 for two: 1 + 2 (5 x 2) + 2 (25 x 3).
        ({**PAPER, "membership_functions": 5, "structure": "fls"}, 171, 24),
        ({**ADDITIVE, "membership_functions": 5}, 185, 24),
        ({**ADDITIVE, "membership_functions": 7}, 397, 36),
        ({**ADDITIVE, "membership_functions": 9}, 689, 48),
        ({**TENSOR, "harmonic_order": 1, "membership_functions": 3}, 85, 12),
        ({**TENSOR, "harmonic_order": 2, "membership_functions": 1}, 61, 0),
        # By hand: D13 1x2, D22 2x2, D23 3x4x3, D33 5x6x3.
        ({**PAPER, "membership_functions": (2, 3, 4, 5, 6, 7)}, 1 + 2 + 4 + 36 + 90, 21),
    ],
)
def test_counts(settings, parameters, genes):
    structure = model_structure(StructureSettings(**settings))
    assert (structure.parameters, structure.genes) == (parameters, genes)
    state = np.random.default_rng(0).standard_normal((3, 4, 3))
    regressor = Regressor(structure, Motion(*state), data_ranges(structure, state[0]))
    assert regressor.matrix(uniform_breakpoints(structure)).shape == (4, 3, parameters)


def test_partitions_stand_in_the_order_of_the_genes():
    structure = model_structure(StructureSettings(membership_functions=(2, 3, 4, 5, 6, 7)))
    names = [partition.name for partition in structure.partitions]
    assert names == ["D13(pitch)", "D22(roll)", "D23(roll)", "D23(pitch)", "D33(roll)", "D33(pitch)"]
    assert [part.stop - part.start for part in structure.weight_slices()] == [1, 2, 3, 4, 5, 6]
    stops = [0, *(block.columns.stop for block in structure.blocks)]
    assert [block.columns.start for block in structure.blocks] == stops[:-1]


def test_the_classic_system_has_no_harmonics():
    with pytest.raises(SettingError) as caught:
        StructureSettings(structure="fls", consequents="harmonic")
    assert caught.value.key == "consequents"


# Table 3 of the paper, the vehicle that every default study flies.
GRAVITY, MASS, ARM, K, B = 9.81, 6.0, 0.3, 121.5e-6, 2.7e-6


def test_default_vehicle_is_table_3():
    vehicle = VehicleSettings()
    assert (vehicle.gravity_m_s2, vehicle.mass_kg) == (GRAVITY, MASS)
    assert vehicle.inertia_kg_m2 == (0.6, 0.6, 1.2)
    expected = [
        [K, K, K, K],
        [0, -ARM * K, 0, ARM * K],
        [-ARM * K, 0, ARM * K, 0],
        [-B, B, -B, B],
    ]
    np.testing.assert_allclose(allocation_matrix(vehicle), expected, atol=1e-20)


def test_hover_speed():
    # sqrt(m g / (4 k)), worked by hand.
    demand = rotor_demand(VehicleSettings(), np.array([MASS * GRAVITY]), np.zeros((1, 3)))
    np.testing.assert_allclose(demand.speed, 348.0102, rtol=1e-6)
