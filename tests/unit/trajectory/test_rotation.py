import numpy as np
import pytest

from cpfls_cli.errors import SettingError
from cpfls_cli.trajectory.rotation import RotationLimits, RotationPath, full_rotation
from cpfls_cli.trajectory.settings import RotationSettings
from cpfls_cli.vehicle.settings import VehicleSettings

DURATION = 20.0


def drawn(seed=0, **settings):
    return full_rotation(RotationSettings(**settings), DURATION, np.random.default_rng(seed))


def spectral_derivative(values, duration):
    """Derivative of periodic samples by their discrete Fourier transform."""
    frequency = 2j * np.pi * np.fft.rfftfreq(len(values), duration / len(values))
    return np.fft.irfft(frequency[:, None] * np.fft.rfft(values, axis=0), len(values), axis=0)


def test_derivatives_are_those_of_the_spectrum():
    path = drawn()
    motion, turning = path.sample(path.times(64)), 2 * np.pi / DURATION * path.turns
    swing = motion.attitude - path.times(64)[:, None] * turning
    rate = spectral_derivative(swing, DURATION)
    np.testing.assert_allclose(motion.attitude_rate, rate + turning, atol=1e-11)
    np.testing.assert_allclose(motion.attitude_acceleration, spectral_derivative(rate, DURATION), atol=1e-10)


def test_one_term_is_what_the_formula_says():
    sine, cosine = np.zeros((2, 3, 2))
    sine[0, 1] = 0.3
    cosine[2, 0] = 0.2
    path = RotationPath(np.array([0.1, 0.2, 0.3]), np.array([1, -2, 0]), sine, cosine, 4.0)
    time = np.array([0.0, 0.7, 3.1])
    roll = 0.1 + 2 * np.pi * time / 4 + 0.3 * np.sin(np.pi * time)
    pitch = 0.2 - np.pi * time
    yaw = 0.3 + 0.2 * np.cos(0.5 * np.pi * time)
    np.testing.assert_allclose(path.sample(time).attitude, np.column_stack([roll, pitch, yaw]), atol=1e-14)


def test_every_angle_turns_through_complete_circles():
    path = drawn()
    attitude = path.sample(path.times(5000)).attitude % (2 * np.pi)
    assert np.all(path.turns != 0)
    for angle in attitude.T:
        assert len(np.unique((angle / np.radians(5)).astype(int))) == 72


@pytest.mark.parametrize("settings", [{}, {"rate_max_rad_s": 2.0}, {"acceleration_max_rad_s2": 1e6}])
def test_one_limit_is_used_up(settings):
    limits = RotationLimits(RotationSettings(**settings))
    assert 0.999 < limits.peaks(drawn(**settings)).max() <= 1


def test_torque_limit_binds_where_it_is_the_stricter():
    limited = RotationSettings(torque_max_n_m=(1.0, 1.0, 1.0))
    vehicle = VehicleSettings()
    path = full_rotation(limited, DURATION, np.random.default_rng(0), vehicle.inertia_kg_m2)
    peaks = RotationLimits(limited, vehicle.inertia_kg_m2).peaks(path)
    assert peaks.argmax() == 2
    assert 0.999 < peaks[2] <= 1


def test_a_path_within_its_limits_stays_as_it_is():
    path = drawn().scaled(0.5)
    assert RotationLimits(RotationSettings()).enforced(path) is path


@pytest.mark.parametrize(
    ("settings", "key", "message"),
    [
        ({"turns": (20, 1, 1)}, "rate_max_rad_s", "20, 1, 1 complete turns of roll, pitch and yaw in 20 s need"),
        ({"turns": (6, 6, 6), "acceleration_max_rad_s2": 1.0}, "acceleration_max_rad_s2", "raise it or the duration"),
        ({"rate_max_rad_s": 0.1}, "rate_max_rad_s", "complete turns"),
        ({"rate_max_rad_s": 1e9}, "rate_max_rad_s", "more than 10000"),
        ({"frequency_max_hz": 0.04}, "frequency_max_hz", "no harmonic fits into 20 s; raise it to 0.05 or more"),
        ({"frequency_max_hz": 1e5}, "frequency_max_hz", "lower it"),
        ({"torque_max_n_m": (1.0, 1.0, 1.0)}, "torque_max_n_m", "inertia"),
    ],
)
def test_limits_that_cannot_be_met_are_refused(settings, key, message):
    with pytest.raises(SettingError, match=message) as refused:
        drawn(**settings)
    assert refused.value.key == key
