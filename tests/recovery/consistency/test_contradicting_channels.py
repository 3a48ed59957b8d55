"""A channel that contradicts two others is set right or left out, that is said, and the hidden effect is named."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline
from scipy.signal import butter, filtfilt, lfilter
from scipy.spatial.transform import Rotation

from cpfls_cli import store
from cpfls_cli.artifacts.diagnosis import Extended
from cpfls_cli.config.study import Study
from cpfls_cli.consistency.check import audit
from cpfls_cli.consistency.findings import accelerated
from cpfls_cli.flights import recordings
from cpfls_cli.gap.diagnose import diagnose
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.rotations import euler_angles
from cpfls_cli.weak_form.windows import windows
from tests.builders import gap_artifacts
from tests.builders.closed_loop_flights import COARSE, PERIOD, VEHICLE, flown, signals_of

WINDOWS = windows(PERIOD, 0.4, 0.5)
STUDY = Study(vehicle=VEHICLE)
UP = np.array([0.0, 0.0, 9.81])
EAST, NORTH = np.eye(3)[:2]
DRAG = 2e-3
NOISE = {
    "attitude": 0.003, "body_rate": 0.005, "position": 0.02, "velocity": 0.05, "acceleration": 0.1,
    "rotor_speed": 1.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def flights():
    """Two noisy flights that head 60 degrees left of x, of which a drag at the rotors is hidden."""
    return dragged(0.0)


@pytest.fixture(scope="module")
def lively():
    """The same with fast swings next to the slow ones: of one swing drag and damping explain any delay."""
    return dragged(0.05)


def dragged(also):
    result = {"noise": NOISE, "also": also, "effects": {"rotor_drag": [DRAG]}, "integration_rate_hz": COARSE}
    flown_twice = (flown(20.0, seed=seed, **result) for seed in (1, 2))
    return [headed(signals_of(flight), 60.0) for flight in flown_twice]


def headed(signals, degrees):
    world = {name: getattr(signals, name) @ turned(degrees).T for name in ("position", "velocity", "acceleration")}
    return replace(signals, attitude=signals.attitude + np.array([0.0, 0.0, np.radians(degrees)]), **world)


def late(values, seconds):
    time = PERIOD * np.arange(len(values))
    return CubicSpline(time, values)(np.clip(time - seconds, time[0], time[-1]))


def turned(degrees):
    angle = np.radians(degrees)
    return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])


def to_body(signals, values):
    return np.einsum("tji,tj->ti", signals.rotation, values)


def sensing(signals):
    """Exchange the acceleration for what an accelerometer senses."""
    return replace(signals, acceleration=None, specific_force=to_body(signals, signals.acceleration + UP))


def low_passed(values, cut_off):
    return filtfilt(*butter(4, 2 * PERIOD * cut_off), values, axis=0)


def all_low_passed(signals, cut_off=18.0):
    names = ("attitude", "body_rate", "velocity", "position", "acceleration", "rotor_speed")
    return replace(signals, **{name: low_passed(getattr(signals, name), cut_off) for name in names})


def of_acceleration(change):
    return lambda s: replace(s, acceleration=change(s, s.acceleration))


def of_velocity(change):
    return lambda s: replace(s, velocity=change(s, s.velocity))


def of_accelerometer(change):
    return lambda s: replace(sensing(s), specific_force=change(s, sensing(s).specific_force))


WRONG = {
    "in g": (of_acceleration(lambda _, a: a / 9.80665), "The acceleration is in g"),
    "with gravity": (of_acceleration(lambda _, a: a + UP), "The acceleration includes gravity"),
    "reversed": (of_acceleration(lambda _, a: -a), "The acceleration has -x, -y, -z"),
    "body for world": (of_acceleration(to_body), "The acceleration is in body axes"),
    "late": (of_acceleration(lambda _, a: late(a, 0.03)), "The acceleration is late by"),
    "filtered at 5 Hz": (
        of_acceleration(lambda _, a: lfilter(*butter(1, 2 * PERIOD * 5.0), a, axis=0)),
        "The acceleration is late by",
    ),
    "sensed in g": (of_accelerometer(lambda _, f: f / 9.80665), "The accelerometer is in g"),
    "sensed without gravity": (of_accelerometer(lambda s, f: f - to_body(s, 0 * f + UP)), "lacks gravity"),
    "velocity in body axes": (of_velocity(to_body), "The velocity is in body axes"),
    "velocity in NED": (of_velocity(lambda _, v: v[:, [1, 0, 2]] * [1, 1, -1]), "The velocity has y, x, -z"),
    "velocity of another north": (of_velocity(lambda _, v: v @ turned(30).T), "The velocity is rotated by"),
    "velocity late": (of_velocity(lambda _, v: late(v, 0.1)), "The velocity is late by"),
    "velocity in km/h": (of_velocity(lambda _, v: 3.6 * v), "The velocity is in km/h"),
    "velocity with an offset": (of_velocity(lambda _, v: v - 0.3 * NORTH), "m/s along y, judged by"),
    "velocity with one in the body": (
        of_velocity(lambda s, v: v + 0.3 * s.rotation[:, :, 0]),
        "m/s along body x, judged by",
    ),
    "acceleration with an offset": (of_acceleration(lambda _, a: a + 0.4 * EAST), "m/s^2 along x, judged by"),
    "sensed with an offset": (of_accelerometer(lambda _, f: f + 0.4 * (NORTH - UP / 9.81)), "along body y and -0.4"),
    "attitude late": (lambda s: replace(s, attitude=late(s.attitude, 0.03)), "The attitude is late by"),
}


def is_late(sentence, what, delay_ms):
    """Whether a sentence says so of something, to half a millisecond: how many digits it has is its interval's."""
    found = re.search(rf"{what} late by ([\d.]+) ms", sentence)
    return found is not None and abs(float(found[1]) - delay_ms) < 0.5


