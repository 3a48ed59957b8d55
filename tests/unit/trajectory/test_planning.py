"""Trajectories: settings, legs, profiles, limits, attitude and rotation."""

from dataclasses import astuple
from itertools import pairwise

import numpy as np
import pytest

from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.rotations import rotation_matrix
from cpfls_cli.trajectory.legs import MoveOutcome, plan_move, plan_moves, synchronised
from cpfls_cli.trajectory.planning import flat_attitude, plan
from cpfls_cli.trajectory.profile import LIMIT_NAMES, BaseProfile, Holds, Limits, LimitSettings, covering
from cpfls_cli.trajectory.rotation import RotationLimits, RotationPath, full_rotation
from cpfls_cli.trajectory.settings import RotationSettings, TrajectorySettings, WaypointSettings
from cpfls_cli.vehicle.settings import VehicleSettings

GRAVITY = 9.81
CHAIN = ["position", "velocity", "acceleration", "jerk", "snap", "crackle", "pop"]
FREQUENCIES = np.array([1.3, 0.9, 1.7])
PHASES = np.array([0.2, 1.1, 2.3])
AMPLITUDES = np.array([6.0, 5.0, 4.0])
DURATION = 20.0


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
    assert (diagonal.yaw[0], diagonal.yaw[-1]) == (0.0, pytest.approx(2 * np.pi, abs=1e-12))
    np.testing.assert_allclose(diagonal.yaw_rate[[0, -1]], 0.0, atol=1e-12)
    np.testing.assert_allclose(diagonal.yaw_rate, np.gradient(diagonal.yaw, 0.01, edge_order=2), atol=1e-6)
    np.testing.assert_allclose(diagonal.yaw_acceleration, np.gradient(diagonal.yaw_rate, 0.01, edge_order=2), atol=1e-6)


def test_yaw_keeps_the_proportions_of_the_holds():
    trajectory = plan(TrajectorySettings(legs=1, duration_s=40.0, hold_velocity_s=4.0, sample_time_s=0.5), GRAVITY)
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


def test_what_numbers_cannot_hold_ends_with_a_message_and_the_largest_move_gives_no_warning():
    """Without a warning of the numerics, which would be an error here."""
    with pytest.raises(ComputationError, match="the attitude's derivatives are too large for floating-point numbers"):
        plan(TrajectorySettings(sample_time_s=0.1, yaw_turn_rad=1e300), GRAVITY)
    with pytest.raises(ComputationError, match="free fall"):
        plan(TrajectorySettings(sample_time_s=0.1, displacement_m=9e99), GRAVITY)


def point(x, **more):
    return WaypointSettings(position_m=(float(x), 0.0, 0.0), **more)


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("direction", {"direction": (1.0, 0.0, 0.0)}),
        ("direction", {"path": "straight", "direction": (0.0, 0.0, 0.0)}),
        ("amplitude_m_s5", {"amplitude_m_s5": 1.0}),
        ("amplitude_m_s5", {"displacement_m": None}),
        ("amplitude_m_s5", {"displacement_m": None, "amplitude_m_s5": 0.0}),
        ("displacement_m", {"displacement_m": -1.0}),
        ("duration_s", {"legs": 4}),
        ("duration_s", {"hold_velocity_s": 2.3}),
        ("sample_time_s", {"sample_time_s": 60.0}),
        ("sample_time_s", {"duration_s": 1e300}),
        ("displacement_m", {"displacement_m": 1e300}),
        ("displacement_m", {"period_s": 1e-70}),
        ("amplitude_m_s5", {"displacement_m": None, "amplitude_m_s5": 1e306}),
        ("amplitude_m_s5", {"displacement_m": None, "amplitude_m_s5": 1.0, "period_s": 1e-80}),
        ("hold_jerk_s", {"limits": LimitSettings(snap_m_s4=1.0), "hold_jerk_s": 0.1}),
        ("amplitude_m_s5", {"limits": LimitSettings(pop_m_s6=1.0), "displacement_m": None, "amplitude_m_s5": 1.0}),
        ("limits", {"limits": LimitSettings(velocity_m_s=1.0, acceleration_m_s2=1.0, jerk_m_s3=1.0)}),
        ("coordination", {"coordination": "each-axis"}),
        ("displacement_measure", {"limits": LimitSettings(pop_m_s6=1.0), "coordination": "each-axis"}),
        ("duration_s", {"path": "full-rotation", "duration_s": None}),
        ("limits", {"path": "full-rotation", "limits": LimitSettings(snap_m_s4=1.0)}),
        ("tilt_max_rad", {"path": "full-rotation", "tilt_max_rad": 0.5}),
        ("pause_s", {"pause_s": 1.0}),
        ("pause_s", {"path": "full-rotation", "pause_s": 1.0}),
        ("amplitude_m_s5", {"path": "waypoints", "waypoints": (point(0), point(1)), "amplitude_m_s5": 1.0}),
        ("duration_s", {"limits": LimitSettings(snap_m_s4=1e-3)}),
        ("waypoints", {"path": "waypoints", "waypoints": (point(0),)}),
        ("waypoints.2.position_m", {"path": "waypoints", "waypoints": (point(0), point(1), point(1))}),
        ("waypoints.1.yaw_rad", {"path": "waypoints", "waypoints": (point(0, yaw_rad=1.0), point(1))}),
        ("waypoints.1.pause_s", {"path": "waypoints", "waypoints": (point(0), point(1, pause_s=1.0))}),
    ],
)
def test_contradictions_name_their_key(key, values):
    with pytest.raises(SettingError) as refusal:
        TrajectorySettings(**values)
    assert refusal.value.key == key


