from itertools import pairwise

import numpy as np
import pytest

from cpfls_cli.errors import ComputationError
from cpfls_cli.trajectory.planning import plan
from cpfls_cli.trajectory.settings import TrajectorySettings

GRAVITY = 9.81
CHAIN = ["position", "velocity", "acceleration", "jerk", "snap", "crackle", "pop"]


@pytest.fixture(scope="module")
def diagonal():
    return plan(TrajectorySettings(), GRAVITY)


def test_default_path_goes_out_back_and_out(diagonal):
    along = diagonal.position @ np.ones(3) / np.sqrt(3)
    pause = (54.86 - 48) / 2
    starts = np.array([0, 16 + pause, 32 + 2 * pause])
    np.testing.assert_allclose(np.interp(starts + 8, diagonal.time, along), 32.0, atol=1e-3)
    np.testing.assert_allclose(np.interp(starts + 16, diagonal.time, along), [64, 0, 64], atol=1e-9)


def test_vehicle_rests_between_the_moves(diagonal):
    pause = (54.86 - 48) / 2
    for begin in (16.0, 32 + pause):
        resting = (diagonal.time > begin) & (diagonal.time < begin + pause)
        assert resting.sum() == 342 or resting.sum() == 343
        np.testing.assert_array_equal(diagonal.velocity[resting], 0.0)


@pytest.mark.parametrize(("of", "derivative"), list(pairwise(CHAIN)))
def test_each_derivative_is_that_of_the_one_before(diagonal, of, derivative):
    values, slope = getattr(diagonal, of), getattr(diagonal, derivative)
    difference = (values[2:] - values[:-2]) / 0.02
    # The pop has corners where one wave ends and the next begins; a central difference rounds them off.
    np.testing.assert_allclose(slope[1:-1], difference, atol=4e-2 * np.abs(slope).max())


def test_yaw_makes_one_turn_from_rest_to_rest(diagonal):
    assert diagonal.yaw[0] == 0.0
    assert diagonal.yaw[-1] == pytest.approx(2 * np.pi, abs=1e-12)
    np.testing.assert_allclose(diagonal.yaw_rate[[0, -1]], 0.0, atol=1e-12)
    np.testing.assert_allclose(diagonal.yaw_rate, np.gradient(diagonal.yaw, 0.01, edge_order=2), atol=1e-6)
    np.testing.assert_allclose(diagonal.yaw_acceleration, np.gradient(diagonal.yaw_rate, 0.01, edge_order=2), atol=1e-6)


def test_yaw_keeps_the_proportions_of_the_holds():
    settings = TrajectorySettings(legs=1, duration_s=40.0, hold_velocity_s=4.0, sample_time_s=0.5)
    trajectory = plan(settings, GRAVITY)
    # The velocity hold is a fifth of the move, so a fifth of the turn's time has constant yaw rate.
    turning = trajectory.yaw_rate[(trajectory.time >= 16) & (trajectory.time <= 24)]
    np.testing.assert_allclose(turning, turning[0], rtol=1e-12)
    assert trajectory.yaw_rate.max() == pytest.approx(turning[0], rel=1e-12)
    assert (trajectory.yaw_rate < turning[0] * (1 - 1e-9)).sum() == len(trajectory.time) - len(turning)


def test_uniform_yaw_has_a_constant_rate():
    trajectory = plan(TrajectorySettings(yaw_profile="uniform"), GRAVITY)
    np.testing.assert_allclose(trajectory.yaw_rate, 2 * np.pi / 54.86, rtol=1e-14)
    np.testing.assert_allclose(np.diff(trajectory.yaw), 0.01 * 2 * np.pi / 54.86, rtol=1e-9)


def test_measures_of_displacement():
    along = plan(TrajectorySettings(), GRAVITY)
    per_axis = plan(TrajectorySettings(displacement_measure="per-axis"), GRAVITY)
    assert np.linalg.norm(along.position[-1]) == pytest.approx(64.0)
    np.testing.assert_allclose(per_axis.position[-1], 64.0)
    assert along.maxima == per_axis.maxima


def test_straight_path_follows_its_direction():
    settings = TrajectorySettings(path="straight", direction=(0.0, -2.0, 0.0), legs=1, displacement_m=10.0)
    trajectory = plan(settings, GRAVITY)
    np.testing.assert_allclose(trajectory.position[-1], [0.0, -10.0, 0.0], atol=1e-12)
    np.testing.assert_array_equal(trajectory.position[:, [0, 2]], 0.0)


def test_a_path_that_falls_freely_is_refused():
    settings = TrajectorySettings(path="straight", direction=(0.0, 0.0, 1.0), displacement_m=400.0)
    with pytest.raises(ComputationError, match="free fall"):
        plan(settings, GRAVITY)


def test_what_numbers_cannot_hold_ends_with_a_message():
    """Without a warning of the numerics, which would be an error here."""
    with pytest.raises(ComputationError, match="the attitude's derivatives are too large for floating-point numbers"):
        plan(TrajectorySettings(sample_time_s=0.1, yaw_turn_rad=1e300), GRAVITY)


def test_the_largest_move_that_settings_allow_gives_no_warning():
    with pytest.raises(ComputationError, match="free fall"):
        plan(TrajectorySettings(sample_time_s=0.1, displacement_m=9e99), GRAVITY)