@pytest.mark.parametrize("wrong", WRONG)
def test_a_channel_that_contradicts_two_others_is_set_right(flights, wrong):
    change, words = WRONG[wrong]
    found = audit([change(signals) for signals in flights], WINDOWS)
    [sentence] = found.settled
    assert words in sentence
    assert wrong != "attitude late" or is_late(sentence, "attitude is", 30)
    assert (found.warnings, found.named) == ((), ())
    channel = found.repairs[0].channel
    for signals in flights:
        given = sensing(signals) if channel == "specific_force" else signals
        repaired = getattr(found.repaired(change(signals)), channel)
        # What noise leaves of a shift by 30 ms is seen by windows of 400 ms.
        true, now = (WINDOWS.average(values) for values in (getattr(given, channel), repaired))
        logged = WINDOWS.average(getattr(change(signals), channel))
        left, before = (np.sqrt(((values - true) ** 2).mean()) for values in (now, logged))
        assert left < 0.3 * before


def test_channels_that_agree_are_left_alone(flights):
    for given in (flights, [sensing(signals) for signals in flights]):
        for part in (given, given[:1]):
            found = audit(part, WINDOWS)
            assert (found.repairs, found.warnings, found.filtered) == ((), (), ())
            assert found.repaired(part[0]) is part[0]


def levered(signals, arm):
    """Move the accelerometer off the centre of mass."""
    at = np.cross(signals.body_rate, arm)
    rise = np.gradient(low_passed(np.einsum("tij,tj->ti", signals.rotation, at), 10.0), PERIOD, axis=0)
    return replace(signals, acceleration=signals.acceleration + rise)


def leaning(signals, *, felt):
    """Turn the attitude about body y, and with it what an accelerometer feels."""
    sensed, turn = sensing(signals), Rotation.from_euler("y", 0.03).as_matrix()
    lean = replace(sensed, attitude=euler_angles(signals.rotation @ turn))
    return lean if felt else replace(lean, acceleration=accelerated(lean), specific_force=None)


def slow_error(signals, seed):
    """Draw errors that are forgotten after 2 s, each a standard deviation of 1."""
    kept, noise = np.exp(-PERIOD / 2.0), np.random.default_rng(seed).normal(size=(len(signals), 3))
    return lfilter([np.sqrt(1 - kept**2)], [1, -kept], noise, axis=0)


