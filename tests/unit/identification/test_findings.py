"""What an identification confesses: each wrong flight gets its own sentence, a good one gets none."""

import numpy as np
import pytest

from cpfls_cli.dynamics import inertia_matrix, newton_euler_torque, not_positive_definite, why_unphysical
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.findings import axis_evidence
from cpfls_cli.identification.identify import identify
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.rotations import body_rate, generalised_torque

INERTIA = np.array([0.6, 0.7, 1.2, 0.0, 0.0, 0.0])


def small_angle_flight(seed=1, samples=300, yaw=1.0, tilt=0.3):
    """A flight at small angles; `yaw` scales what moves about it."""
    rng = np.random.default_rng(seed)
    scale = np.array([tilt, tilt, 0.3 * yaw])
    time = 0.02 * np.arange(samples)
    phase = np.outer(time, [2.1, 2.7, 1.7]) + rng.uniform(0, 6, 3)
    motion = Motion(
        scale * np.sin(phase),
        scale * [2.1, 2.7, 1.7] * np.cos(phase),
        -scale * np.square([2.1, 2.7, 1.7]) * np.sin(phase),
    )
    torque = newton_euler_torque(motion.attitude, motion.rate, motion.acceleration, np.diag(INERTIA[:3]))
    return TorqueData(time, motion, torque + 0.01 * rng.standard_normal(torque.shape))


def with_torque(data, torque):
    return TorqueData(data.time, data.motion, torque)


def rotations(seed=5, samples=400, tilt=4.0):
    """A flight through complete circles, and so through a vertical pitch."""
    data = small_angle_flight(seed, samples, yaw=10.0, tilt=tilt)
    motion = data.motion
    torque = newton_euler_torque(motion.attitude, motion.rate, motion.acceleration, np.diag(INERTIA[:3]))
    return with_torque(data, torque)


def told(data, held_out=None, stated=INERTIA, **changed):
    settings = IdentificationSettings(
        **{"membership_functions": 1, "consequents": "seesaw", "products": "additive", **changed}
    )
    found = identify(data, data, held_out or {}, settings, np.random.default_rng(0), stated_inertia=stated)
    return " | ".join(found.findings)


def test_a_good_flight_is_only_told_that_the_rigid_body_is_enough():
    sentences = told(small_angle_flight())
    assert "fuzzy part off" in sentences
    for word in ("positive definite", "constant torque", "hardly", "times those stated", "explains less"):
        assert word not in sentences


def test_a_wrong_sign_gives_an_inertia_that_no_body_has():
    data = small_angle_flight()
    sentences = told(with_torque(data, -data.torque))
    assert "not positive definite at 300 of 300 training samples" in sentences
    assert "check signs, axes, frames and units" in sentences


def test_a_constant_torque_is_named_with_its_size():
    data = small_angle_flight()
    offset = np.tile([0.0, -0.5, 0.0], (300, 1))
    sentences = told(with_torque(data, data.torque + generalised_torque(data.motion.attitude, offset)))
    assert "pitch: a constant torque of -0.5" in sentences
    assert "roll: a constant" not in sentences
    assert "hardly" not in sentences


def test_an_axis_that_does_not_move_is_called_hardly_excited():
    data = small_angle_flight(yaw=0.01, tilt=0.05)
    noise = 0.2 * np.random.default_rng(3).standard_normal((300, 3)) * [0, 0, 1]
    sentences = told(with_torque(data, data.torque + noise))
    assert "yaw is hardly excited: motion and a constant explain less than half" in sentences
    assert "roll is" not in sentences


def test_torque_on_a_moving_axis_that_is_not_inertia_is_not_called_unexcited():
    data = small_angle_flight()
    wrong = data.torque.copy()
    wrong[:, 1] = np.random.default_rng(4).standard_normal(300)
    sentences = told(with_torque(data, wrong))
    assert "pitch: something other than inertia acts, or columns are wrong" in sentences
    assert "hardly excited" not in sentences


def test_a_wrong_unit_shows_in_the_ratio_to_the_stated_inertia():
    data = small_angle_flight()
    assert "times those stated" in told(with_torque(data, 57.3 * data.torque))
    assert "times those stated" not in told(with_torque(data, 2.0 * data.torque))
    assert "times those stated" not in told(with_torque(data, 57.3 * data.torque), stated=None)


