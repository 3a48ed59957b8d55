"""What follows from the samples of a planned path: its first move and its peaks."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.flights.path import PlannedPath
from cpfls_cli.simulation.inverse import flyability
from cpfls_cli.trajectory.planning import plan
from cpfls_cli.trajectory.settings import TrajectorySettings, WaypointSettings
from cpfls_cli.vehicle.settings import VehicleSettings


def trajectory(**settings):
    asked = TrajectorySettings(**settings)
    planned = plan(asked, 9.81)
    return PlannedPath.of(planned, flyability(vars(planned), VehicleSettings(), asked.tilt_max_rad), asked)


def test_the_paper_s_move_shows_its_printed_maxima():
    peaks = {peak.name: peak.largest for peak in trajectory().peaks}
    printed = {"pop": 2 * np.pi, "crackle": 2, "snap": 1, "jerk": 1, "acceleration": 2, "velocity": 8}
    assert peaks == pytest.approx({**printed, "displacement": 64}, rel=1e-3)


@pytest.mark.parametrize("duration_s", [48.0, 54.86])
def test_the_first_leg_is_the_first_sixteen_seconds(duration_s):
    leg = trajectory(duration_s=duration_s).first_leg()
    assert leg.time[-1] == pytest.approx(16.0, abs=0.1)
    assert leg.curves["displacement"][-1] == pytest.approx(64.0)
    assert np.trapezoid(leg.curves["velocity"], leg.time) == pytest.approx(64.0, rel=1e-4)
    assert leg.curves["velocity"].min() >= -1e-9


def test_the_first_leg_of_a_path_through_waypoints_ends_at_the_second_point():
    points = tuple(WaypointSettings(position_m=place) for place in ((1.0, 2.0, 3.0), (4.0, 6.0, 3.0), (40.0, 6.0, 3.0)))
    leg = trajectory(path="waypoints", waypoints=points).first_leg()
    assert leg.time[-1] == pytest.approx(16.0)
    assert leg.curves["displacement"][-1] == pytest.approx(5.0)


def test_a_file_that_does_not_know_its_legs_shows_the_whole_path():
    leg = replace(trajectory(), legs=()).first_leg()
    assert len(leg.time) == 5487
    assert leg.curves["displacement"].max() == pytest.approx(64.0)