NO_OFFSET = {
    "accelerometer above the centre of mass": lambda s: levered(s, [0.0, 0.0, 0.1]),
    "accelerometer ahead of it": lambda s: levered(s, [0.1, 0.0, 0.0]),
    "attitude leans": lambda s: leaning(s, felt=False),
    "attitude leans above an accelerometer": lambda s: leaning(s, felt=True),
    "scales": lambda s: replace(s, velocity=1.01 * s.velocity, acceleration=1.01 * (s.acceleration + UP) - UP),
    "a little rotated in steady flight": lambda s: replace(
        s, position=s.position + 4.0 * np.outer(s.time, EAST), velocity=(s.velocity + 4.0 * EAST) @ turned(2.0).T
    ),
    "slow errors": lambda s: replace(
        s, velocity=s.velocity + 0.2 * slow_error(s, 1), acceleration=s.acceleration + 0.3 * slow_error(s, 2)
    ),
}


@pytest.mark.parametrize("like", NO_OFFSET)
def test_what_looks_like_a_constant_offset_is_none(flights, like):
    assert [each.channel for each in audit([NO_OFFSET[like](s) for s in flights], WINDOWS).repairs if each.offset] == []


def test_an_offset_of_one_flight_is_taken_off_that_one_alone(flights):
    first, other = flights
    wrong = replace(first, velocity=first.velocity + 0.3 * EAST, name="first")
    found = audit([wrong, other], WINDOWS)
    assert "offset of +0.30 m/s along x in first, judged by the position" in found.settled[0]
    for given, true in ((wrong, first), (other, other)):
        assert np.abs((found.repaired(given).velocity - true.velocity).mean(axis=0)).max() < 0.01


def test_an_offset_of_a_flight_that_is_held_out_is_taken_off_it(flights):
    first, other = flights
    wrong = replace(other, velocity=other.velocity - 0.5 * NORTH, name="held out")
    found = audit([first], WINDOWS).with_offsets([wrong], WINDOWS)
    assert "offset of -0.50 m/s along y, judged by the position" in found.settled[-1]
    assert np.abs((found.repaired(wrong).velocity - other.velocity).mean(axis=0)).max() < 0.01


def test_what_offsets_differ_by_is_said(flights):
    wrong = [replace(s, velocity=s.velocity + size * EAST) for s, size in zip(flights, (0.3, -0.7), strict=True)]
    (said,) = audit(wrong, WINDOWS).settled
    assert "offset of -0.7" in said
    assert " to +0.30 m/s along x, judged by" in said


def test_noise_of_the_position_is_no_offset_of_the_velocity(flights):
    rng = np.random.default_rng(5)
    for _ in range(6):
        noise = rng.normal(size=(len(flights[0]), 3))
        noisy = [replace(s, position=s.position + 0.5 * noise) for s in flights]
        assert not any(each.offset for each in audit(noisy, WINDOWS).repairs)


def test_the_noise_of_its_last_sample_is_no_change_of_a_velocity(flights):
    ends = [replace(s, velocity=s.velocity + (s.time == s.time[-1])[:, None]) for s in flights]
    wrong = [replace(s, acceleration=s.acceleration + 0.4 * EAST) for s in ends]
    found = audit(wrong, WINDOWS)
    for given, true in zip(wrong, flights, strict=True):
        assert np.abs((found.repaired(given).acceleration - true.acceleration).mean(axis=0)).max() < 0.015


def test_what_no_usual_mistake_explains_is_left_out(flights):
    broken = [replace(signals, acceleration=signals.acceleration[::-1].copy()) for signals in flights]
    found = audit(broken, WINDOWS)
    [sentence] = found.settled
    assert "The acceleration contradicts the velocity and thrust of the rotors" in sentence
    assert found.repaired(broken[0]).acceleration is None


def test_two_that_contradict_each_other_without_a_third_are_only_warned_of(flights):
    alone = [replace(s, position=None, rotor_speed=None, velocity=late(s.velocity, 0.1)) for s in flights]
    found = audit(alone, WINDOWS)
    assert found.repairs == ()
    assert any("velocity and acceleration" in warning and "early" in warning for warning in found.warnings)


@pytest.mark.parametrize("delay_s", [0.012, 0.06])
def test_a_velocity_that_comes_after_its_position_is_late_without_a_third(flights, delay_s):
    """An estimator makes one of the other, later; the other way round nobody knows which is wrong."""
    alone = [replace(s, rotor_speed=None, acceleration=None) for s in flights]
    found = audit([replace(s, velocity=late(s.velocity, delay_s)) for s in alone], WINDOWS)
    (repair,) = found.repairs
    assert (repair.channel, repair.delay_s) == ("velocity", pytest.approx(delay_s, abs=1e-3))
    early = audit([replace(s, position=late(s.position, delay_s)) for s in alone], WINDOWS)
    assert early.repairs == ()
    assert any("position and velocity" in warning and "early" in warning for warning in early.warnings)


