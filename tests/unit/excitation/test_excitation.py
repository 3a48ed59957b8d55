"""Excitation: its measure and its optimisation."""

import numpy as np
import pytest

from cpfls_cli.dynamics import newton_euler_torque
from cpfls_cli.errors import SettingError
from cpfls_cli.excitation import (
    adam,
    condition_number,
    conditioning,
    conditioning_gradient,
    design,
    optimised_rotation,
    path_of,
    penalty_gradient,
    regressor_of,
    variables_of,
)
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.trajectory.rotation import RotationLimits, RotationPath, full_rotation
from cpfls_cli.trajectory.settings import RotationSettings
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.christoffel import torque

# A low order of the harmonics keeps the curvature over the step in attitude small.
FIRST_ORDER = model_structure(StructureSettings(harmonic_order=1))
DURATION, STRUCTURE, VEHICLE = 20.0, StructureSettings(), VehicleSettings()
SMALL = {"starts": 3, "iterations": 20}
INERTIA = np.array([[0.6, 0.02, -0.01], [0.02, 0.7, 0.03], [-0.01, 0.03, 1.2]])


def drawn():
    return full_rotation(RotationSettings(), 10.0, np.random.default_rng(2))


def test_design_variables_give_the_path_and_its_motion_back():
    path = drawn()
    again = path_of(variables_of(path), path)
    for name in ("start", "turns", "sine", "cosine"):
        np.testing.assert_allclose(getattr(again, name), getattr(path, name), rtol=1e-14)
    path = drawn()
    times, sampled = path.times(30), path.sample(path.times(30))
    motion = design(path, times).motion(variables_of(path))
    expected = [sampled.attitude, sampled.attitude_rate, sampled.attitude_acceleration]
    np.testing.assert_allclose(motion, expected, atol=1e-12)


def smoothed(variables, path, times):
    rows = regressor_of(FIRST_ORDER, design(path, times).motion(variables)).reshape(-1, FIRST_ORDER.parameters)
    return conditioning(rows.T @ rows, 2.0).smoothed


def test_gradient_of_the_conditioning_is_that_of_differences():
    path = drawn()
    times, variables = path.times(200), variables_of(path)
    laid_out = design(path, times)
    gradient = laid_out.gradient(conditioning_gradient(FIRST_ORDER, laid_out.motion(variables), 2.0)[1])
    directions = np.random.default_rng(0).standard_normal((8, *variables.shape))
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
    assert not penalty_gradient(limits, laid_out.motion(variables_of(path.scaled(0.5))), 100.0).any()
    beyond = variables_of(path.scaled(1.3))
    descended = beyond - 1e-3 * laid_out.gradient(penalty_gradient(limits, laid_out.motion(beyond), 100.0))
    before, after = (limits.peaks(path_of(variables, path)).max() for variables in (beyond, descended))
    assert after < before


def test_adam_finds_the_bottom_of_a_bowl_under_noise():
    rng = np.random.default_rng(0)
    scale, bottom = np.array([100.0, 1.0]), np.array([0.3, -0.7])
    *_, last = adam(lambda x: scale * (x - bottom) + 0.1 * rng.standard_normal(2), np.zeros(2), 400, 0.05)
    assert last == pytest.approx(bottom, abs=0.02)


def test_smoothed_value_falls_to_the_logarithm_of_the_condition_number():
    rows = np.random.default_rng(0).standard_normal((20, 6))
    G = rows.T @ rows
    exact = 0.5 * np.log(np.linalg.cond(G))
    values = [conditioning(G, exponent).smoothed for exponent in (1.0, 4.0, 16.0, 256.0)]
    assert (values, values[-1]) == (sorted(values, reverse=True), pytest.approx(exact, abs=1e-2))
    assert values[-1] >= exact


def test_a_path_without_pitch_excites_no_rule_of_pitch():
    sine, cosine = np.random.default_rng(0).standard_normal((2, 3, 4))
    sine[1] = cosine[1] = 0.0
    structure = model_structure(StructureSettings())
    path = RotationPath(np.zeros(3), np.array([1, 0, 1]), sine, cosine, 20.0)
    assert condition_number(path, structure, 400) > 1e14


def optimised(seed=0, progress=None, structure=STRUCTURE, **settings):
    chosen = RotationSettings(**(SMALL | settings))
    return optimised_rotation(chosen, DURATION, structure, VEHICLE, np.random.default_rng(seed), progress)


