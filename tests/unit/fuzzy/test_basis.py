"""Bases of membership functions: continuity, seams and what is degenerate."""

import re
from pathlib import Path

import numpy as np
import pytest

from cpfls_cli.fuzzy.basis import antecedent, basis, breakpoints, features, input_range, map_input, memberships, seesaw

WEIGHTS = {1: [], 2: [1.0], 3: [2.0, 3.0], 5: [2.0, 1.0, 3.0, 1.5], 7: [1.0, 2.0, 0.7, 1.5, 3.0, 1.2]}
KINDS = [
    (circular, input_map, *consequent)
    for circular in (True, False)
    for input_map in ("full-circle", "data-range")
    for consequent in (
        ("seesaw", 1, "additive"),
        ("seesaw", 1, "tensor"),
        ("harmonic", 1, "additive"),
        ("harmonic", 2, "additive"),
        ("harmonic", 2, "tensor"),
    )
    if circular or consequent[0] == "seesaw"
]
RANGE_DATA = np.linspace(-1.1, 0.9, 50)
CONSEQUENTS = [("seesaw", 1, "additive"), ("harmonic", 1, "additive"), ("harmonic", 2, "tensor")]
PARTITIONS = [breakpoints(np.array([2.0, 1.0, 3.0, 1.5])), breakpoints(np.array([1.0, 4.0, 2.0]))]
EPS = 1e-7
PAGE = (Path(__file__).parents[3] / "docs" / "fuzzy.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


def evaluate(angles, partitions, circular, input_map, consequents, order, products):
    data_range = input_range(RANGE_DATA, circular)
    mapped = [map_input(angle, input_map, circular, data_range) for angle in angles]
    rules = [antecedent(m, b, circular) for m, b in zip(mapped, partitions, strict=True)]
    return basis(rules, features(angles, mapped, consequents, order, products))


def angles_away_from_kinks(inputs):
    """Angles more than 0.001 rad from the corners of the seesaw and from the seams at 0 and pi."""
    angles = np.random.default_rng(1).uniform(-2 * np.pi, 2 * np.pi, (inputs, 300))
    near = np.abs(np.mod(angles + np.pi / 4, np.pi / 2) - np.pi / 4) < 1e-3
    return list(angles[:, ~near.any(axis=0)])


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: "-".join(map(str, kind)))
@pytest.mark.parametrize("functions", [(1,), (2,), (3,), (5,), (7,), (5, 5), (2, 7), (1, 3), (3, 1), (1, 1)], ids=str)
def test_gradient_is_the_derivative_of_the_value(kind, functions):
    angles = angles_away_from_kinks(len(functions))
    partitions = [breakpoints(np.array(WEIGHTS[count])) for count in functions]
    evaluated = evaluate(angles, partitions, *kind)
    assert evaluated.gradient.shape == (len(functions), *evaluated.value.shape)
    step = 1e-6
    for place in range(len(functions)):
        ahead, behind = (
            evaluate([a + s * step * (i == place) for i, a in enumerate(angles)], partitions, *kind).value
            for s in (1, -1)
        )
        # The slope of a membership has corners, where a central difference is off by half a step times the jump.
        np.testing.assert_allclose(evaluated.gradient[place], (ahead - behind) / (2 * step), atol=1e-4)


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


def test_data_range_scales_the_training_data_to_0_and_1_and_what_stands_still_stays_finite():
    training = np.linspace(-0.8, 0.5, 30)
    for circular in (True, False):
        mapped = map_input(training, "data-range", circular, input_range(training, circular))
        np.testing.assert_allclose((mapped.antecedent.min(), mapped.antecedent.max()), (0, 1), atol=1e-14)
        np.testing.assert_array_equal(mapped.consequent, mapped.antecedent)
    still = np.full(5, 0.3)
    mapped = map_input(still, "data-range", True, input_range(still, True))
    np.testing.assert_array_equal(mapped.antecedent, np.zeros(5))


@pytest.mark.parametrize("functions", [2, 3, 5])
def test_all_zero_weights_have_no_breakpoints(functions):
    b = breakpoints(np.zeros(functions - 1))
    assert b.shape == (functions,)
    assert np.isnan(b).all()


@pytest.mark.parametrize("weights", [[0, 1, 1], [1, 0, 1], [1, 1, 0], [0, 0, 1], [0, 1, 0], [1, 0, 0]])
def test_zero_widths_are_finite_steps(weights):
    b = breakpoints(np.array(weights, dtype=float))
    degrees = memberships(np.concatenate([np.linspace(0, 1, 41), b]), b)
    assert np.isfinite(degrees.value).all()
    assert np.isfinite(degrees.slope).all()
    np.testing.assert_allclose(degrees.value.sum(axis=1), 1.0, atol=1e-15)


def test_functions_hold_at_their_ends_and_never_fire_between_two_empty_intervals():
    """b = 0, 1/2, 1/2, 1/2, 1: the middle function has no width on either side."""
    b = breakpoints(np.array([1.0, 0.0, 0.0, 1.0]))
    np.testing.assert_array_equal(memberships(np.setdiff1d(np.linspace(0, 1, 101), [0.5]), b).value[:, 2], 0.0)
    degrees = memberships(np.linspace(-1, 2, 7), breakpoints(np.empty(0)))
    np.testing.assert_array_equal(degrees.value, np.ones((7, 1)))
    np.testing.assert_array_equal(degrees.slope, np.zeros((7, 1)))
    degrees = memberships(np.array([-0.3, 1.3]), np.array([0.0, 0.4, 1.0]))
    np.testing.assert_array_equal(degrees.value, [[1, 0, 0], [0, 0, 1]])
    np.testing.assert_array_equal(degrees.slope, np.zeros((2, 3)))


@pytest.fixture
def names():
    """What a reader of the page has: samples of a periodic function, with noise."""
    rng = np.random.default_rng(0)
    angles = rng.uniform(-np.pi, np.pi, (5000, 2))
    roll, pitch = angles.T
    values = np.sin(roll) * np.cos(pitch) + 0.5 * np.sin(2 * roll + pitch) + 0.2 * np.cos(3 * roll)
    return {"angles": angles, "values": values + 0.01 * rng.standard_normal(5000), "truth": values}


def test_the_three_lines_fit(names):
    assert len([line for line in BLOCKS[0].splitlines() if line.strip()]) == 3
    exec(BLOCKS[0], names)
    np.testing.assert_allclose(names["fitted"], names["truth"], atol=0.03)
    assert np.sqrt(np.mean((names["fitted"] - names["truth"]) ** 2)) < 0.01


def test_the_rest_runs_after_them(names):
    assert len(BLOCKS) > 1
    for block in BLOCKS:
        exec(block, names)