def test_moves_fill_the_duration_and_messages_say_what_is_too_long_or_too_large():
    assert TrajectorySettings(duration_s=48.0).line.duration == 16.0
    with pytest.raises(SettingError, match=r"4 moves take 64 s"):
        TrajectorySettings(legs=4)
    settings = TrajectorySettings(amplitude_m_s5=0.5, displacement_m=None)
    assert settings.line.profiles[0].peaks.displacement == pytest.approx(32.0)
    with pytest.raises(SettingError, match=r"period_s = 1 has displacement up to 1e\+300 in m and s: too large"):
        TrajectorySettings(displacement_m=1e300)


DISPLACEMENTS = np.array([10.0, -4.0, 0.0, 0.5])
LIMITS = Limits(
    velocity=np.array([2.0, 3.0, 1.0, 0.05]),
    acceleration=np.array([1.0, 0.2, 1.0, 1.0]),
    jerk=2.0,
    snap=5.0,
    pop=np.array([np.inf, 100.0, 1.0, 50.0]),
)


@pytest.fixture
def moves():
    return synchronised(DISPLACEMENTS, LIMITS)


def test_all_axes_begin_and_end_together_within_their_limits(moves):
    solved = [move for move in moves if move.outcome == MoveOutcome.SOLVED]
    assert [move.duration for move in solved] == pytest.approx([moves[0].duration] * 3)
    assert [move.profile.displacement for move in moves] == DISPLACEMENTS.tolist()
    peaks = np.array([astuple(move.peaks)[1:] for move in moves]).T
    assert (peaks <= LIMITS.broadcast(4) * (1 + 1e-12)).all()
    assert any(move.active for move in moves)


def test_an_axis_that_stays_is_said(moves):
    assert [move.outcome for move in moves].index(MoveOutcome.ZERO_DISPLACEMENT) == 2
    assert moves[2].profile.duration == 0.0


def test_each_axis_takes_as_long_as_the_slowest_alone():
    alone = plan_moves(DISPLACEMENTS, LIMITS).duration
    moves = synchronised(DISPLACEMENTS, LIMITS)
    slowest = int(alone.argmax())
    assert moves[0].duration == pytest.approx(alone.max(), rel=1e-14)
    assert moves[slowest].active == plan_moves(DISPLACEMENTS, LIMITS)[slowest].active


def test_what_nothing_limits_has_no_solution_and_nothing_moves_where_nothing_is_asked():
    each = synchronised(np.array([1.0, 1.0]), Limits(velocity=np.array([1.0, np.inf])))
    assert [move.outcome for move in each] == [MoveOutcome.SOLVED, MoveOutcome.NO_LIMIT]
    moves = synchronised(np.zeros(3), Limits(velocity=1.0))
    assert [(move.outcome, move.duration) for move in moves] == [(MoveOutcome.ZERO_DISPLACEMENT, 0.0)] * 3


def test_covering_chooses_the_amplitude():
    assert covering(64.0, 1.0, Holds()).amplitude == pytest.approx(1.0, rel=1e-14)
    assert covering(10.0, 0.7, Holds(jerk=0.3, velocity=2.0)).peaks.displacement == pytest.approx(10.0, rel=1e-14)


@pytest.fixture
def profile():
    return BaseProfile(amplitude=2.0, period=0.5, holds=Holds(snap=0.1, jerk=0.2, acceleration=0.3, velocity=0.4))


def test_a_sample_does_not_depend_on_its_neighbours(profile):
    time = np.linspace(0, profile.duration, 40_001)
    some = np.arange(0, len(time), 997)
    scale = np.abs(profile.sample(time)).max(axis=0)
    np.testing.assert_allclose(profile.sample(time)[some] / scale, profile.sample(time[some]) / scale, atol=1e-15)


def test_stretched_keeps_shape_and_displacement(profile):
    slow = profile.stretched(2 * profile.duration)
    assert slow.duration == pytest.approx(2 * profile.duration, rel=1e-15)
    time = np.linspace(0, profile.duration, 300)
    expected = profile.sample(time) / 2.0 ** np.arange(7)
    np.testing.assert_allclose(slow.sample(2 * time), expected, atol=1e-12)


@pytest.mark.parametrize("key", LIMIT_NAMES)
@pytest.mark.parametrize("value", [0.0, -0.0, -3.0, np.nan, -np.inf, np.array([1.0, 0.0])])
def test_a_limit_that_no_move_keeps_is_refused_by_name(key, value):
    with pytest.raises(SettingError, match="must be greater than 0, or leave it out for no limit") as refused:
        Limits(**{key: value})
    assert refused.value.key == key


