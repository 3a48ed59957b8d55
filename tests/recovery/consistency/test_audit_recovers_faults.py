"""Faults put into a gyroscope come back, each alone and all together; nothing wrong is called nothing wrong."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from cpfls_cli.consistency.check import audit
from cpfls_cli.consistency.sensors import sensors_of
from cpfls_cli.flightlog.smoothing import body_rate_of
from cpfls_cli.weak_form.windows import windows
from tests.builders.faulty_gyroscopes import LEVELS, Faults, faulty_flight, faulty_flights

WINDOWS = windows(0.01, 0.4, 0.5)
ALL = Faults(np.array([0.02, -0.01, 0.005]), np.array([0.02, -0.02, 0.01]), np.array([0.03, -0.02, 0.01]), 0.02)


def truth(faults):
    return np.concatenate([faults.bias, faults.scale, faults.misalignment, np.zeros(3), [faults.delay, 0.0]])


def names(found):
    return {finding.name for finding in found.named}


@pytest.mark.parametrize(
    ("faults", "name"),
    [
        (Faults(bias=np.array([0.005, 0, 0])), "gyro_bias"),
        (Faults(scale=np.array([0, -0.02, 0])), "gyro_scale"),
        (Faults(misalignment=np.array([0, 0, 0.01])), "imu_misalignment"),
        (Faults(delay=0.005), "channel_delay"),
    ],
)
def test_a_single_fault_is_named_alone(faults, name):
    found = audit(faulty_flights(np.random.default_rng(1), faults, level=LEVELS["mid"]), WINDOWS)
    assert names(found) == {name}
    [own] = found.named
    [(each, value)] = [pair for pair in zip(own.coefficients, _own(faults, name), strict=True) if pair[0].named]
    assert value != 0
    assert each.low <= value <= each.high


def test_nothing_makes_a_gyroscope_early_so_the_attitude_behind_it_is_late():
    found = audit(faulty_flights(np.random.default_rng(1), Faults(delay=-0.02), level=LEVELS["mid"]), WINDOWS)
    [repair] = found.repairs
    assert (repair.channel, names(found)) == ("attitude", set())
    assert repair.delay_s == pytest.approx(0.02, abs=0.0002)


def _own(faults, name):
    start = {"gyro_bias": 0, "gyro_scale": 3, "imu_misalignment": 6, "channel_delay": 12}[name]
    return truth(faults)[start : start + 3 if start < 12 else 13]


def fit_of(flights, through=WINDOWS):
    return sensors_of(flights, through).gyroscope.fit


def test_all_faults_at_once_come_back_within_a_few_standard_errors():
    made = faulty_flights(np.random.default_rng(2), ALL, level=LEVELS["mid"])
    assert len(audit(made, WINDOWS).named) == 4
    fit = fit_of(made)
    apart = np.abs(fit.value - truth(ALL))
    assert np.all(apart[:13] < 4 * fit.error[:13] + fit.pull[:13])
    assert apart[13] == 0.0
    assert np.all(apart[:3] < 0.0005)
    assert np.all(apart[3:12] < 0.0015)
    assert apart[12] < 0.0002


def test_without_noise_the_faults_are_exact_at_any_tilt():
    value = fit_of(faulty_flights(np.random.default_rng(3), ALL, amplitude=(1.0, 0.4, 2.0))).value
    np.testing.assert_allclose(value, truth(ALL), atol=2e-5)


@pytest.mark.parametrize("coloured", [False, True])
@pytest.mark.parametrize("level", LEVELS)
def test_nothing_wrong_names_nothing(level, coloured):
    for seed in range(5):
        made = faulty_flights(np.random.default_rng(seed), Faults(), level=LEVELS[level], coloured=coloured)
        found = audit(made, WINDOWS)
        assert (names(found), found.warnings, found.contradictions) == (set(), (), ())


@pytest.mark.parametrize("faults", [Faults(), Faults(scale=np.full(3, 0.05), misalignment=np.full(3, 0.05))])
def test_a_flight_that_hardly_turns_names_no_scale_and_no_misalignment(faults):
    made = faulty_flights(np.random.default_rng(4), faults, level=LEVELS["mid"], amplitude=(0.002, 0.002, 0.002))
    found = audit(made, WINDOWS)
    assert names(found) == set()
    assert set(found.untested) == {"gyro_scale", "imu_misalignment", "channel_delay"}


def test_an_axis_that_stays_still_is_left_alone():
    made = faulty_flights(np.random.default_rng(5), ALL, level=LEVELS["mid"], amplitude=(0.14, 0.0005, 0.0005))
    result = audit(made, WINDOWS)
    [scale] = [finding for finding in result.findings if finding.name == "gyro_scale"]
    assert [(each.name, each.named) for each in scale.coefficients] == [("x", True)]
    assert set(result.untested) == {"imu_misalignment"}


def test_a_repaired_flight_passes_the_audit_and_has_the_true_rate():
    made = faulty_flight(np.random.default_rng(6), ALL, duration=60.0)
    true = faulty_flight(np.random.default_rng(6), Faults(), duration=60.0)
    repaired = audit([made], WINDOWS).repaired(made)
    assert len(repaired) == len(made)
    inside = slice(10, -10)
    assert np.abs(made.body_rate - true.body_rate)[inside].max() > 0.02
    np.testing.assert_allclose(repaired.body_rate[inside], true.body_rate[inside], atol=0.003)


def test_faults_that_are_not_named_are_left_alone():
    made = faulty_flights(np.random.default_rng(7), Faults(bias=np.array([0.0005, 0, 0])), level=LEVELS["mid"])
    assert audit(made, WINDOWS).repaired(made[0]) is made[0]


def test_biases_that_differ_between_flights_are_mentioned():
    rng = np.random.default_rng(8)
    made = [faulty_flight(rng, Faults(bias=np.array([0, b, 0])), level=LEVELS["mid"]) for b in (0.0, 0.01, 0.02)]
    found = audit(made, WINDOWS)
    np.testing.assert_allclose(fit_of(made).flight_bias[:, 1], [-0.01, 0.0, 0.01], atol=0.0008)
    assert any("rad/s between flights" in note for note in found.notes)


@pytest.mark.parametrize("period", [0.02, 0.004])
def test_other_sampling_rates(period):
    made = faulty_flights(np.random.default_rng(9), Faults(delay=0.012), level=LEVELS["mid"], period=period)
    assert names(audit(made, windows(period, 0.4, 0.5))) == {"channel_delay"}
    assert fit_of(made, windows(period, 0.4, 0.5)).value[12] == pytest.approx(0.012, abs=0.0005)


def logged_slowly(flight, channel, hz, between):
    """Take a channel at updates of its own, between two of which rows repeat the last or lie on a straight line."""
    values = getattr(flight, channel)
    stamps = np.arange(flight.time[0], flight.time[-1], 1 / hz)
    updates = CubicSpline(flight.time, values)(stamps)
    last = np.searchsorted(stamps, flight.time, side="right") - 1
    straight = np.column_stack([np.interp(flight.time, stamps, own) for own in updates.T])
    spans = (1 / hz,) if between == "repeated" else (1 / hz, 1 / hz)
    return replace(flight, **{channel: updates[last] if between == "repeated" else straight, f"{channel}_spans": spans})


@pytest.mark.parametrize("channel", ["attitude", "body_rate"])
@pytest.mark.parametrize("between", ["repeated", "interpolated"])
@pytest.mark.parametrize(("scale", "found"), [(0.0, set()), (0.05, {"gyro_scale"})])
def test_a_channel_that_is_logged_slowly_shows_the_scale_of_the_gyroscope_alone(channel, between, scale, found):
    faults = Faults(scale=np.array([scale, 0, 0]))
    made = faulty_flights(np.random.default_rng(1), faults, level=LEVELS["low"])
    result = audit([logged_slowly(flight, channel, 9.3, between) for flight in made], WINDOWS)
    assert names(result) - {"channel_delay"} == found
    for own in (each for each in result.named if each.name == "gyro_scale"):
        [x] = [each for each in own.coefficients if each.named]
        assert (x.name, x.value) == ("x", pytest.approx(scale, abs=0.01))


def test_rates_made_of_an_attitude_that_is_logged_slowly_show_no_scale():
    made = faulty_flights(np.random.default_rng(1), Faults(), level=LEVELS["low"])
    slow = [logged_slowly(flight, "attitude", 10.0, "interpolated") for flight in made]
    found = audit([replace(each, body_rate=body_rate_of(each.time, each.attitude, None)) for each in slow], WINDOWS)
    assert (names(found), "gyro_scale" in found.untested) == (set(), True)
