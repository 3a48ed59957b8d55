"""The planned attitude at the instants of control."""

import numpy as np
import pytest

from cpfls_cli.control.controllers import gains, plan_of
from cpfls_cli.errors import ComputationError, SettingError


def pitching(pitch, time):
    """A plan of a pitch and nothing else; the derivatives do not matter."""
    attitude = np.column_stack([0 * time, pitch, 0 * time])
    return {"attitude": attitude, "attitude_rate": 0 * attitude, "attitude_acceleration": 0 * attitude}


def test_between_samples_the_plan_is_smooth_to_the_sixth_order(make_plan):
    errors = []
    for rate in (5.0, 10.0):
        plan, exact = make_plan(rate=rate, control_rate=40.0), make_plan(rate=40.0)
        np.testing.assert_allclose(plan.time, exact.time, atol=1e-12)
        errors.append([np.abs(getattr(plan, n) - getattr(exact, n)).max() for n in ("attitude", "acceleration")])
    assert errors[1][0] < 1e-8
    assert np.log2(np.divide(*errors)) == pytest.approx([6, 4], abs=0.4)


def test_the_control_rate_is_raised_to_a_multiple_of_the_samples(make_plan):
    plan = make_plan(rate=50.0, control_rate=120.0)
    assert plan.parts == 3
    assert plan.period == pytest.approx(1 / 150)
    assert len(plan) == 451


def test_a_control_rate_below_the_samples_is_refused_with_the_key(make_plan):
    with pytest.raises(SettingError, match="lower than the 50 samples in a second") as caught:
        make_plan(rate=50.0, control_rate=49.0)
    assert caught.value.key == "computed_torque.control_rate_hz"


@pytest.mark.parametrize("time", [[0.0], [0.0, 0.1, 0.3]])
def test_time_that_is_not_uniform_is_refused(time):
    time = np.array(time)
    with pytest.raises(ComputationError, match="at least two samples at one rate"):
        plan_of(time, pitching(0 * time, time), 100.0)


@pytest.mark.parametrize("end", [1.5, 1.9], ids=["near", "leapt over"])
def test_a_vertical_pitch_is_refused_with_its_time_and_a_remedy(end):
    time = np.array([0.0, 0.1, 0.2])
    with pytest.raises(ComputationError, match=r"at t = 0\.\d s .*cube-diagonal"):
        plan_of(time, pitching(np.array([0.0, 1.2, end]), time), 10.0)


def test_beyond_the_vertical_all_the_way_is_a_plan():
    time = np.array([0.0, 0.1, 0.2])
    assert len(plan_of(time, pitching(np.array([3.0, 3.1, 3.2]), time), 10.0)) == 3


@pytest.mark.parametrize("damping", [0.3, 1.0, 2.5])
def test_an_error_has_died_down_after_the_settling_time(damping):
    found = gains((0.5, 1.0, 2.0), damping)
    slowest = 2 * np.pi * 0.5
    system = np.array([[0.0, 1.0], [-(slowest**2), -2 * damping * slowest]])
    values, vectors = np.linalg.eig(system + 1e-9 * np.diag([0.0, 1.0]))
    state = vectors @ (np.exp(values * found.settling_time) * np.linalg.solve(vectors, np.array([1.0, 0.0])))
    assert 1e-8 < np.abs(state[0]) < 3e-5