def test_another_vehicle_is_told_on_held_out_flights():
    data, other = small_angle_flight(), small_angle_flight(seed=2)
    assert "other: the model explains less than half" in told(data, {"other": with_torque(other, 5 * other.torque)})
    assert "explains less than half" not in told(data, {"other": other})


@pytest.mark.parametrize(
    ("inertia", "reason"),
    [
        ([0.6, 0.6, 1.2, 0, 0, 0], None),
        ([0.6, -0.1, 1.2, 0, 0, 0], "not positive definite"),
        ([0.6, 0.6, 1.2, 0.7, 0, 0], "not positive definite"),
        ([0.6, 0.6, 2.0, 0, 0, 0], "triangle inequality"),
        ([0, 0, 0, 0, 0, 0], "not positive definite"),
    ],
)
def test_inertia_of_a_body(inertia, reason):
    why = why_unphysical(np.array(inertia, dtype=float))
    assert (why is None) if reason is None else reason in why


def test_definiteness_is_that_of_the_eigenvalues():
    good, singular, bad = (
        np.diag([1.0, 2.0, 3.0]),
        np.diag([0.0, 2.0, 3.0]),
        np.array([[1, 2, 0], [2, 1, 0], [0, 0, 1.0]]),
    )
    assert not_positive_definite(np.stack([good, singular, bad]), np.zeros((3, 3))).tolist() == [False, False, True]


@pytest.mark.parametrize(("pitch", "smallest"), [(0.0, 0.0), (1.4, 0.0), (1.5, -0.02), (-1.5, -0.02), (4.7, -0.02)])
def test_near_a_vertical_pitch_a_matrix_may_dip_below_zero_by_a_hair(pitch, smallest):
    """There the smallest eigenvalue of every body is next to zero: 1 % of the largest one is let pass."""
    at_pitch = np.tile([0.0, pitch, 0.0], (2, 1))
    dips = np.stack([np.diag([smallest + shift, 1.0, 3.0]) for shift in (-0.005, -0.015)])
    assert not_positive_definite(dips, at_pitch).tolist() == [pitch in (0.0, 1.4), True]
    own = np.linalg.eigvalsh(inertia_matrix(at_pitch, np.diag(INERTIA[:3])))[0]
    assert (own[0] < 0.01 * own[2]) == (abs(np.cos(pitch)) < 0.1)


def test_a_flight_through_a_vertical_pitch_is_told_what_is_left_out():
    sentences = told(rotations())
    assert "body torque is judged without the samples closer than 6 degrees to a pitch of +-90 degrees" in sentences
    assert "closer than" not in told(small_angle_flight())


def test_a_structure_that_fails_on_a_good_flight_is_not_blamed_on_the_log():
    data, rules = rotations(tilt=3.0), {"base": "none", "membership_functions": 3, "population": 6, "generations": 1}
    sentences = told(data, **rules)
    assert "D(q) is not positive definite" in sentences
    assert "the structure or its excitation is at fault" in sentences
    assert "check signs" not in sentences
    assert "check signs" in told(with_torque(data, -data.torque), **rules)


def test_noise_near_a_vertical_pitch_does_not_make_an_axis_badly_explained():
    data = rotations()
    noise = 0.02 * np.random.default_rng(6).standard_normal(data.torque.shape)
    evidence = axis_evidence(with_torque(data, data.torque + noise), 1e-10)
    assert np.all(evidence.r2 > 0.99)


def test_constant_and_inertial_torque_are_told_apart():
    data = small_angle_flight()
    offset = np.tile([0.2, -0.5, 0.1], (300, 1))
    evidence = axis_evidence(with_torque(data, data.torque + generalised_torque(data.motion.attitude, offset)), 1e-10)
    np.testing.assert_allclose(evidence.constant, [0.2, -0.5, 0.1], atol=0.01)
    assert np.all(evidence.r2 > 0.99)
    turned = np.gradient(body_rate(data.motion.attitude, data.motion.rate), data.time, axis=0)
    np.testing.assert_allclose(evidence.acceleration, np.sqrt(np.mean(turned**2, axis=0)), rtol=0.02)
