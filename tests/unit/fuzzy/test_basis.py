"""Gradients of every kind of fuzzy basis against finite differences."""

import numpy as np
import pytest

from cpfls_cli.fuzzy.basis import antecedent, basis, breakpoints, features, input_range, map_input

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
