import numpy as np

from cpfls_cli.dynamics.rigid_body import newton_euler_torque
from cpfls_cli.identification import TorqueData
from cpfls_cli.identification.baselines import constant_inertia_columns, fit_baselines
from cpfls_cli.regressor import Motion

PARAMETERS = np.array([0.6, 0.7, 1.2, 0.05, -0.08, 0.1])


def tensor(parameters):
    xx, yy, zz, xy, xz, yz = parameters
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def motion(samples=200):
    rng = np.random.default_rng(17)
    return Motion(rng.uniform(-1, 1, (samples, 3)), *rng.standard_normal((2, samples, 3)))


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
