"""Laws of autopilots and their allocation."""

import numpy as np
import pytest

from cpfls_cli.autopilots.law import Controller, attitude_error
from cpfls_cli.autopilots.motors import (
    Allocation,
    Limits,
    Motors,
    ThrustCurve,
    factor_mix,
    mixing,
    px4_mix,
    straightening,
)
from cpfls_cli.autopilots.parameters import version_of
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.errors import InputError
from cpfls_cli.rotations import rotation_matrix
from cpfls_cli.vehicle.rotors import allocation_matrix
from tests.builders.autopilots import CROSS
from tests.builders.thinned_logs import CA, FRD, mixed_by_ardupilot, mixed_by_px4

NOTCHED = {
    "px4": {"IMU_GYRO_NF0_FRQ": 80.0},
    "ardupilot": {"INS_HNTCH_ENABLE": 1.0},
    "betaflight": {"gyro_notch1_hz": 200.0, "gyro_notch1_cutoff": 150.0},
    "crazyflie": {"pid_rate.rateFiltEn": 1.0},
}


@pytest.mark.parametrize("name", AUTOPILOTS)
def test_the_steps_of_a_law_are_its_transfer_functions(name):
    law, samples, small = AUTOPILOTS[name].law(NOTCHED[name]), 1 << 10, 1e-4 * np.ones(3)
    frequency = np.arange(1, samples // 2) * law.rate_hz / samples
    for asked, sign in ((1.0, 1.0), (0.0, -1.0)):
        controller = Controller(law)
        controller.command(np.zeros(3), np.zeros(3))
        pulses = ((asked * small * (step == 0), (1 - asked) * small * (step == 0)) for step in range(samples))
        answer = sign / 1e-4 * np.array([controller.command(*pulse) for pulse in pulses])
        # An integral never dies, so what is compared is the change from step to step.
        change = np.fft.fft(np.diff(answer, axis=0, prepend=0.0), axis=0)[1 : samples // 2]
        for axis in range(3):
            expected = law.response(axis, frequency)[0 if asked == 0.0 else 1]
            expected = expected * (1 - np.exp(-2j * np.pi * frequency * law.period))
            np.testing.assert_allclose(change[:, axis], expected, atol=2e-3 * abs(expected).max())


@pytest.mark.parametrize("name", AUTOPILOTS)
def test_a_command_turns_the_body_about_its_axis_alone(name):
    autopilot = AUTOPILOTS[name]
    motors = Motors.of(autopilot.mixer, autopilot.law().curve, CROSS)
    allocation = allocation_matrix(CROSS)
    hover = motors.speeds(0.4, np.zeros(3)).speed
    for axis in range(3):
        torque = allocation[1:] @ (motors.speeds(0.4, 0.02 * np.eye(3)[axis]).speed ** 2 - hover**2)
        assert torque[axis] > 0
        assert np.abs(np.delete(torque, axis)).max() < 1e-9
    assert motors.share_of(motors.speed_at(0.4)) == pytest.approx(0.4)


def test_the_mixers_are_scaled_as_each_autopilot_scales_them():
    found = {name: np.abs(mixing(each.mixer, CROSS)).max(axis=0).tolist() for name, each in AUTOPILOTS.items()}
    assert found["px4"] == pytest.approx([1.0, 0.5**0.5, 0.5**0.5, 1.0])
    assert found["ardupilot"] == pytest.approx([1.0, 0.5, 0.5, 0.5])
    assert found["betaflight"] == pytest.approx([1.0, 1.0, 1.0, 1.0])
    assert found["crazyflie"] == pytest.approx([1.0, 0.5, 0.5, 1.0])


def test_where_motors_cannot_do_all_yaw_gives_way_first():
    motors = Motors(mixing(AUTOPILOTS["px4"].mixer, CROSS), ThrustCurve(), 1.0)
    mixed = motors.speeds(0.5, np.array([0.6, 0.0, 0.5]))
    allocated = np.linalg.pinv(motors.mix) @ mixed.speed
    assert allocated[1] == pytest.approx(0.6)
    assert 0.0 <= allocated[3] < 0.5
    assert mixed.saturated.tolist() == [False, False, True]
    assert mixed.wanted.max() > 1


@pytest.mark.parametrize(
    "curve", [ThrustCurve(0.3), ThrustCurve(0.65, 0.15, 0.95), ThrustCurve(0.6, 0.05, series=True)]
)
def test_a_thrust_curve_and_its_inverse(curve):
    shares = np.linspace(0.0, 1.0, 21)
    np.testing.assert_allclose(curve.thrust(curve.signal(shares)), shares, atol=1e-6)


def test_the_thrust_curve_of_betaflight_is_its_own():
    curve = AUTOPILOTS["betaflight"].law({"thrust_linear": 50.0}).curve
    assert curve.signal(np.array([0.4])) == pytest.approx(0.055 + 0.945 * 0.4 * (1 + 0.5 * 0.6**2))


@pytest.mark.parametrize("name", AUTOPILOTS)
def test_defaults_lie_in_the_documented_ranges(name):
    autopilot = AUTOPILOTS[name]
    names = [each.name for each in autopilot.parameters]
    assert len(set(names)) == len(names)
    assert all(each.low <= each.default <= each.high for each in autopilot.parameters)
    assert all("https://" in source for source in autopilot.source)


def test_parameters_become_quantities_in_si_units():
    law = AUTOPILOTS["px4"].law({"MC_ROLLRATE_K": 2.0, "MC_ROLLRATE_P": 0.1, "MC_ROLLRATE_MAX": 90.0})
    assert (law.axes[0].p, law.axes[0].rate_limit) == pytest.approx((0.2, np.pi / 2))
    # Betaflight's P of 100 is 3.2 thousandths of a full command per degree a second.
    assert AUTOPILOTS["betaflight"].law({"p_roll": 100.0}).axes[0].p == pytest.approx(3.2029e-3 * 180 / np.pi)
    assert AUTOPILOTS["crazyflie"].law().axes[0].p == pytest.approx(250 / 65535 * 180 / np.pi)
    with pytest.raises(InputError, match="did you mean MC_ROLLRATE_P"):
        AUTOPILOTS["px4"].law({"MC_ROLRATE_P": 0.1})


def test_what_a_log_lacks_is_as_it_was_before_it_existed():
    values = AUTOPILOTS["px4"].of_log({"MC_YAWRATE_P": 0.3})
    assert (values["MC_YAWRATE_P"], values["MC_YAW_TQ_CUTOFF"], values["MC_ROLLRATE_P"]) == (0.3, 0.0, 0.15)


def test_a_header_of_betaflight_shows_what_is_off():
    named = {"rollPID": "45,80,40", "d_min": "30,0,0", "pitchPID": "47,84,46", "yawPID": "45,80,0"}
    filters = {"gyro_lpf1_static_hz": 0.0, "gyro_lpf1_dyn_hz": "0,0", "dterm_lpf1_static_hz": 90.0}
    found = AUTOPILOTS["betaflight"].in_log(named | filters | {"dterm_lpf1_dyn_hz": "0,0", "levelPID": "55,50,75"})
    # Until 4.5 D in calm flight is d_min, and where that is off it is that of the PID.
    assert (found["d_roll"], found["d_pitch"], found["d_yaw"]) == (30, 46, 0)
    assert (found["gyro_lpf1_dyn_min_hz"], found["dterm_lpf1_dyn_min_hz"]) == (0, 90)
    assert found["angle_p_gain"] == 55
    assert (found["d_max_roll"], found["d_max_pitch"]) == (40, 46)
    assert AUTOPILOTS["betaflight"].in_log({"rollPID": "45,80,40"}) == {
        "p_roll": 45,
        "i_roll": 80,
        "d_roll": 40,
        "d_max_roll": 40,
    }
    assert AUTOPILOTS["px4"].in_log(named) == {}


def test_which_logs_count_and_how_their_versions_name_things():
    found = {text: version_of(text) for text in ("PX4 1.15.0", "ArduCopter V4.6.0 (3fc7011a)", "PX4", "")}
    assert list(found.values()) == [(1, 15), (4, 6), None, None]
    copter, betaflight = (AUTOPILOTS[name].firmware for name in ("ardupilot", "betaflight"))
    assert copter.wrote("ArduCopter 4.6")
    assert copter.wrote("")
    assert not copter.wrote("ArduPlane 3.8.2")
    assert copter.too_old("ArduCopter 3.3")
    assert not copter.too_old("ArduCopter")
    assert betaflight.too_old("Betaflight 4.2.11 (abc) X")
    older, newer = betaflight.names("Betaflight 4.3.1"), betaflight.names("Betaflight 4.5.2")
    assert (older["d_roll"], older["d_max_roll"], older["angle_p_gain"]) == (
        "d_min_roll",
        "d_roll",
        "angle_level_strength",
    )
    assert "angle_p_gain" not in newer
    assert betaflight.names("Betaflight 2025.12.5") == betaflight.names("") == {}


def test_the_rate_of_a_law_is_that_of_its_log():
    betaflight, px4 = AUTOPILOTS["betaflight"], AUTOPILOTS["px4"]
    header = {"rollPID": "45,80,40", "looptime": 312.0, "pid_process_denom": 1.0}
    assert betaflight.law(betaflight.of_log(betaflight.in_log(header))).rate_hz == pytest.approx(1e6 / 312)
    assert betaflight.law().rate_hz == pytest.approx(4000.0)
    assert px4.law({"IMU_GYRO_RATEMAX": 1000.0}).rate_hz == 1000.0
    assert px4.law({"IMU_GYRO_RATEMAX": 0.0}).rate_hz == 400.0


def test_parameters_without_a_gain_of_a_rate_are_of_another_vehicle():
    assert AUTOPILOTS["ardupilot"].in_log({"INS_GYRO_FILTER": 20.0}) == {}
    found = AUTOPILOTS["ardupilot"].in_log({"ATC_RAT_RLL_P": 0.1, "ATC_RAT_RLL_FILT": 15.0})
    assert AUTOPILOTS["ardupilot"].of_log(found)["ATC_RAT_RLL_FLTE"] == 15.0
    # Until 3.6 that was all.
    assert AUTOPILOTS["ardupilot"].of_log(found)["ATC_RAT_RLL_FLTT"] == 0.0


@pytest.mark.parametrize(("share", "hover"), [(0.0, 0.5), (0.5, 0.4), (0.3, 0.7)])
def test_the_straightest_curve_is_the_inverse_where_an_autopilot_has_that(share, hover):
    linear = share / (1 - share) * hover
    for curve in (ThrustCurve(), ThrustCurve(0.0, 0.15, 0.95)):
        span = curve.high - curve.low
        exact = span / (span + 2 * curve.low + linear)
        assert straightening(curve, share, hover, 1.0) == pytest.approx(exact, abs=2e-3)
    series = ThrustCurve(0.0, 0.055, 1.0, series=True)
    # Betaflight's straightens less, so it needs more.
    assert straightening(series, share, hover, 1.5) > 1.0


def test_the_error_of_an_attitude_is_the_rotation_to_the_asked_one():
    here, small = rotation_matrix(np.array([[0.3, -0.2, 1.0]]))[0], np.array([0.02, -0.03, 0.05])
    angle = np.linalg.norm(small)
    skew = np.array([[0, -small[2], small[1]], [small[2], 0, -small[0]], [-small[1], small[0], 0]])
    turned = np.eye(3) + np.sin(angle) / angle * skew + (1 - np.cos(angle)) / angle**2 * skew @ skew
    np.testing.assert_allclose(attitude_error(here, here @ turned), small, rtol=1e-3)


HEXA = np.array([(np.cos(angle), np.sin(angle)) for angle in np.radians([90, -90, -30, 150, 30, -150])])
SPINS = np.array([-1.0, 1.0, -1.0, 1.0, 1.0, -1.0])
RNG = np.random.default_rng(5)
THRUST, TURNING = RNG.uniform(-0.1, 1.1, 400), RNG.normal(0, 0.5, (400, 3))


@pytest.mark.parametrize(
    ("limits", "mixed", "more"),
    [
        *((Limits(by="px4", airmode=airmode), mixed_by_px4, {"airmode": airmode}) for airmode in (0, 1, 2)),
        (
            Limits(by="ardupilot", yaw_headroom=0.3, throttle_mean=0.2),
            mixed_by_ardupilot,
            {"headroom": 0.3, "mean": 0.2},
        ),
    ],
)
@pytest.mark.parametrize("rotors", [4, 6])
def test_what_does_not_fit_gives_way_as_in_each_autopilot(limits, mixed, more, rotors):
    rule, inverse = AUTOPILOTS[limits.by].mixer, limits.by == "px4"
    mix = mixing(rule, CROSS) * [1.0, *FRD] if rotors == 4 else factor_mix(rule, HEXA, SPINS, inverse=inverse)
    allocation = Allocation(mix=mix, limits=limits)
    expected = [mixed(mix, thrust, turning, **more) for thrust, turning in zip(THRUST, TURNING, strict=True)]
    np.testing.assert_allclose(allocation.thrusts(THRUST, TURNING), expected, atol=1e-12)
    wanted = np.column_stack([THRUST, TURNING]) @ mix.T
    assert 0.5 < ((wanted < 0) | (wanted > 1)).any(axis=1).mean() < 1.0


def test_the_parameters_of_px4_make_the_mixer_of_the_vehicle():
    rule = AUTOPILOTS["px4"].mixer
    expected = mixing(rule, CROSS) * [1.0, *FRD]
    np.testing.assert_allclose(px4_mix(rule, CA, [0, 1, 2, 3]), expected, atol=1e-9)
    # A motor that is weaker and as dear in torque is asked for more of everything, so that all turn and lift alike.
    effect = np.array([5.0, 6.5, 6.5, 6.5])[:, None] * px4_mix(rule, CA | {"CA_ROTOR0_CT": 5.0}, [0, 1, 2, 3])
    places = np.array([rotor.position_m[:2] for rotor in CROSS.rotors])
    spins = np.array([rotor.spin for rotor in CROSS.rotors])
    made = np.column_stack([np.ones(4), places[:, 1], places[:, 0], 0.05 * spins]).T @ effect
    np.testing.assert_allclose(made - np.diag(np.diag(made)), 0.0, atol=1e-2 * np.abs(made).max())


def test_a_battery_that_empties_is_made_good():
    curve = ThrustCurve(0.65, 0.15, 0.95)
    signals = np.linspace(0, 1, 50)
    lift = 0.65 * 0.9**2 + 0.35 * 0.9
    # What is asked for is raised by the same, so that thrust stays and the signal rises as voltage falls.
    raised = curve.signal(0.5 * signals[:, None] / lift, np.full((50, 1), 0.9))
    np.testing.assert_allclose(raised - 0.15, (curve.signal(0.5 * signals[:, None]) - 0.15) / 0.9, atol=1e-12)
