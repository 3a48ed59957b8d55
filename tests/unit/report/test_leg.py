import numpy as np
import pytest

from cpfls_cli.artifacts import TRAJECTORY, Artifact, Header
from cpfls_cli.report.leg import first_leg, peaks
from cpfls_cli.trajectory.path import plan
from cpfls_cli.trajectory.settings import TrajectorySettings


def trajectory(**settings):
    planned = plan(TrajectorySettings(**settings), 9.81)
    data = {spec.path: getattr(planned, spec.path) for spec in TRAJECTORY.datasets}
    return Artifact(TRAJECTORY, Header("0", 1, ""), data)


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
