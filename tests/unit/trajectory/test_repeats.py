"""A path flown again and again: equal runs, a smooth way back, rest between, whole turns of yaw."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from cpfls_cli.errors import SettingError
from cpfls_cli.trajectory.excited import added_motion
from cpfls_cli.trajectory.planning import plan, repeated
from cpfls_cli.trajectory.settings import ExciteSettings, TrajectorySettings, WaypointSettings

GRAVITY = 9.81
POINTS = tuple(
    WaypointSettings(position_m=at, yaw_rad=yaw) for at, yaw in (((0, 0, 1), 0.5), ((9, 0, 1), 1.0), ((9, 5, 4), 3.0))
)
PATHS = {
    "ends elsewhere": {"sample_time_s": 0.02},
    "there and back": {"legs": 2, "duration_s": 40.0, "sample_time_s": 0.02},
    "half a turn": {"legs": 2, "duration_s": 40.0, "yaw_turn_rad": 3.5, "sample_time_s": 0.02},
    "between two samples": {"legs": 1, "duration_s": 20.013, "sample_time_s": 0.02},
    "as long as it takes": {"legs": 1, "duration_s": None, "sample_time_s": 0.02},
    "points with a yaw": {"path": "waypoints", "waypoints": POINTS, "duration_s": 40.0, "sample_time_s": 0.02},
    "excited": {"path": "hover", "duration_s": 10.0, "excite": ExciteSettings(axes=("roll", "yaw"))},
}


def flown(count=3, **changes):
    settings = TrajectorySettings(repeat=count, repeat_pause_s=2.5, **changes)
    run = plan(settings, GRAVITY)
    if settings.excite.axes:
        run = added_motion(settings.excite, run, GRAVITY).onto(run, GRAVITY)
    return run, repeated(run, settings, GRAVITY)


@pytest.fixture(params=PATHS.values(), ids=PATHS, scope="module")
def pair(request):
    return flown(**request.param)


def runs_of(mission, values):
    step = mission.time[1]
    firsts = [round(begin / step) for begin, _ in mission.runs]
    samples = round((mission.runs[0][1] - mission.runs[0][0]) / step) + 1
    return np.array([values[first : first + samples] for first in firsts])


def test_runs_are_equal_and_that_of_the_path(pair):
    run, mission = pair
    assert len(mission.runs) == 3
    signals = {name: values for name, values in vars(run).items() if isinstance(values, np.ndarray)}
    assert len(signals) == 15
    for name, values in signals.items():
        difference = runs_of(mission, getattr(mission, name)) - values
        if name == "time":
            difference -= np.array(mission.runs)[:, :1]
        if name == "yaw":
            difference = np.angle(np.exp(1j * difference))
        if name == "attitude":
            difference[..., 2] = np.angle(np.exp(1j * difference[..., 2]))
        np.testing.assert_allclose(difference, 0, atol=1e-9, err_msg=name)


def test_each_run_begins_and_ends_at_rest_after_a_pause(pair):
    _, mission = pair
    for name in ("velocity", "acceleration", "jerk", "snap", "attitude_rate", "attitude_acceleration"):
        np.testing.assert_allclose(runs_of(mission, getattr(mission, name))[:, [0, -1]], 0, atol=1e-9)
    for (_, end), (begin, _) in pairwise(mission.runs):
        assert begin - end >= 2.5 - 1e-9
        resting = (mission.time > begin - 2.4) & (mission.time < begin)
        assert resting.any()
        assert np.abs(mission.velocity[resting]).max() < 1e-9
        assert np.abs(mission.attitude_rate[resting]).max() < 1e-9
    assert mission.duration == pytest.approx(mission.runs[-1][1], abs=mission.time[1])


def test_the_whole_mission_is_one_smooth_motion(pair):
    _, mission = pair
    step = mission.time[1]
    np.testing.assert_allclose(np.diff(mission.time), step)
    names = ("position", "velocity", "acceleration", "jerk")
    pairs = [(getattr(mission, low), getattr(mission, high)) for low, high in pairwise(names)]
    pairs += [(mission.attitude, mission.attitude_rate), (mission.yaw, mission.yaw_rate)]
    for values, derivative in pairs:
        slope = CubicSpline(mission.time, values)(mission.time, 1)
        assert np.abs(slope - derivative).max() < 2e-3 * max(np.abs(derivative).max(), 1e-6)


def test_moves_of_all_runs_and_the_ways_back_are_listed():
    run, mission = flown(**PATHS["ends elsewhere"])
    assert len(mission.legs) == 3 * len(run.legs) + 2
    begins = [leg.begin for leg in mission.legs]
    assert begins == sorted(begins)
    ends = np.array([leg.start + leg.vector for leg in mission.legs])
    np.testing.assert_allclose(ends[3], mission.position[0], atol=1e-9)
    np.testing.assert_allclose([leg.start for leg in mission.legs[1:]], ends[:-1], atol=1e-9)


def test_one_run_is_the_path_itself():
    run, mission = flown(count=1, legs=1)
    assert mission is run


def test_more_samples_than_memory_holds_are_refused():
    with pytest.raises(SettingError, match="more than") as caught:
        flown(count=1000, sample_time_s=0.002)
    assert caught.value.key == "sample_time_s"
