import numpy as np
import pytest

from cpfls_cli.excitation import (
    adam,
    condition_number,
    conditioning,
    conditioning_gradient,
    design,
    path_of,
    penalty_gradient,
    regressor_of,
    variables_of,
)
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.trajectory.rotation import RotationLimits, RotationPath, full_rotation
from cpfls_cli.trajectory.settings import RotationSettings

# A low order of the harmonics keeps the curvature over the step in attitude small.
STRUCTURE = model_structure(StructureSettings(harmonic_order=1))


def drawn():
    return full_rotation(RotationSettings(), 10.0, np.random.default_rng(2))


def test_design_variables_give_the_path_back():
    path = drawn()
    again = path_of(variables_of(path), path)
    for name in ("start", "turns", "sine", "cosine"):
        np.testing.assert_allclose(getattr(again, name), getattr(path, name), rtol=1e-14)


def test_the_motion_of_the_design_is_that_of_the_path():
    path = drawn()
    times, sampled = path.times(30), path.sample(path.times(30))
    motion = design(path, times).motion(variables_of(path))
    expected = [sampled.attitude, sampled.attitude_rate, sampled.attitude_acceleration]
    np.testing.assert_allclose(motion, expected, atol=1e-12)


def smoothed(variables, path, times):
    rows = regressor_of(STRUCTURE, design(path, times).motion(variables)).reshape(-1, STRUCTURE.parameters)
    return conditioning(rows.T @ rows, 2.0).smoothed


def test_gradient_of_the_conditioning_is_that_of_differences():
    path = drawn()
    times, variables = path.times(200), variables_of(path)
    laid_out = design(path, times)
    gradient = laid_out.gradient(conditioning_gradient(STRUCTURE, laid_out.motion(variables), 2.0)[1])
    rng = np.random.default_rng(0)
    directions = rng.standard_normal((8, *variables.shape))
    step = 1e-6
    differences = [
        (smoothed(variables + step * way, path, times) - smoothed(variables - step * way, path, times)) / (2 * step)
        for way in directions
    ]
    slopes = [np.sum(gradient * way) for way in directions]
    # The wide step in attitude leaves an error of its square over six.
    np.testing.assert_allclose(slopes, differences, atol=0.02 * np.abs(differences).max())


def test_the_penalty_pulls_back_only_what_exceeds_a_limit():
    path, limits = drawn(), RotationLimits(RotationSettings())
    laid_out = design(path, path.times(200))
    inside = laid_out.motion(variables_of(path.scaled(0.5)))
    assert not penalty_gradient(limits, inside, 100.0).any()
    beyond = variables_of(path.scaled(1.3))
    descended = beyond - 1e-3 * laid_out.gradient(penalty_gradient(limits, laid_out.motion(beyond), 100.0))
    before, after = (limits.peaks(path_of(variables, path)).max() for variables in (beyond, descended))
    assert after < before


def test_adam_finds_the_bottom_of_a_bowl_under_noise():
    rng = np.random.default_rng(0)
    scale, bottom = np.array([100.0, 1.0]), np.array([0.3, -0.7])
    *_, last = adam(lambda x: scale * (x - bottom) + 0.1 * rng.standard_normal(2), np.zeros(2), 400, 0.05)
    assert last == pytest.approx(bottom, abs=0.02)


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


def test_a_path_without_pitch_excites_no_rule_of_pitch():
    sine, cosine = np.random.default_rng(0).standard_normal((2, 3, 4))
    sine[1] = cosine[1] = 0.0
    structure = model_structure(StructureSettings())
    path = RotationPath(np.zeros(3), np.array([1, 0, 1]), sine, cosine, 20.0)
    assert condition_number(path, structure, 400) > 1e14