def stated(signals, factor):
    """State a thrust factor that is wrong by a factor."""
    rotors = tuple(replace(each, thrust_factor_n_s2=factor * each.thrust_factor_n_s2) for each in VEHICLE.rotors)
    return replace(signals, vehicle=replace(VEHICLE, rotors=rotors))


@pytest.mark.parametrize("factor", [0.6, 1.8])
def test_an_accelerometer_that_feels_the_weight_lacks_no_gravity_where_the_stated_thrust_is_wrong(flights, factor):
    """It was said to lack gravity, by the thrust that then contradicted it."""
    alone = [replace(stated(sensing(each), factor), velocity=None, position=None) for each in flights]
    found = audit(alone, WINDOWS)
    assert not found.contradictions
    assert not any("gravity" in each for each in found.notes)


def test_a_velocity_that_is_late_is_set_right_under_a_wrong_thrust(flights):
    """The thrust contradicted it whatever was done, by 3.9 m/s^2 along z, so that nothing was."""
    wrong = [replace(stated(each, 1.4), velocity=late(each.velocity, 0.02), acceleration=None) for each in flights]
    found = audit(wrong, WINDOWS)
    assert not found.contradictions
    (repair,) = (each for each in found.repairs if each.channel == "velocity")
    assert repair.delay_s == pytest.approx(0.02, abs=0.003)


def test_a_late_gyroscope_is_not_taken_for_an_early_attitude(flights):
    found = audit([replace(signals, body_rate=late(signals.body_rate, 0.03)) for signals in flights], WINDOWS)
    assert [fault.name for fault in found.named] == ["channel_delay"]
    assert found.repairs == ()


def with_velocity_of_the_body(signals):
    """Let position and velocity agree, and turned by the attitude fit thrust and motion."""
    velocity = to_body(signals, signals.velocity)
    path = cumulative_trapezoid(velocity, dx=PERIOD, axis=0, initial=0)
    noise = 0.02 * np.random.default_rng(1).standard_normal(path.shape)
    return replace(signals, velocity=velocity, position=path + noise)


def test_a_position_knows_better_than_a_velocity_that_fits_in_body_axes(flights):
    given = [with_velocity_of_the_body(signals) for signals in flights]
    found = audit(given, WINDOWS)
    assert found.repairs == ()
    assert found.repaired(given[0]) is given[0]
    [said] = [each for each in (*found.warnings, *found.contradictions) if "so nothing is corrected" in each]
    assert "the velocity is in body axes" in said.lower()
    assert "which the position contradicts" in said
    alone = audit([replace(signals, position=None) for signals in given], WINDOWS)
    assert ["is in body axes" in sentence for sentence in alone.settled] == [True]


def test_thrust_knows_better_than_a_clock_that_a_wrong_velocity_asks_for(flights):
    found = audit([with_velocity_of_the_body(sensing(headed(signals, -60.0))) for signals in flights], WINDOWS)
    assert found.repairs == ()
    [said] = [warning for warning in found.warnings if "which the thrust of the rotors contradicts" in warning]
    assert "The accelerometer is late by" in said


def test_gyroscope_and_rotors_that_are_late_over_one_wire_are_set_right(lively):
    def wired(signals):
        return replace(
            sensing(signals), body_rate=late(signals.body_rate, 0.08), rotor_speed=late(signals.rotor_speed, 0.08)
        )

    found = audit([wired(signals) for signals in lively], WINDOWS)
    assert [fault.name for fault in found.named] == ["channel_delay"]
    [rotors] = found.repairs
    assert (rotors.channel, rotors.delay_s) == ("rotor_speed", pytest.approx(0.08, abs=0.004))


def leaned(*angles):
    return lambda signals: replace(signals, attitude=signals.attitude + np.array(angles))


def askew(turn):
    """Turn the axes of the body that an attitude is of."""
    matrix = Rotation.from_rotvec(turn).as_matrix()
    return lambda signals: replace(signals, attitude=euler_angles(signals.rotation @ matrix))