def test_limits_of_the_wrong_length_are_refused_by_name():
    with pytest.raises(SettingError, match="2 moves; give one value, or one for each move") as refused:
        plan_moves(np.ones(2), Limits(velocity=1.0, jerk=np.ones(3)))
    assert refused.value.key == "jerk"


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, np.ones(3)])
def test_a_period_that_is_none_is_refused(value):
    with pytest.raises(SettingError, match=r"leave it out|give one value") as refused:
        plan_moves(np.ones(2), Limits(velocity=1.0), value)
    assert refused.value.key == "period"


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_displacement_that_is_not_finite_is_refused(value):
    with pytest.raises(SettingError, match="give a finite length") as refused:
        plan_move(value, Limits(velocity=1.0))
    assert refused.value.key == "displacement"


def oscillation(time):
    """Acceleration, jerk and snap of a sinusoidal motion, and a yaw that oscillates on top of a turn."""
    angle = np.outer(time, FREQUENCIES) + PHASES
    sine, cosine = AMPLITUDES * np.sin(angle), AMPLITUDES * np.cos(angle)
    heading = [0.8 * time + 0.5 * np.sin(2 * time), 0.8 + np.cos(2 * time), -2 * np.sin(2 * time)]
    return np.stack([sine, FREQUENCIES * cosine, -(FREQUENCIES**2) * sine]), np.stack(heading)


def flown(time):
    return flat_attitude(time, *oscillation(time), GRAVITY)


def test_thrust_along_body_z_gives_the_acceleration():
    time = np.linspace(0, 20, 500)
    force = oscillation(time)[0][0] + [0, 0, GRAVITY]
    thrust = np.linalg.norm(force, axis=1)[:, None] * rotation_matrix(flown(time).attitude)[:, :, 2]
    np.testing.assert_allclose(thrust, force, atol=1e-12)


def test_angles_are_those_of_equation_18():
    time = np.linspace(0, 20, 500)
    translation, heading = oscillation(time)
    x, y, z = translation[0].T
    sine, cosine = np.sin(heading[0]), np.cos(heading[0])
    roll = np.arcsin((x * sine - y * cosine) / np.sqrt(x**2 + y**2 + (z + GRAVITY) ** 2))
    pitch = np.arctan((x * cosine + y * sine) / (z + GRAVITY))
    np.testing.assert_allclose(flown(time).attitude, np.column_stack([roll, pitch, heading[0]]), atol=1e-12)


@pytest.mark.parametrize(
    ("of", "derivative"), [("attitude", "attitude_rate"), ("attitude_rate", "attitude_acceleration")]
)
def test_derivatives_agree_with_finite_differences(of, derivative):
    step = 1e-3
    time = np.arange(0, 20, step)
    values = getattr(flown(time), of)
    difference = (values[:-4] - 8 * values[1:-3] + 8 * values[3:-1] - values[4:]) / (12 * step)
    analytic = getattr(flown(time), derivative)[2:-2]
    np.testing.assert_allclose(analytic, difference, atol=1e-6 * np.abs(difference).max())


@pytest.mark.parametrize(
    ("sample", "falls", "at"), [(1, GRAVITY, "0.5"), (2, 2 * GRAVITY, "1")], ids=["at a sample", "between two samples"]
)
def test_free_fall_is_refused_with_its_time(sample, falls, at):
    translation = np.zeros((3, 3, 3))
    translation[0, sample, 2] = -falls
    with pytest.raises(ComputationError, match=f"free fall at t = {at} s"):
        flat_attitude(np.array([0.0, 0.5, 1.0]), translation, np.zeros((3, 3)), GRAVITY)


def test_sideways_thrust_is_refused():
    translation = np.zeros((3, 1, 3))
    translation[0, 0] = [0.0, 5.0, -GRAVITY]
    with pytest.raises(ComputationError, match=r"roll of 90 degrees at t = 0 s"):
        flat_attitude(np.zeros(1), translation, np.zeros((3, 1)), GRAVITY)


def drawn(seed=0, **settings):
    return full_rotation(RotationSettings(**settings), DURATION, np.random.default_rng(seed))


def spectral_derivative(values, duration):
    """Derivative of periodic samples by their discrete Fourier transform."""
    frequency = 2j * np.pi * np.fft.rfftfreq(len(values), duration / len(values))
    return np.fft.irfft(frequency[:, None] * np.fft.rfft(values, axis=0), len(values), axis=0)


def test_derivatives_are_those_of_the_spectrum():
    path = drawn()
    motion, turning = path.sample(path.times(64)), 2 * np.pi / DURATION * path.turns
    rate = spectral_derivative(motion.attitude - path.times(64)[:, None] * turning, DURATION)
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
    assert 0.999 < RotationLimits(RotationSettings(**settings)).peaks(drawn(**settings)).max() <= 1


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
