import numpy as np
import pytest

from cpfls_cli.artifacts.formats import TRAJECTORY
from cpfls_cli.artifacts.spec import Header
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.artifacts.trajectory_file import trajectory_data
from cpfls_cli.pages.leg import first_leg, peaks
from cpfls_cli.trajectory.planning import plan
from cpfls_cli.trajectory.settings import TrajectorySettings, WaypointSettings


def trajectory(**settings):
    planned = plan(TrajectorySettings(**settings), 9.81)
    return Artifact(TRAJECTORY, Header("0", 1, ""), trajectory_data(planned))


def test_the_paper_s_move_shows_its_printed_maxima():
    found = peaks(trajectory())
    printed = {"pop": 2 * np.pi, "crackle": 2, "snap": 1, "jerk": 1, "acceleration": 2, "velocity": 8}
    assert found == pytest.approx({**printed, "displacement": 64}, rel=1e-3)


@pytest.mark.parametrize("duration_s", [48.0, 54.86])
def test_the_first_leg_is_the_first_sixteen_seconds(duration_s):
    leg = first_leg(trajectory(duration_s=duration_s))
    assert leg.time[-1] == pytest.approx(16.0, abs=0.1)
    assert leg.curves["displacement"][-1] == pytest.approx(64.0)
    assert np.trapezoid(leg.curves["velocity"], leg.time) == pytest.approx(64.0, rel=1e-4)
    assert leg.curves["velocity"].min() >= -1e-9


def test_the_first_leg_of_a_path_through_waypoints_ends_at_the_second_point():
    points = tuple(WaypointSettings(position_m=place) for place in ((1.0, 2.0, 3.0), (4.0, 6.0, 3.0), (40.0, 6.0, 3.0)))
    leg = first_leg(trajectory(path="waypoints", waypoints=points))
    assert leg.time[-1] == pytest.approx(16.0)
    assert leg.curves["displacement"][-1] == pytest.approx(5.0)


def test_a_file_that_does_not_know_its_legs_shows_the_whole_path():
    whole = trajectory()
    data = {name: values for name, values in whole.data.items() if not name.startswith("leg/")}
    leg = first_leg(Artifact(TRAJECTORY, Header("0", 1, ""), data))
    assert len(leg.time) == 5487
    assert leg.curves["displacement"].max() == pytest.approx(64.0)