@pytest.mark.parametrize(
    ("change", "degrees"),
    [
        (askew([0.0, 0.03, 0.0]), [0.0, 1.72, 0.0]),
        (askew([0.02, 0.02, 0.03]), [1.15, 1.15, 1.72]),
        (leaned(0.03, 0.0, 0.0), [1.72, 0.0, 0.0]),
    ],
)
def test_an_attitude_that_leans_as_its_thrust_does_is_turned_back(flights, change, degrees):
    found = audit([change(signals) for signals in flights], WINDOWS)
    assert not found.named
    (sentence,) = found.settled
    assert sentence.startswith("The attitude is rotated relative to the vehicle, ")
    said = {axis: float(value) for value, axis in re.findall(r"([+-][\d.]+) deg about ([xyz])", sentence)}
    np.testing.assert_allclose([said.get(axis, 0.0) for axis in "xyz"], degrees, atol=0.15)
    again = found.repaired(change(flights[0]))
    np.testing.assert_allclose(again.attitude.mean(axis=0), flights[0].attitude.mean(axis=0), atol=0.003)


@pytest.mark.parametrize("turn", [[0.03, 0.0, 0.0], [0.0, 0.03, 0.0]])
def test_a_gyroscope_that_is_turned_leaves_the_attitude_as_it_is(flights, turn):
    turned_back = Rotation.from_rotvec(turn).inv()
    found = audit([replace(each, body_rate=turned_back.apply(each.body_rate)) for each in flights], WINDOWS)
    assert [each.name for each in found.named] == ["imu_misalignment"]
    assert not found.settled


@pytest.mark.parametrize("both", [True, False])
def test_an_accelerometer_is_askew_as_the_gyroscope_of_its_imu_is_where_it_leans_so(flights, both):
    turned_back, rng = Rotation.from_rotvec([0.03, -0.04, 0.02]).inv(), np.random.default_rng(1)

    def of_imu(signals):
        felt = np.einsum("tji,tj->ti", signals.rotation, signals.acceleration + UP)
        felt = felt + rng.normal(0.0, 0.1, felt.shape)
        read = turned_back.apply(felt) if both else felt
        return felt, replace(
            signals, acceleration=None, specific_force=read, body_rate=turned_back.apply(signals.body_rate)
        )

    true, logged = zip(*map(of_imu, flights), strict=True)
    found = audit(logged, WINDOWS)
    assert [each.name for each in found.named] == ["imu_misalignment"]
    assert [each.split(",")[0] for each in found.settled] == ["The accelerometer is rotated as the gyroscope is"][:both]
    again = found.repaired(logged[0]).specific_force
    np.testing.assert_allclose(again.mean(axis=0), true[0].mean(axis=0), atol=0.03)


def test_motion_that_is_late_with_the_attitude_is_set_right_with_it(lively):
    """As by motion capture: the attitude alone on the clock of the gyroscope contradicts velocity and position."""
    names = ("attitude", "position", "velocity", "acceleration")
    given = [replace(s, **{name: late(getattr(s, name), 0.08) for name in names}) for s in lively]
    found = audit(given, WINDOWS)
    assert [repair.channel for repair in found.repairs] == list(names)
    assert [repair.delay_s for repair in found.repairs] == [pytest.approx(0.08, abs=0.002)] * 4
    assert is_late(found.settled[0], "Attitude and motion are", 80)
    assert (found.warnings, found.named, found.contradictions) == ((), (), ())


def with_attitude_late(signals):
    return replace(signals, attitude=late(signals.attitude, 0.03))


SEVERAL = {
    "sign of the acceleration": (("acceleration has -x, -y, -z",), WRONG["reversed"][0]),
    "gravity": (("acceleration includes gravity",), WRONG["with gravity"][0]),
    "unit, delay": (
        ("acceleration is in g", "velocity is late by"),
        lambda s: WRONG["velocity late"][0](WRONG["in g"][0](s)),
    ),
    "two units": (
        ("velocity is in km/h", "acceleration is in g"),
        lambda s: WRONG["velocity in km/h"][0](WRONG["in g"][0](s)),
    ),
    "axes": (("velocity has y, x, -z",), WRONG["velocity in NED"][0]),
    "sign of the velocity, delay": (
        ("velocity has -x, y, z", "acceleration is late by"),
        lambda s: replace(s, velocity=s.velocity * [-1, 1, 1], acceleration=late(s.acceleration, 0.05)),
    ),
    "sign of the velocity, unit": (
        ("velocity has x, y, -z", "acceleration is in g"),
        lambda s: replace(WRONG["in g"][0](s), velocity=s.velocity * [1, 1, -1]),
    ),
    "offset": (
        ("acceleration has a constant offset of",),
        of_acceleration(lambda _, a: a + np.array([0.3, -0.2, 0.4])),
    ),
}


