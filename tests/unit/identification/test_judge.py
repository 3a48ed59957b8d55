"""Scores worked by hand, and baselines."""

import numpy as np
import pytest

from cpfls_cli.dynamics import newton_euler_torque
from cpfls_cli.errors import ComputationError
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.judge import constant_inertia_columns, fit_baselines, score_of
from cpfls_cli.regressor.regressor import Motion
from tests.builders.flights import random_motion, still_flight


def score(data, predicted):
    return score_of(data, lambda _: predicted)


def test_by_hand():
    data = still_flight([[1, 0, 2], [3, 0, 2], [5, 0, 2]])
    predicted = np.array([[1, 1, 2], [2, 0, 2], [7, 0, 1]])
    judged = score(data, predicted)
    np.testing.assert_allclose(judged.mse, [5 / 3, 1 / 3, 1 / 3])
    np.testing.assert_allclose(judged.max_error, [2, 1, 1])
    np.testing.assert_allclose(judged.relative_error, [2 / 5, np.nan, 1 / 2])
    # Sum of squares about the mean is 8 for roll; pitch and yaw do not vary.
    np.testing.assert_allclose(judged.r2, [1 - 5 / 8, np.nan, np.nan])
    np.testing.assert_allclose(judged.r2_body, judged.r2)


def test_variance_accounted_for_forgives_a_constant():
    """Errors of 3, 4 and 5 have the variance of -1, 0 and 1."""
    data = still_flight([[1, 0, 2], [3, 1, 2], [5, 8, 2]])
    judged = score(data, data.torque - [[3, 7, 0], [4, 7, 0], [5, 7, 1]])
    np.testing.assert_allclose(judged.vaf, [1 - 2 / 8, 1.0, np.nan])
    np.testing.assert_allclose(judged.r2, [1 - 50 / 8, 1 - 147 / 38, np.nan])


def test_body_axes():
    """At 90 degrees of roll the Euler pitch torque is the body's negative yaw torque."""
    torque = [[1, 2, 5], [2, -3, 4], [4, 9, 1]]
    rolled = np.tile([np.pi / 2, 0.0, 0.0], (3, 1))
    judged = score(still_flight(torque, rolled), np.add(torque, [[0, 1, 0], [0, 0, 0], [0, 0, 2]]))
    np.testing.assert_allclose(judged.r2_body, judged.r2[[0, 2, 1]], rtol=1e-12)


def test_body_torque_is_judged_where_the_pitch_is_not_vertical():
    """Near +-90 degrees it is divided by next to nothing: one such sample would outweigh all others."""
    rng = np.random.default_rng(7)
    attitude, torque, error = rng.uniform(-1.2, 1.2, (40, 3)), *rng.standard_normal((2, 40, 3))
    rest, steep = np.arange(40) != 5, attitude.copy()
    steep[5, 1] = np.pi / 2 - 1e-7
    judged = score(still_flight(torque, steep), torque + 0.1 * error)
    others = score(still_flight(torque[rest], steep[rest]), (torque + 0.1 * error)[rest])
    np.testing.assert_allclose(judged.r2_body, others.r2_body)
    assert np.all(judged.r2_body > 0.8)
    assert not np.array_equal(judged.mse, others.mse)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2 + 0.05, 4.7])
def test_a_flight_at_a_vertical_pitch_tells_nothing_of_body_torque(pitch):
    torque = np.random.default_rng(8).standard_normal((5, 3))
    judged = score(still_flight(torque, np.tile([0.3, pitch, 0.0], (5, 1))), 0.9 * torque)
    assert np.isnan(judged.r2_body).all()
    assert np.all(judged.r2 > 0.5)


@pytest.mark.parametrize(
    ("torque", "samples", "message"),
    [
        (np.zeros((3, 2)), 3, r"torque: expected shape \(time, 3\)"),
        (np.zeros((3, 3)), 4, "have 4, 4 and 3 samples"),
        (np.full((3, 3), np.nan), 3, "not finite"),
    ],
)
def test_data_that_do_not_fit_are_refused(torque, samples, message):
    zero = np.zeros((samples, 3))
    with pytest.raises(ComputationError, match=message):
        TorqueData(np.arange(samples), Motion(zero, zero, zero), torque)


PARAMETERS = np.array([0.6, 0.7, 1.2, 0.05, -0.08, 0.1])


def tensor(parameters):
    xx, yy, zz, xy, xz, yz = parameters
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def motion(samples=200):
    return random_motion(np.random.default_rng(17), samples, limit=1.0)


def fitted(torque):
    """Baselines by name."""
    baselines = fit_baselines(TorqueData(np.arange(200.0), motion(), torque), np.array([1.0, 2.0, 5.0]), 1e-10)
    return {baseline.name: baseline for baseline in baselines}


def test_columns_of_constant_inertia():
    expected = motion().acceleration @ tensor(PARAMETERS)
    np.testing.assert_allclose(constant_inertia_columns(motion()) @ PARAMETERS, expected, atol=1e-14)


def test_six_inertia_parameters_come_back_exactly():
    m = motion()
    torque = newton_euler_torque(m.attitude, m.rate, m.acceleration, tensor(PARAMETERS))
    by_name = fitted(torque)
    assert list(by_name) == ["rigid-body", "constant-inertia", "torque-zero"]
    np.testing.assert_allclose(by_name["rigid-body"].parameters, PARAMETERS, atol=1e-12)
    np.testing.assert_allclose(by_name["rigid-body"].torque(m), torque, atol=1e-12)
    assert np.abs(by_name["constant-inertia"].torque(m) - torque).max() > 0.1 * np.abs(torque).max()
    np.testing.assert_array_equal(by_name["torque-zero"].torque(m), np.zeros_like(torque))


def test_constant_inertia_comes_back_when_that_is_what_moved():
    by_name = fitted(motion().acceleration @ tensor(PARAMETERS))
    np.testing.assert_allclose(by_name["constant-inertia"].parameters, PARAMETERS, atol=1e-12)


def test_rows_are_weighted_by_axis():
    torque = np.random.default_rng(18).standard_normal((200, 3))
    scale = np.repeat([[1.0, 2.0, 5.0]], 200, axis=0)
    columns = constant_inertia_columns(motion())
    expected = np.linalg.lstsq((columns * scale[:, :, None]).reshape(-1, 6), (torque * scale).ravel(), rcond=None)[0]
    np.testing.assert_allclose(fitted(torque)["constant-inertia"].parameters, expected, atol=1e-12)


def test_variances_are_the_same_chunk_by_chunk(monkeypatch):
    rng = np.random.default_rng(9)
    torque, error = rng.standard_normal((2, 50, 3)) + 5.0
    data = still_flight(torque)
    monkeypatch.setattr("cpfls_cli.identification.data.CHUNK", 7)
    predicted = [(torque - error)[start : start + 7] for start in range(0, 50, 7)]
    judged = score_of(data, lambda motion: predicted.pop(0)[: len(motion)])
    np.testing.assert_allclose(judged.vaf, 1 - error.var(axis=0) / torque.var(axis=0))
    np.testing.assert_allclose(judged.r2, 1 - np.mean(error**2, axis=0) / torque.var(axis=0))
