import numpy as np
import pytest

from cpfls_cli.excitation.conditioning import condition_number, conditioning
from cpfls_cli.regressor import StructureSettings, model_structure
from cpfls_cli.trajectory.rotation import RotationPath


def gram(seed=0):
    rows = np.random.default_rng(seed).standard_normal((20, 6))
    return rows.T @ rows


def test_smoothed_value_falls_to_the_logarithm_of_the_condition_number():
    G = gram()
    exact = 0.5 * np.log(np.linalg.cond(G))
    values = [conditioning(G, exponent).smoothed for exponent in (1.0, 4.0, 16.0, 256.0)]
    assert values == sorted(values, reverse=True)
    assert values[-1] == pytest.approx(exact, abs=1e-2)
    assert values[-1] >= exact


def test_exponent_one_is_the_product_of_traces():
    G = gram()
    expected = 0.5 * np.log(np.trace(G) * np.trace(np.linalg.inv(G)))
    assert conditioning(G, 1.0).smoothed == pytest.approx(expected)


@pytest.mark.parametrize("exponent", [1.0, 4.0])
def test_slope_is_that_of_differences(exponent):
    G, step = gram(), 1e-6
    change = gram(seed=1)
    values = [conditioning(G + sign * step * change, exponent).smoothed for sign in (1, -1)]
    slope = np.sum(conditioning(G, exponent).slope * change)
    assert slope == pytest.approx((values[0] - values[1]) / (2 * step), rel=1e-6)


def test_a_path_without_pitch_excites_no_rule_of_pitch():
    sine, cosine = np.random.default_rng(0).standard_normal((2, 3, 4))
    sine[1] = cosine[1] = 0.0
    structure = model_structure(StructureSettings())
    path = RotationPath(np.zeros(3), np.array([1, 0, 1]), sine, cosine, 20.0)
    assert condition_number(path, structure, 400) > 1e14