@pytest.mark.parametrize("several", SEVERAL)
def test_each_of_several_faults_is_set_right_and_nothing_else(flights, several):
    words, change = SEVERAL[several]
    found = audit([with_attitude_late(change(signals)) for signals in flights], WINDOWS)
    assert found.named == ()
    assert sum(is_late(settled, "attitude is", 30) for settled in found.settled) == 1
    for sentence in words:
        assert sum(sentence in settled for settled in found.settled) == 1
    assert len(found.settled) == 1 + len(words)


@pytest.mark.parametrize(
    ("position", "change", "words"),
    [
        (lambda p: late(p, 0.1), WRONG["in g"][0], "acceleration is in g, judged by the velocity"),
        (lambda p: 100 * p, WRONG["late"][0], "acceleration is late by"),
        (lambda p: 100 * p, WRONG["velocity late"][0], "velocity is late by"),
    ],
    ids=["late, in g", "in cm, late", "in cm, velocity late"],
)
def test_a_velocity_is_not_left_out_for_what_two_others_have_wrong(flights, position, change, words):
    wrong = [change(replace(signals, position=position(signals.position))) for signals in flights]
    found = audit(wrong, WINDOWS)
    [sentence] = found.settled
    assert words in sentence
    # Nothing corrects a position.
    assert any("position and velocity" in said for said in (*found.warnings, *found.contradictions))
    for given, true in zip(wrong, flights, strict=True):
        mended = found.repaired(given)
        for name, most in (("velocity", 0.05), ("acceleration", 0.1)):
            now, known = (WINDOWS.average(getattr(each, name)) for each in (mended, true))
            assert np.sqrt(((now - known) ** 2).mean()) < most


def jumping(signals, degrees, at):
    """Let an estimator reset its yaw at a time, s."""
    return replace(signals, attitude=signals.attitude + np.outer(signals.time > at, [0.0, 0.0, np.radians(degrees)]))


@pytest.mark.parametrize("jumps", [[(8.03, 60.0)], [(8.03, -40.0), (14.0, 30.0)]], ids=["one", "two"])
def test_an_attitude_that_jumps_is_said_to_and_no_column_is_suspected(flights, jumps):
    first, other = flights
    for at, degrees in jumps:
        first = jumping(first, degrees, at)
    said = audit([first, other], WINDOWS).contradictions
    found = [re.search(r"jumps by (-?\d+) deg about body z \(yaw\) at ([\d.]+) s", each) for each in said]
    assert len(said) == len(jumps)
    for (at, degrees), (moment, angle) in zip(
        jumps, sorted((float(each[2]), float(each[1])) for each in found), strict=True
    ):
        assert moment == pytest.approx(at, abs=0.15)
        assert angle == pytest.approx(degrees, abs=3.0)


def test_rates_that_are_derived_across_a_full_turn_are_said_to_be_wrong(flights):
    first, other = flights
    spike = np.zeros_like(first.body_rate)
    at = int(np.searchsorted(first.time, 8.0))
    spike[at : at + 2, 2] = np.pi / first.period
    [said] = audit([replace(first, body_rate=first.body_rate + spike), other], WINDOWS).contradictions
    assert re.search(r"the body rate turns by 360 deg about body z \(yaw\) at (7\.9|8\.0) s", said)
    assert "leave body_rate out" in said


def test_a_turn_that_a_gyroscope_at_its_limit_misses_is_no_derivative_of_an_angle(flights):
    first, other = flights
    turn = np.outer(np.clip((first.time - 8.0) / 0.1, 0.0, 1.0), [0.0, 0.0, np.radians(240)])
    [said] = audit([replace(first, attitude=first.attitude + turn), other], WINDOWS).contradictions
    assert "the body rate turns by -2" in said
    assert said.endswith("a gyroscope at its limit or a spike: keep what is before it or after it by import.crop_s")


