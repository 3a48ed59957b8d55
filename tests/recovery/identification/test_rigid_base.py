"""Rigid body under a ridge-held fuzzy part: off where it is not needed, on where data speak for it."""

import numpy as np
import pytest

from cpfls_cli.dynamics import rigid_columns
from cpfls_cli.identification.data import TorqueData, axis_scale
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.judge import fit_baselines
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor.regressor import Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import model_structure
from tests.builders.flights import bent_torque, random_motion, rigid_torque

PARAMETERS = np.array([0.6, 0.7, 1.2, 0.03, -0.02, 0.04])
SETTINGS = IdentificationSettings(base="rigid-body", harmonic_order=2, products="tensor", membership_functions=1)
STRUCTURE = model_structure(SETTINGS)
PARTITIONS = uniform_breakpoints(STRUCTURE)
TENSOR = np.array([[0.6, 0.03, -0.02], [0.03, 0.7, 0.04], [-0.02, 0.04, 1.2]])
of_rigid_body, of_bent_body = rigid_torque(TENSOR), bent_torque(TENSOR, 0.3)


def motion(seed):
    """Full rotations: attitudes anywhere on the circle."""
    return random_motion(np.random.default_rng(seed), 400)


def fitted(torque_of, noise):
    """A fit, its regressor's structure, and the training data."""
    m = motion(27)
    torque = torque_of(m)
    torque = torque + noise * torque.std(axis=0) * np.random.default_rng(28).standard_normal(torque.shape)
    data = TorqueData(0.01 * np.arange(len(m)), m, torque)
    return model_evaluator(data, data, SETTINGS).solver.fit(PARTITIONS), data


def regressor(m):
    return Regressor(STRUCTURE, m, data_ranges(STRUCTURE, m.attitude))


def columns(m):
    return regressor(m).matrix(PARTITIONS)


def predicted(fit, m):
    return columns(m) @ fit.coefficients + rigid_columns(m) @ fit.rigid_body


def test_exact_rigid_data_leave_nothing_to_the_fuzzy_part():
    fit, data = fitted(of_rigid_body, noise=0.0)
    np.testing.assert_allclose(fit.rigid_body, PARAMETERS, atol=1e-9)
    assert np.abs(columns(data.motion) @ fit.coefficients).max() < 1e-9


@pytest.mark.parametrize("noise", [0.05, 0.3])
def test_noisy_rigid_data_switch_the_fuzzy_part_off(noise):
    fit, data = fitted(of_rigid_body, noise)
    assert fit.ridge_weight == np.inf
    np.testing.assert_array_equal(fit.coefficients, np.zeros(61))
    rigid = fit_baselines(data, 1 / axis_scale(data), 1e-10)[0]
    np.testing.assert_allclose(fit.rigid_body, rigid.parameters, atol=1e-12)
    np.testing.assert_allclose(fit.rigid_body, PARAMETERS, atol=noise)


def test_inertia_that_depends_on_attitude_switches_it_on_and_beats_the_rigid_body():
    fit, data = fitted(of_bent_body, noise=0.05)
    assert fit.ridge_weight < 0.1
    rigid = fit_baselines(data, 1 / axis_scale(data), 1e-10)[0]
    held_out = motion(29)
    ours, theirs = (
        np.mean((p - of_bent_body(held_out)) ** 2) for p in (predicted(fit, held_out), rigid.torque(held_out))
    )
    assert ours < 0.02 * theirs


def test_coefficients_solve_the_ridge_problem():
    """Zero gradient of |scaled residual|^2 + weight * rows * sum (size c)^2, written out."""
    fit, data = fitted(of_bent_body, noise=0.05)
    scale = 1 / np.sqrt(np.mean(data.torque**2, axis=0))
    residual = ((data.torque - predicted(fit, data.motion)) * scale).ravel()
    fuzzy = (columns(data.motion) * scale[:, None]).reshape(len(residual), -1)
    rigid = (rigid_columns(data.motion) * scale[:, None]).reshape(len(residual), -1)
    penalty = fit.ridge_weight * len(residual) * np.mean(fuzzy**2, axis=0) * fit.coefficients
    np.testing.assert_allclose(rigid.T @ residual, 0.0, atol=1e-9)
    np.testing.assert_allclose(fuzzy.T @ residual, penalty, atol=1e-9)


def test_what_a_selection_misses_is_judged_all_the_same():
    """A selection that holds still about roll fits anything there; the samples between it know better."""
    m = motion(27)
    data = TorqueData(0.01 * np.arange(len(m)), m, of_rigid_body(m) + 0.05 * of_rigid_body(motion(31)))
    few = np.flatnonzero(np.abs(m.attitude[:, 0]) < 0.5)
    learned = data[few]
    curve = model_evaluator(data, learned, SETTINGS).solver.curve(PARTITIONS)
    assert curve.weight[curve.chosen] == np.inf
    blind = model_evaluator(learned, learned, SETTINGS).solver.curve(PARTITIONS)
    assert curve.error[0] > 10 * blind.error[0]


def test_the_shipped_default_is_this_base():
    assert IdentificationSettings().base == "rigid-body"
