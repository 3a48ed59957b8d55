import pytest

from cpfls_cli.errors import SettingError
from cpfls_cli.trajectory.profile import LimitSettings
from cpfls_cli.trajectory.settings import TrajectorySettings, WaypointSettings


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


def test_moves_that_fill_the_duration_exactly_are_accepted():
    assert TrajectorySettings(duration_s=48.0).line.duration == 16.0


def test_message_says_how_long_the_moves_take():
    with pytest.raises(SettingError, match=r"4 moves take 64 s"):
        TrajectorySettings(legs=4)


def test_amplitude_sets_the_displacement():
    settings = TrajectorySettings(amplitude_m_s5=0.5, displacement_m=None)
    assert settings.line.profiles[0].peaks.displacement == pytest.approx(32.0)


def test_message_says_what_is_too_large():
    with pytest.raises(SettingError, match=r"period_s = 1 has displacement up to 1e\+300 in m and s: too large"):
        TrajectorySettings(displacement_m=1e300)