def test_a_gyroscope_of_another_sign_is_no_jump(flights):
    wrong = [replace(each, body_rate=each.body_rate * [1, 1, -1]) for each in flights]
    [said] = audit(wrong, WINDOWS).contradictions
    assert "opposite signs" in said


def test_rotors_and_attitude_that_are_late_are_both_set_right(lively):
    given = with_rotors_late([with_attitude_late(signals) for signals in lively], 0.05, 0.05)
    found = audit(given, WINDOWS)
    assert found.named == ()
    assert {repair.channel: repair.delay_s for repair in found.repairs} == {
        "attitude": pytest.approx(0.03, abs=0.002),
        "rotor_speed": pytest.approx(0.05, abs=0.004),
    }


@pytest.mark.parametrize("channel", ["attitude", "body_rate"])
def test_whatever_rotors_show_the_one_that_comes_after_the_other_is_late(flights, channel):
    commanded = [replace(s, commanded=True, **{channel: late(getattr(s, channel), 0.03)}) for s in flights]
    found = audit(commanded, WINDOWS)
    assert [is_late(sentence, "attitude is", 30) for sentence in found.settled] == [True] * (channel == "attitude")
    assert [fault.name for fault in found.named] == ["channel_delay"] * (channel == "body_rate")


def with_rotors_late(flights, *delays):
    return [replace(s, rotor_speed=late(s.rotor_speed, by)) for s, by in zip(flights, delays, strict=True)]


@pytest.mark.parametrize(("delay", "words"), [(0.05, "late by"), (0.14, "late by"), (-0.08, "early by")])
def test_rotors_on_another_clock_are_set_right(lively, delay, words, tmp_path):
    given = with_rotors_late(lively, delay, delay)
    found = audit(given, WINDOWS)
    [sentence] = found.settled
    assert f"The rotor speeds are {words}" in sentence
    assert found.repairs[0].delay_s == pytest.approx(delay, abs=0.004)
    assert (found.warnings, found.named) == ((), ())
    true, now, before = (WINDOWS.average(s.rotor_speed) for s in (lively[0], found.repaired(given[0]), given[0]))
    assert np.abs(now - true).mean() < 0.1 * np.abs(before - true).mean()
    again = read_again(found, tmp_path)
    np.testing.assert_array_equal(again.repaired(given[0]).rotor_speed, found.repaired(given[0]).rotor_speed)


def test_rotors_on_the_clock_of_the_gyroscope_and_commands_ahead_of_the_motion_stay(lively):
    assert audit(lively, WINDOWS).repairs == ()
    found = audit([replace(s, body_rate=late(s.body_rate, 0.05)) for s in lively], WINDOWS)
    assert [fault.name for fault in found.named] == ["channel_delay"]
    assert found.repairs == ()
    ahead = [replace(signals, commanded=True) for signals in with_rotors_late(lively, -0.05, -0.05)]
    assert audit(ahead, WINDOWS).repairs == ()
    assert audit(with_rotors_late(lively, 0.05, 0.09), WINDOWS).repairs == ()


def test_the_effect_is_named_in_spite_of_late_rotors(lively):
    found = answer(*with_rotors_late(lively, 0.05, 0.05))
    assert (found.verdict, [effect.name for effect in found.effects]) == ("NAMED", ["rotor_drag"])
    assert found.effects[0].numbers[0].value == pytest.approx(DRAG, rel=0.05)
    assert "The rotor speeds are late" in found.notes[0]


def test_what_was_made_of_the_accelerometer_follows_its_repair(flights):
    def logged(signals):
        wrong = replace(sensing(signals), specific_force=sensing(signals).specific_force / 9.80665)
        return replace(wrong, acceleration=np.einsum("tij,tj->ti", wrong.rotation, wrong.specific_force) - UP)

    found = audit([logged(signals) for signals in flights], WINDOWS)
    assert ["The accelerometer is in g" in sentence for sentence in found.settled] == [True]
    np.testing.assert_allclose(found.repaired(logged(flights[0])).acceleration, flights[0].acceleration, atol=1e-9)


def read_again(found, folder):
    """Write an audit with a model, and read it."""
    extended = gap_artifacts.extended()
    model = replace(extended.model, repairs=found)
    store.write(
        folder / "extended.h5", replace(extended, model=model), store.Origin(stage="extend", config="seed: 1\n")
    )
    return store.read(folder / "extended.h5", Extended)[0].model.repairs


