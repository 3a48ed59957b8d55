"""What the data visited, and which rules they never fired."""

import numpy as np

from cpfls_cli.dynamics import outside_visited, visited_cells
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.findings import rule_excitation
from cpfls_cli.identification.samples import Ready, Samples
from cpfls_cli.regressor.regressor import Motion, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure

DEGREE = np.pi / 180


def at(roll, pitch):
    return np.array([[roll * DEGREE, pitch * DEGREE, 0.3]])


def test_visited_cell_and_its_neighbours_count_as_inside():
    visited = visited_cells([at(12, -3)])
    assert visited.sum() == 9
    assert not outside_visited(visited, at(12, -3))
    assert not outside_visited(visited, at(17, -8))
    assert outside_visited(visited, at(22, -3))
    assert outside_visited(visited, at(12, 6))


def test_cells_wrap_at_half_a_turn():
    visited = visited_cells([at(179, 0)])
    for roll in (-179, 179, 181, 179 - 360, 174):
        assert not outside_visited(visited, at(roll, 0))
    assert outside_visited(visited, at(-174, 0))
    edges = np.array([[np.pi, -np.pi, 0.0], [-np.pi, np.pi, 0.0], [np.nextafter(-np.pi, -4), 0.0, 0.0]])
    assert not outside_visited(visited_cells([edges]), edges).any()


def excitation(attitude, noise=0.0, **settings):
    rng = np.random.default_rng(15)
    motion = Motion(attitude, rng.standard_normal(attitude.shape), rng.standard_normal(attitude.shape))
    structure = model_structure(StructureSettings(consequents="seesaw", products="additive", **settings))
    data = TorqueData(0.01 * np.arange(len(motion)), motion, np.zeros_like(attitude))
    samples = Samples.of(Ready(data, rigid=False), structure, data_ranges(structure, attitude))
    return rule_excitation(samples, uniform_breakpoints(structure), noise, 0.5, 1e-10)


def test_rules_that_never_fire_are_named():
    """Angles within a quarter turn on either side of zero never reach the function at pi (rule 3 of 4)."""
    attitude = np.random.default_rng(16).uniform(-1.5, 1.5, (400, 3))
    found = excitation(attitude, membership_functions=5)
    silent = {name for name, excited in zip(found.name, found.excited, strict=True) if not excited}
    third_by_third = {
        f"{name} rule {4 * i + j + 1}" for name in ("D23", "D33") for i in range(4) for j in range(4) if 2 in (i, j)
    }
    assert silent == {"D13 rule 3", "D22 rule 3"} | third_by_third
    never = [name for name, strength in zip(found.name, found.firing, strict=True) if strength == 0]
    assert set(never) == silent


def test_every_rule_is_excited_on_the_full_circle():
    attitude = np.random.default_rng(16).uniform(-np.pi, np.pi, (2000, 3))
    found = excitation(attitude, membership_functions=5)
    assert len(found.name) == 1 + 4 + 4 + 16 + 16
    assert found.excited.all()
    np.testing.assert_allclose(found.determined, 1.0, atol=1e-9)


def test_one_sample_determines_three_directions():
    found = excitation(np.array([[0.4, -0.6, 1.0]]), membership_functions=3)
    structure = model_structure(StructureSettings(consequents="seesaw", products="additive", membership_functions=3))
    features = np.concatenate([np.full(block.rules, block.features) for block in structure.blocks])
    np.testing.assert_allclose(found.determined @ features, 3.0)


def test_noise_leaves_fewer_directions_determined():
    """A direction counts where noise moves its coefficient by less than the inertia."""
    attitude = np.random.default_rng(16).uniform(-3.1, 3.1, (400, 3))
    quiet, loud, deafening = (excitation(attitude, noise, membership_functions=5) for noise in (0.01, 2.0, 1e6))
    assert quiet.excited.all()
    assert loud.determined.sum() < quiet.determined.sum()
    assert not deafening.excited.any()
    assert np.all(deafening.determined == 0)
