"""Equation (12): periodic and continuous across the seam, which the classic system is not."""

import numpy as np
import pytest

from cpfls_cli.fuzzy.basis import antecedent, basis, breakpoints, features, input_range, map_input, seesaw

CONSEQUENTS = [("seesaw", 1, "additive"), ("harmonic", 1, "additive"), ("harmonic", 2, "tensor")]
PARTITIONS = [breakpoints(np.array([2.0, 1.0, 3.0, 1.5])), breakpoints(np.array([1.0, 4.0, 2.0]))]
EPS = 1e-7


def output(roll, pitch, circular, consequent, input_map="full-circle"):
    """A system of two inputs with random coefficients."""
    angles = [np.asarray(roll, dtype=float), np.asarray(pitch, dtype=float)]
    mapped = [map_input(a, input_map, circular, input_range(np.linspace(-1, 0.7), circular)) for a in angles]
    rules = [antecedent(m, b, circular) for m, b in zip(mapped, PARTITIONS, strict=True)]
    value = basis(rules, features(angles, mapped, *consequent)).value
    return value @ np.random.default_rng(5).standard_normal(value.shape[1])


def jump(place, circular, consequent):
    """Largest change over 2 EPS around an angle, in either input, anywhere along the other."""
    other = np.linspace(-3, 3, 50)
    sides = [np.full_like(other, place + s * EPS) for s in (-1, 1)]
    changes = [output(*pair, circular, consequent) for s in sides for pair in ((s, other), (other, s))]
    return max(np.abs(changes[0] - changes[2]).max(), np.abs(changes[1] - changes[3]).max())


@pytest.mark.parametrize("input_map", ["full-circle", "data-range"])
@pytest.mark.parametrize("consequent", CONSEQUENTS, ids=str)
@pytest.mark.parametrize("turns", [-3, -1, 1, 4])
def test_periodic(consequent, turns, input_map):
    roll, pitch = np.random.default_rng(2).uniform(-3.1, 3.1, (2, 200))
    once = output(roll, pitch, True, consequent, input_map)
    for shift in ((turns, 0), (0, turns), (turns, -turns)):
        again = output(roll + 2 * np.pi * shift[0], pitch + 2 * np.pi * shift[1], True, consequent, input_map)
        np.testing.assert_allclose(again, once, atol=1e-11)


@pytest.mark.parametrize("consequent", CONSEQUENTS, ids=str)
@pytest.mark.parametrize("place", [0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi, 2 * np.pi, -np.pi])
def test_continuous_where_the_input_folds_or_closes(place, consequent):
    # The slopes of this system are of order 10, so 2 EPS of angle may change the output by some 1e-6.
    assert jump(place, True, consequent) < 1e-5


@pytest.mark.parametrize("place", [-np.pi, np.pi, 3 * np.pi])
def test_classic_system_jumps_at_the_seam(place):
    assert jump(place, False, ("seesaw", 1, "additive")) > 0.1


@pytest.mark.parametrize("place", [0.0, 0.5 * np.pi, 2 * np.pi])
def test_classic_system_is_continuous_at_hover(place):
    assert jump(place, False, ("seesaw", 1, "additive")) < 1e-5


def test_seesaw_of_equation_11():
    angle = np.array([0, 0.25, 0.5, 0.75, 1, 1.25, 1.5, 1.75, 2, -0.25, 4.5]) * np.pi
    np.testing.assert_allclose(seesaw(angle)[0], [0, 0.5, 1, 0.5, 0, -0.5, -1, -0.5, 0, -0.5, 1], atol=1e-14)


def test_data_range_scales_the_training_data_to_0_and_1():
    training = np.linspace(-0.8, 0.5, 30)
    for circular in (True, False):
        mapped = map_input(training, "data-range", circular, input_range(training, circular))
        np.testing.assert_allclose((mapped.antecedent.min(), mapped.antecedent.max()), (0, 1), atol=1e-14)
        np.testing.assert_array_equal(mapped.consequent, mapped.antecedent)


def test_data_that_do_not_move_stay_finite():
    still = np.full(5, 0.3)
    mapped = map_input(still, "data-range", True, input_range(still, True))
    np.testing.assert_array_equal(mapped.antecedent, np.zeros(5))
