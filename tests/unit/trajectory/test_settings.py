import pytest

from cpfls_cli.errors import SettingError
from cpfls_cli.trajectory import TrajectorySettings


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
    ],
)
def test_contradictions_name_their_key(key, values):
    with pytest.raises(SettingError) as refusal:
        TrajectorySettings(**values)
    assert refusal.value.key == key


def test_moves_that_fill_the_duration_exactly_are_accepted():
    assert TrajectorySettings(duration_s=48.0).move.duration == 16.0


def test_message_says_how_long_the_moves_take():
    with pytest.raises(SettingError, match=r"4 moves of 16 s need 64 s"):
        TrajectorySettings(legs=4)


def test_amplitude_sets_the_displacement():
    settings = TrajectorySettings(amplitude_m_s5=0.5, displacement_m=None)
    assert settings.move.peaks.displacement == pytest.approx(32.0)


def test_message_says_what_is_too_large():
    with pytest.raises(SettingError, match=r"period_s = 1 has displacement up to 1e\+300 in m and s: too large"):
        TrajectorySettings(displacement_m=1e300)