def test_repairs_come_back_from_an_artifact(flights, tmp_path):
    given = [WRONG["velocity in NED"][0](signals) for signals in flights]
    found = audit(given, WINDOWS)
    again = read_again(found, tmp_path)
    assert again.settled == found.settled
    np.testing.assert_array_equal(again.repaired(given[0]).velocity, found.repaired(given[0]).velocity)


def answer(training, held):
    recordings = [replace(training, name="training")], [replace(held, name="held out")]
    return diagnose(*recordings, GapSettings(), np.random.default_rng(1)).diagnosis


@pytest.mark.parametrize("wrong", ["in g", "with gravity", "late", "filtered at 5 Hz", "attitude late"])
def test_the_effect_is_named_in_spite_of_a_wrong_channel(flights, wrong):
    change, words = WRONG[wrong]
    found = answer(*(change(signals) for signals in flights))
    assert (found.verdict, [effect.name for effect in found.effects]) == ("NAMED", ["rotor_drag"])
    assert found.effects[0].numbers[0].value == pytest.approx(DRAG, rel=0.05)
    assert words in found.notes[0]
    assert np.nanmax(found.gap.before_floors) < 20


@pytest.mark.parametrize("turn", [[0.03, 0.02, 0.0], [0.0, 0.03, 0.0]])
def test_the_effect_is_named_in_spite_of_an_attitude_that_leans(flights, turn):
    found = answer(*map(askew(turn), flights))
    assert (found.verdict, [effect.name for effect in found.effects]) == ("NAMED", ["rotor_drag"])
    assert found.effects[0].numbers[0].value == pytest.approx(DRAG, rel=0.05)


def test_a_low_passed_log_has_the_floors_of_the_raw_one_and_says_so_first(flights):
    raw, filtered = answer(*flights), answer(*(all_low_passed(signals) for signals in flights))
    assert (filtered.verdict, [effect.name for effect in filtered.effects]) == ("NAMED", ["rotor_drag"])
    assert "low-passed, by import.lowpass_hz or earlier: attitude at about 1" in filtered.notes[0]
    assert "Use raw logs" in filtered.notes[0]
    assert not any("low-passed" in note for note in raw.notes)
    ratio = filtered.gap.floor / raw.gap.floor
    assert np.all((ratio > 0.6) & (ratio < 2.0))


def test_a_log_without_noise_has_no_floor_that_is_known():
    assert "noise floor is not known" in audit([signals_of(flown(8.0))], WINDOWS).filtered[0]


def read_with_repeats(flight, updates_hz, channels, late_s):
    """Read a flight whose rows repeat updates of some channels, of which the velocity is late."""
    stamps = np.arange(flight.time[0], flight.time[-1], 1 / updates_hz)
    last = np.searchsorted(stamps, flight.time, side="right") - 1
    names = ("time", "attitude", "body_rate", "position", "velocity", "acceleration", "rotor_speed")
    known = {name: getattr(flight, name) for name in names}
    for name in channels:
        taken = np.maximum(stamps - (late_s if name == "velocity" else 0.0), stamps[0])
        known[name] = CubicSpline(flight.time, known[name])(taken)[last]
    slow = {"updated_hz": dict.fromkeys(channels, updates_hz), "repeated": channels}
    return recordings.signals_of(recordings.ReadFlight("flight.csv", known, {}, (), **slow), known, STUDY)[0]


@pytest.mark.parametrize("updates_hz", [5.0, 10.0])
@pytest.mark.parametrize("channels", [("velocity",), ("velocity", "position")])
@pytest.mark.parametrize("late_s", [0.0, 0.06])
def test_a_velocity_that_rows_repeat_is_as_late_as_it_was_measured(lively, updates_hz, channels, late_s):
    """What they repeat looked late by half the time between two updates, and its steps like another scale."""
    made = [read_with_repeats(flight, updates_hz, channels, late_s) for flight in lively]
    found = [(repair.channel, repair.dropped) for repair in audit(made, WINDOWS).repairs]
    assert found == ([("velocity", False)] if late_s else [])
    for repair in audit(made, WINDOWS).repairs:
        assert repair.delay_s == pytest.approx(late_s, abs=0.01)