def test_better_than_the_best_of_as_many_random_paths():
    found = optimised()
    rng = np.random.default_rng(1)
    structure = model_structure(STRUCTURE)
    random = [full_rotation(RotationSettings(), DURATION, rng) for _ in range(found.evaluations)]
    assert found.condition_number < 0.8 * min(condition_number(path, structure, 500) for path in random)


def test_the_result_is_judged_on_many_samples():
    found = optimised()
    again = condition_number(found.path, model_structure(STRUCTURE), 20_000)
    assert found.condition_number == pytest.approx(again, rel=1e-3)


def test_jumps_of_the_slopes_of_seesaw_consequents_do_not_stop_the_search():
    seesaw = StructureSettings(consequents="seesaw", products="additive", membership_functions=3)
    found = optimised(structure=seesaw)
    assert found.condition_number < 0.7 * found.random.min()


def test_limits_hold():
    settings = {"torque_max_n_m": (2.0, 2.0, 1.0), "rate_max_rad_s": 4.0}
    limits = RotationLimits(RotationSettings(**settings), VEHICLE.inertia_kg_m2)
    path = optimised(**settings).path
    assert np.abs(limits.loads(path.sample(path.times(40_000)))).max() <= 1


def test_limits_hold_where_the_search_left_them(monkeypatch):
    monkeypatch.setattr("cpfls_cli.excitation._COSTS", (1e-9, 1e-9))
    limits, seen = RotationLimits(RotationSettings()), []
    enforced = RotationLimits.enforced
    monkeypatch.setattr(RotationLimits, "enforced", lambda own, path: seen.append(path) or enforced(own, path))
    path = optimised().path
    assert limits.peaks(seen[0]).max() > 1.05
    assert limits.peaks(path).max() <= 1


def test_a_seed_gives_one_path():
    first, again = (optimised(seed=4, iterations=3) for _ in range(2))
    np.testing.assert_array_equal(first.path.sine, again.path.sine)
    assert first.condition_number == again.condition_number


def test_progress_counts_every_evaluation():
    calls = []
    found = optimised(progress=lambda *call: calls.append(call), iterations=2)
    assert [call[:2] for call in calls] == [(done, 5) for done in range(1, 6)]
    assert found.evaluations == 5
    assert all(call[2].startswith("condition number ") for call in calls)


def test_never_worse_than_the_random_path_it_began_with(monkeypatch):
    monkeypatch.setattr("cpfls_cli.excitation._STEP", 10.0)
    found = optimised(iterations=2)
    assert found.condition_number == pytest.approx(found.random.min(), rel=0.1)


def test_without_iterations_the_best_random_path_remains_and_its_turns_are_within_limits():
    found = optimised(iterations=0)
    assert found.condition_number == pytest.approx(found.random.min(), rel=0.1)
    with pytest.raises(SettingError, match="complete turns"):
        optimised(turns=(20, 1, 1))


def through_vertical():
    """Motion of a path whose pitch at the first, third and last sample is 90, -90 and again 90 degrees."""
    rng = np.random.default_rng(5)
    sine, cosine = rng.standard_normal((3, 3)) * 0.4, rng.standard_normal((3, 3)) * 0.4
    sine[1], cosine[1] = 0.0, 0.0
    sine[1, 1] = 0.2
    path = RotationPath(np.array([0.4, np.pi / 2, 1.0]), np.array([1, 1, -1]), sine, cosine, 10.0)
    motion = path.sample(np.array([0.0, 2.4, 5.0, 7.6, 10.0]))
    return motion.attitude, motion.attitude_rate, motion.attitude_acceleration


def test_the_torque_is_finite_and_that_of_newton_and_euler():
    motion = through_vertical()
    found = torque(*motion, INERTIA)
    assert np.all(np.isfinite(found))
    np.testing.assert_allclose(found, newton_euler_torque(*motion, INERTIA), atol=1e-12)


def test_harmonic_columns_reach_the_torque_there_too():
    attitude, *_ = motion = through_vertical()
    structure = model_structure(StructureSettings())
    diagonal = np.diag([0.6, 0.7, 1.2])
    seen = np.random.default_rng(0).uniform(-3, 3, (3, 400, 3))
    coefficients = np.linalg.lstsq(
        regressor_of(structure, seen).reshape(-1, structure.parameters), torque(*seen, diagonal).ravel()
    )[0]
    predicted = regressor_of(structure, np.stack(motion)) @ coefficients
    np.testing.assert_allclose(predicted, torque(*motion, diagonal), atol=1e-10)
    assert attitude.shape == predicted.shape
