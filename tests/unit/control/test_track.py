"""Tracking against closed forms, another integrator, and what cannot be tracked."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp, trapezoid
from scipy.spatial.transform import Rotation

from cpfls_cli import rotations
from cpfls_cli.control.controllers import Controller, TorqueActuators, computed_torque, plan_of, proportional_derivative
from cpfls_cli.control.track import Sensing, flown_signals, scores, track
from cpfls_cli.dynamics.equations_of_motion import RigidBody, turning_law
from cpfls_cli.dynamics.rigid_body import inertia_matrix, inertia_matrix_gradient
from cpfls_cli.errors import SettingError
from cpfls_cli.inertia import six_parameters, symmetric
from cpfls_cli.regressor.regressor import InertiaValues
from tests.builders.christoffel import torque

PARAMETERS = np.array([0.6, 0.7, 1.2, 0.02, -0.03, 0.01])
INERTIA = symmetric(PARAMETERS)
START = np.array([0.1, -0.15, 0.2])
NOTHING = np.zeros(3)


def exact(inertia):
    return Controller("exact", computed_torque(RigidBody(inertia)))


def closed_form(time, gains):
    """Error of a perfect model under continuous control: a damped oscillation that starts without rate."""
    decay, swing = gains.ratio * gains.frequency, gains.frequency * np.sqrt(1 - gains.ratio**2)
    phase = time[:, None] * swing
    return START * np.exp(-time[:, None] * decay) * (np.cos(phase) + decay / swing * np.sin(phase))


def test_error_of_an_exact_model_is_that_of_a_linear_oscillator_to_first_order_in_the_period(
    make_plan, make_loop, inertia
):
    worst = []
    for rate in (100.0, 200.0, 400.0):
        plan, loop = make_plan(rate=50.0, control_rate=rate), make_loop(integration_rate=rate)
        error = scores(plan, track(plan, [exact(inertia)], loop, START, NOTHING), 1.0).error[0]
        worst.append(np.abs(error - closed_form(plan.time[:: plan.parts], loop.gains)).max())
    assert worst[0] < 0.03
    np.testing.assert_allclose([worst[0] / worst[1], worst[1] / worst[2]], 2.0, rtol=0.1)


def test_another_integrator_with_rotation_matrices_and_torques_about_the_body_axes_agrees(
    make_plan, make_loop, inertia
):
    plan, loop = make_plan(duration=0.6), make_loop(integration_rate=1000.0)
    tracked = track(plan, [exact(inertia)], loop, START, NOTHING)
    state = np.concatenate(
        [Rotation.from_euler("ZYX", tracked.attitude[0, 0, ::-1]).as_matrix().ravel(), tracked.body_rate[0, 0]]
    )
    for instant in range(len(plan) - 1):
        state = by_rotation_matrix(state, command(state, plan, instant, loop.gains, inertia), plan.period, inertia)
        angles = Rotation.from_matrix(state[:9].reshape(3, 3)).as_euler("ZYX")[::-1]
        np.testing.assert_allclose(tracked.attitude[0, instant + 1], angles, atol=1e-9)
        np.testing.assert_allclose(tracked.body_rate[0, instant + 1], state[9:], atol=1e-8)


def command(state, plan, instant, gains, inertia):
    """Computed torque of a rigid body, written about the body axes: ``I (W v + W' qd) + w x I w``."""
    angles, rate = Rotation.from_matrix(state[:9].reshape(3, 3)).as_euler("ZYX")[::-1][None], state[9:]
    euler = np.linalg.solve(rotations.euler_rate_matrix(angles)[0], rate)
    wanted = plan.acceleration[instant] + gains.frequency**2 * (plan.attitude[instant] - angles[0])
    wanted = wanted + 2 * gains.ratio * gains.frequency * (plan.rate[instant] - euler)
    turning = rotations.body_acceleration(angles, euler[None], wanted[None])[0]
    return inertia @ turning + rotations.cross(rate, inertia @ rate)


def by_rotation_matrix(state, body_torque, period, inertia):
    def change(_, y):
        turn, rate = y[:9].reshape(3, 3), y[9:]
        skew = np.array([[0, -rate[2], rate[1]], [rate[2], 0, -rate[0]], [-rate[1], rate[0], 0]])
        return np.concatenate(
            [(turn @ skew).ravel(), np.linalg.solve(inertia, body_torque - rotations.cross(rate, inertia @ rate))]
        )

    return solve_ivp(change, (0, period), state, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]


def test_feedback_alone_lags_behind_a_steady_acceleration_by_its_size_over_the_stiffness(make_loop):
    """On one axis with a constant inertia nothing else is left of the equation of motion."""
    time, push = np.arange(501) / 100, 0.05
    rolling = np.zeros((3, len(time), 3))
    rolling[:, :, 0] = 0.5 * push * time**2, push * time, 0 * time + push
    names = ("attitude", "attitude_rate", "attitude_acceleration")
    plan = plan_of(time, dict(zip(names, rolling, strict=True)), 100.0)
    diagonal = np.array([0.6, 0.7, 1.2])
    loop = make_loop(plant=turning_law(six_parameters(diagonal)))
    tracked = track(plan, [Controller("pd", proportional_derivative(diagonal))], loop, NOTHING, NOTHING)
    error = scores(plan, tracked, 1.0).error[0]
    np.testing.assert_allclose(error[-1], [push / loop.gains.frequency[0] ** 2, 0, 0], rtol=2e-3, atol=1e-12)


def test_signals_of_the_flight_fit_each_other(make_plan, make_loop, inertia):
    """Torque by Lagrange's equations of the logged motion, and rates by differences of the logged angles."""
    plan, loop = make_plan(control_rate=200.0), make_loop()
    tracked = track(plan, [exact(inertia)], loop, START, NOTHING)
    signals = flown_signals(plan, tracked, 0, loop.plant)
    q, qd, qdd = (signals[name] for name in ("attitude", "attitude_rate", "attitude_acceleration"))
    np.testing.assert_allclose(torque(q, qd, qdd, inertia), signals["torque"], atol=1e-12)
    np.testing.assert_allclose(rotations.body_torque(q, signals["torque"]), signals["body_torque"], atol=1e-12)
    np.testing.assert_allclose(rotations.body_rate(q, qd), signals["body_rate"], atol=1e-12)
    np.testing.assert_allclose(np.gradient(q, signals["time"], axis=0)[1:-1], qd[1:-1], atol=0.02)
    np.testing.assert_array_equal(signals["body_torque"][0], tracked.body_torque[0, 0])
    np.testing.assert_array_equal(signals["time"], plan.time[::4])


def test_torques_of_the_log_push_like_those_that_are_held(make_plan, make_loop, inertia):
    """The trapezoids of the logged torque give the momentum about axes at rest to second order in the period."""
    missing = []
    for rate in (50.0, 100.0):
        plan, loop = make_plan(rate=rate), make_loop()
        tracked = track(plan, [exact(inertia)], loop, NOTHING, NOTHING)
        signals = flown_signals(plan, tracked, 0, loop.plant)
        turned = rotations.rotation_matrix(signals["attitude"])
        momentum = rotations.multiply(turned, signals["body_rate"] @ inertia)
        push = trapezoid(rotations.multiply(turned, signals["body_torque"]), signals["time"], axis=0)
        missing.append(np.abs(momentum[-1] - momentum[0] - push).max())
    assert missing[0] < 2e-3
    assert missing[0] / missing[1] > 2.5


class Heavier:
    """The body of the plan, a third too heavy, in Euler coordinates."""

    def inertia(self, attitude):
        tensor = 1.3 * INERTIA
        return InertiaValues(inertia_matrix(attitude, tensor), inertia_matrix_gradient(attitude, tensor))


def test_a_model_in_the_place_of_the_vehicle_turns_as_it_says(make_plan, make_loop, inertia):
    plan = make_plan(duration=1.0)
    ones = [
        track(plan, [exact(inertia)], make_loop(plant=turning_law(each)), START, NOTHING).attitude
        for each in (Heavier(), 1.3 * PARAMETERS, PARAMETERS)
    ]
    np.testing.assert_allclose(ones[0], ones[1], atol=1e-11)
    assert np.abs(ones[0] - ones[2]).max() > 1e-3


def test_a_lag_delays_the_torque_and_a_limit_clips_it(make_plan, make_loop, inertia):
    plan, limit = make_plan(duration=1.0), np.array([2.0, 2.0, 1.0])
    loop = make_loop(actuators=TorqueActuators(0.02, limit))
    tracked = track(plan, [exact(inertia)], loop, START, NOTHING)
    assert np.all(tracked.body_torque[0, 0] == 0)
    assert np.all(np.abs(tracked.body_torque) <= limit)
    # The period is the time constant: 63 % of the way to the first command, which is clipped about roll.
    assert tracked.body_torque[0, 1, 0] == pytest.approx((1 - np.exp(-1)) * limit[0])
    assert tracked.clipped[0, 0]
    assert 0 < scores(plan, tracked, 1.0).clipped[0] < 1


def test_every_controller_measures_the_same_noise(make_plan, make_loop, inertia):
    plan, rng = make_plan(duration=1.0), np.random.default_rng(0)
    noise = Sensing(*(0.01 * rng.standard_normal((2, *plan.attitude.shape))))
    tracked = track(plan, [exact(inertia), exact(inertia)], make_loop(sensing=noise), START, NOTHING)
    still = track(plan, [exact(inertia)], make_loop(), START, NOTHING)
    np.testing.assert_array_equal(tracked.attitude[0], tracked.attitude[1])
    assert np.abs(tracked.attitude[0] - still.attitude[0]).max() > 1e-3


def test_yaw_counts_up_to_whole_turns(make_plan, make_loop, inertia):
    once, again = (
        scores(plan, track(plan, [exact(inertia)], make_loop(), START, NOTHING), 1.0).error
        for plan in (make_plan(duration=0.5), make_plan(duration=0.5, yaw=4 * np.pi))
    )
    np.testing.assert_allclose(once, again, atol=1e-12)


class NotANumber:
    def torque(self, motion):
        return np.full((len(motion), 3), np.nan)


@pytest.mark.parametrize(
    "law",
    [proportional_derivative(np.array([-5.0, 1.0, 1.0])), computed_torque(NotANumber())],
    ids=["unstable", "no number"],
)
def test_a_lost_vehicle_is_told_and_the_others_go_on(make_plan, make_loop, inertia, law):
    plan, loop = make_plan(), make_loop()
    tracked = track(plan, [exact(inertia), Controller("bad", law), exact(inertia)], loop, START, NOTHING)
    found = scores(plan, tracked, 1.0)
    assert np.isnan(found.lost_at[[0, 2]]).all()
    lost = int(np.searchsorted(plan.time, found.lost_at[1]))
    assert 0 < lost < len(plan) - 1
    assert np.isfinite(found.error[1, :lost]).all()
    assert np.isnan(found.error[1, lost:]).all()
    for scored in (found.rms, found.settled_rms, found.max_error, found.torque_rms):
        assert np.isnan(scored[1]).all()
        assert np.isfinite(scored[[0, 2]]).all()
    alone = track(plan, [exact(inertia)], loop, START, NOTHING)
    np.testing.assert_allclose(tracked.attitude[2], alone.attitude[0], atol=1e-14)
    assert len(flown_signals(plan, tracked, 1, loop.plant)["time"]) == lost


def test_a_plant_without_inertia_is_lost_at_once(make_plan, make_loop, inertia):
    nothing = turning_law(np.zeros(6))
    found = track(make_plan(duration=0.2), [exact(inertia)], make_loop(plant=nothing), START, NOTHING)
    assert np.isfinite(found.attitude[0, 0]).all()
    assert np.isnan(found.attitude[0, 1:]).all()


def steep(pitch):
    time = np.arange(51) / 50
    steady = np.tile([0.0, pitch, 0.0], (51, 1))
    still = {"attitude": steady, "attitude_rate": 0 * steady, "attitude_acceleration": 0 * steady}
    return plan_of(time, still, 50.0)


def test_a_vehicle_that_goes_over_the_vertical_is_lost(make_loop):
    """Euler angles beyond a vertical pitch belong to another branch, even if no angle is off by 90 degrees."""
    plan = steep(1.3)
    push = Controller("push", lambda *_: np.array([0.0, 3.0, 0.0]))
    tracked = track(plan, [push], make_loop(plant=turning_law(six_parameters([1.0, 1.0, 1.0]))), NOTHING, NOTHING)
    found = scores(plan, tracked, 1.0)
    flown = tracked.attitude[0, np.isfinite(tracked.attitude[0]).all(axis=1)]
    assert np.cos(flown[:, 1]).min() > 0.02
    # Half the acceleration times the square of the time is what lacks to the vertical.
    assert found.lost_at[0] == pytest.approx(np.sqrt(2 * (np.pi / 2 - 1.3) / 3.0), abs=0.03)


@pytest.mark.parametrize("error", [[0.0, -0.4, 0.0], [1.6, 0.0, 0.0]])
def test_a_vehicle_that_is_lost_before_it_starts_is_refused(make_loop, inertia, error):
    with pytest.raises(SettingError, match="lost before it starts") as caught:
        track(steep(1.3), [exact(inertia)], make_loop(), np.array(error), NOTHING)
    assert caught.value.key == "computed_torque.initial_error_rad"
