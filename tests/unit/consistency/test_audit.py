"""The audit of sensors, axes and faults."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from cpfls_cli.consistency.channels import gyroscope_apart
from cpfls_cli.consistency.check import audit, check
from cpfls_cli.consistency.gyroscope import GyroFit
from cpfls_cli.consistency.rotors import impossible
from cpfls_cli.consistency.sensors import CheckedFault, findings, sensors_of
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals, stretch_of
from cpfls_cli.flightlog.smoothing import low_pass
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.rotations import body_rate
from cpfls_cli.vehicle.rotors import body_wrench
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import windows
from tests.builders.closed_loop_flights import COARSE, flown, signals_of
from tests.builders.faulty_gyroscopes import LEVELS, Faults, faulty_flight

WINDOWS = windows(0.01, 0.4, 0.5)
UP = np.array([0, 0, 9.81])
FAULTS = {"gyro_bias", "gyro_scale", "imu_misalignment", "channel_delay"}
TIME = np.arange(2000) / 250
NAMES = ("gyro_bias", "gyro_scale", "imu_misalignment", "channel_delay")


@pytest.fixture(scope="module")
def turning():
    return faulty_flight(np.random.default_rng(0), Faults(), LEVELS["mid"], duration=40.0)


def moved(signals, amplitude=2.0):
    """Position, velocity and acceleration of one motion, by hand."""
    speed = 2 * np.pi * np.array([0.2, 0.27, 0.15])
    phase = speed * signals.time[:, None]
    return replace(
        signals,
        position=amplitude * np.sin(phase),
        velocity=amplitude * speed * np.cos(phase),
        acceleration=-amplitude * speed**2 * np.sin(phase),
    )


def test_without_attitude_nothing_is_tested(turning):
    found = audit([replace(turning, attitude=None)], WINDOWS)
    assert (found.findings, set(found.untested)) == ((), FAULTS)
    assert found.repaired(turning) is turning


def test_too_short_a_flight_is_not_tested():
    found = audit([faulty_flight(np.random.default_rng(0), Faults(), LEVELS["mid"], duration=5.0)], WINDOWS)
    assert (found.findings, set(found.untested.values())) == ((), {"the flights are too short"})


@pytest.mark.parametrize("seed", [3, 5, 6])
def test_a_flight_that_rests_for_most_of_its_time_hardly_turns(seed):
    """Without the few seconds in which it turns noise is all there is, which may tell of mirrored axes."""
    rng = np.random.default_rng(seed)
    flight = faulty_flight(rng, Faults(), LEVELS["high"], duration=12.0)
    count = 60 * len(flight)
    still = {name: 0.01 * rng.standard_normal((count, 3)) for name in ("attitude", "body_rate")}
    both = {name: np.concatenate([values, getattr(flight, name)]) for name, values in still.items()}
    time = flight.period * np.arange(count + len(flight))
    found = audit([replace(flight, time=time, **both)], WINDOWS)
    assert found.named == ()
    assert "the flights barely rotate, so it would not show" in found.untested.values()


def integrated(signals):
    steps = Rotation.from_rotvec(0.5 * (signals.body_rate[1:] + signals.body_rate[:-1]) * signals.period)
    turned = [Rotation.identity()]
    for step in steps:
        turned.append(turned[-1] * step)
    return replace(signals, attitude=np.unwrap(Rotation.concatenate(turned).as_euler("ZYX")[:, ::-1], axis=0))


def test_an_attitude_integrated_from_the_gyroscope_shows_its_bias_and_no_scale(turning):
    found = audit([integrated(turning)], WINDOWS)
    assert {"gyro_scale", "imu_misalignment"} <= set(found.untested)
    assert found.named == ()
    estimated = integrated(turning)
    found = audit([replace(estimated, body_rate=estimated.body_rate + np.array([0.02, 0, 0]))], WINDOWS)
    assert [finding.name for finding in found.named] == ["gyro_bias"]
    assert "+0.0200 rad/s about x" in found.named[0].sentence


def test_swapped_and_turned_axes_of_the_gyroscope_are_a_contradiction_not_a_fault(turning):
    swapped = audit([replace(turning, body_rate=turning.body_rate[:, [1, 0, 2]])], WINDOWS)
    turned = audit([replace(turning, body_rate=turning.body_rate * [1, -1, -1])], WINDOWS)
    assert swapped.findings == turned.findings == ()
    assert any("axes are swapped" in sentence for sentence in swapped.contradictions)
    assert [sentence.split(" the ")[0] for sentence in turned.contradictions] == [
        "about body y (pitch)",
        "about body z (yaw)",
    ]
    assert all("opposite signs" in sentence for sentence in turned.contradictions)
    assert set(turned.untested) == FAULTS


def test_channels_that_agree_are_not_warned_about(turning):
    found = audit([moved(turning)], WINDOWS)
    assert (found.warnings, found.contradictions) == ((), ())
    exact = [check for check in sensors_of([moved(turning)], WINDOWS).motion.checks if check.pair.exact]
    assert {check.pair.words for check in exact} == {"position and velocity", "velocity and acceleration"}
    np.testing.assert_allclose([check.scale for check in exact], 1.0, atol=1e-3)
    np.testing.assert_allclose([check.delay.value for check in exact], 0.0, atol=1e-3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: replace(s, velocity=1.5 * s.velocity, acceleration=1.5 * s.acceleration), "factor of 1.50"),
        (lambda s: replace(s, velocity=s.velocity[:, [1, 0, 2]], acceleration=None), "axes are swapped"),
        (lambda s: replace(s, velocity=s.velocity * [1, -1, -1], acceleration=None), "opposite signs along y"),
        (lambda s: replace(s, position=None, acceleration=s.acceleration + 0.5 * UP), "gravity"),
        (lambda s: replace(s, position=np.roll(s.position, 6, axis=0), acceleration=None), "early by (59|60)\\."),
        (lambda s: replace(s, velocity=s.velocity[::-1] ** 2 - 2.0, acceleration=None), "do not match"),
    ],
)
def test_channels_that_disagree_are_warned_about(turning, change, words):
    found = audit([change(moved(turning))], WINDOWS)
    assert any(re.search(words, sentence) for sentence in (*found.warnings, *found.contradictions))


def test_noise_of_a_hover_is_not_taken_for_disagreement(turning):
    rng = np.random.default_rng(1)
    noisy = replace(
        turning,
        position=rng.normal(0, 0.05, turning.body_rate.shape),
        velocity=rng.normal(0, 0.15, turning.body_rate.shape),
        acceleration=rng.normal(0, 0.5, turning.body_rate.shape),
    )
    assert audit([noisy], WINDOWS).warnings == ()


def test_the_accelerometer_is_compared_with_the_velocity(turning):
    flying = moved(turning)
    felt = np.einsum("tji,tj->ti", flying.rotation, flying.acceleration + UP)
    good, bad = (audit([replace(flying, specific_force=sign * felt)], WINDOWS) for sign in (1, -1))
    assert (good.warnings, good.settled) == ((), ())
    assert any("accelerometer has its sign reversed" in sentence for sentence in bad.settled)


def test_constant_clipped_and_rounded_channels_are_named(turning):
    rate = turning.body_rate.copy()
    rate[:, 0] = np.clip(rate[:, 0], -1.0, 1.0)
    rate[:, 1] = np.round(rate[:, 1] / 0.05) * 0.05
    result = " ".join(audit([replace(turning, body_rate=rate, voltage=np.ones(len(turning)))], WINDOWS).warnings)
    assert "about x is clipped at 1 rad/s" in result
    assert "about y is rounded to steps of 0.05 rad/s" in result
    assert "The channel voltage never changes" in result


def test_a_slow_rounded_gyroscope_is_not_called_clipped():
    for seed in range(20):
        still = faulty_flight(
            np.random.default_rng(seed), Faults(), LEVELS["low"], coloured=True, amplitude=(0.004, 0.004, 0.004)
        )
        assert audit([still], WINDOWS).warnings == ()


@pytest.mark.parametrize(("commanded", "whom"), [(True, "commands"), (False, "logged torque")])
def test_the_motion_follows_the_torque(turning, commanded, whom):
    clean = faulty_flight(np.random.default_rng(3), Faults(), duration=20.0)
    momentum = clean.body_rate @ np.diag(clean.vehicle.inertia_kg_m2)
    torque = np.gradient(momentum, clean.time, axis=0) + np.cross(clean.body_rate, momentum)
    early = np.roll(torque, -5, axis=0)
    (note,) = audit([replace(clean, stated_torque=early, commanded=commanded)], WINDOWS).notes
    # Of an interval that is narrower than a millisecond the digits are shown.
    says = re.fullmatch(rf"The motion follows the {whom} by (\d+\.\d+) ms \[(\d+\.\d+), (\d+\.\d+)\]\.", note)
    delay, low, high = map(float, says.groups())
    assert low < delay < high
    assert delay == pytest.approx(50.0, abs=0.1)
    assert not any("follows" in note for note in audit([turning], WINDOWS).notes)
    # Behind measured speeds it may be the autopilot that comes first.
    measured = replace(clean, stated_torque=early, rotor_speed=np.full((len(early), 4), 500.0))
    assert not any("follows" in note for note in audit([measured], WINDOWS).notes)


def test_a_torque_that_moves_nothing_shows_no_delay(turning):
    noise = np.random.default_rng(4).normal(size=turning.body_rate.shape)
    for torque in (noise, np.zeros_like(noise)):
        assert audit([replace(turning, stated_torque=torque)], WINDOWS).notes == ()


def test_rotors_that_hold_one_speed_are_named(turning):
    speed = np.full((len(turning), 4), 348.0)
    # But for the rounding of a sum, which is not the same in all rows on every processor.
    assert body_wrench(turning.vehicle, speed).thrust.std() < 1e-12
    result = audit([replace(turning, rotor_speed=speed)], WINDOWS).warnings
    assert sum("rotor speed" in sentence for sentence in result) == 4


def test_of_a_part_of_a_flight_the_rotors_are_held_against_the_whole():
    """A third of a flight may leave open what all of it shows; `cpfls vehicle` looks at all of it."""
    signals = signals_of(flown(12.0, integration_rate_hz=COARSE))
    swapped = replace(signals, rotor_speed=signals.rotor_speed[:, [1, 0, 2, 3]])
    part = stretch_of(swapped, slice(0, 300))
    assert audit([part], WINDOWS).contradictions == ()
    (result,) = audit([part], WINDOWS, [swapped]).contradictions
    assert result.startswith("judged by the motion, the rotors are")


def test_a_delay_that_runs_away_is_no_repair():
    """Shifted beyond the flight a channel stands still, and the next delay had no bound: an array of exabytes."""
    noise = {"body_rate": 0.01, "attitude": 0.003, "velocity": 0.02, "position": 0.005, "acceleration": 0.1}
    flights = [
        signals_of(flown(20.0, seed=seed, noise=noise, also=0.05, integration_rate_hz=COARSE)) for seed in (3, 13)
    ]
    found = audit([replace(signals, position=1e3 * signals.position) for signals in flights], WINDOWS)
    assert any("is the position in mm" in sentence for sentence in found.contradictions)


def log(sizes=(0.4, 0.35, 0.8), noise=0.0, held=1):
    """A flight of one tone about each angle; an attitude that is held is logged at a lower rate, in steps."""
    sizes, frequency = np.array(sizes), np.array([5.1, 4.3, 1.7])
    angle = frequency * TIME[:, None] + [0.0, 1.3, 2.1]
    attitude, rate = sizes * np.sin(angle), sizes * frequency * np.cos(angle)
    gyro = body_rate(attitude, rate) + noise * np.random.default_rng(7).standard_normal(attitude.shape)
    stepped = attitude[np.arange(len(attitude)) // held * held]
    return Signals(time=TIME, vehicle=VehicleSettings(), attitude=stepped, body_rate=gyro)


def turned(signals, signs):
    return replace(signals, body_rate=signals.body_rate * np.array(signs))


def found(signals, words="barely agree"):
    return [finding for finding in check([signals], GapSettings()) if words in finding.what]


@pytest.mark.parametrize("lowpass_hz", [None, 8.0])
@pytest.mark.parametrize("signals", [log(), log(noise=0.3, held=5)], ids=["clean", "noisy gyroscope, held attitude"])
def test_one_motion_is_not_warned_of(signals, lowpass_hz):
    filtered = {name: low_pass(getattr(signals, name), 250.0, lowpass_hz, 4) for name in ("attitude", "body_rate")}
    assert found(replace(signals, **filtered)) == []


@pytest.mark.parametrize("signal", ["attitude", "body_rate"])
def test_swapped_roll_and_pitch_are_named_with_axis_and_key(signal):
    signals = log(noise=0.1)
    result = found(replace(signals, **{signal: getattr(signals, signal)[:, [1, 0, 2]]}))
    assert [each.what.split(" the ")[0] for each in result[:2]] == ["about body x (roll)", "about body y (pitch)"]
    assert all("check columns, signs and frames of import.signals.attitude" in each.remedy for each in result)
    assert all("import.signals.body_rate" in each.remedy for each in result)
    assert all(each.contradiction and not each.repairable for each in result)


@pytest.mark.parametrize(("axis", "words"), [(0, "x (roll)"), (1, "y (pitch)"), (2, "z (yaw)")])
def test_a_wrong_sign_is_found_about_its_axis_alone(axis, words):
    (result,) = found(turned(log(noise=0.1), [-1.0 if each == axis else 1.0 for each in range(3)]))
    assert words in result.what
    assert "opposite signs" in result.what
    assert result.size == pytest.approx(-1.0, abs=0.05)


def test_an_attitude_and_a_gyroscope_that_disagree_are_found_where_they_move():
    """An attitude in FRD against NED of a gyroscope in FLU: pitch and yaw have the other sign."""
    signals = log()
    assert len(found(replace(signals, attitude=signals.attitude * [1.0, -1.0, -1.0]))) == 2
    assert len(found(turned(log(), [1.0, 0.0, 1.0]))) == 1
    assert found(log(sizes=(0.001, 0.001, 0.001), noise=0.05)) == []
    assert not any("yaw" in each.what for each in found(turned(log(sizes=(0.01, 0.9, 0.001)), [1.0, 1.0, 0.0])))


def gains(signals):
    return found(signals, "times the attitude's derivative")


@pytest.mark.parametrize("noise", [0.0, 0.3])
@pytest.mark.parametrize(
    ("factor", "unit"), [(180 / np.pi, "deg/s"), (np.pi / 180, "rad/s")], ids=["taken for rad/s", "taken for deg/s"]
)
def test_rates_in_the_other_unit_are_named_by_their_gain(factor, unit, noise):
    result = gains(turned(log(noise=noise), [factor] * 3))
    assert [each.what.split(" the ")[0] for each in result] == [
        "about body x (roll)",
        "about body y (pitch)",
        "about body z (yaw)",
    ]
    np.testing.assert_allclose([each.size for each in result], factor, rtol=0.1 if noise else 0.005)
    assert all(f"does the log give rates in {unit} (import.signals.body_rate.unit" in each.remedy for each in result)
    assert all(each.contradiction for each in result)


@pytest.mark.parametrize(("gain", "warned"), [(0.45, True), (0.55, False), (1.9, False), (2.1, True)])
def test_a_gain_between_a_half_and_two_is_let_pass(gain, warned):
    result = gains(turned(log(), [1.0, gain, 1.0]))
    assert len(result) == warned
    assert all("about body y (pitch)" in each.what and "check the units" in each.remedy for each in result)


def test_noise_alone_is_no_gain():
    assert (gains(log(noise=0.3, held=5)), gains(log(noise=5.0))) == ([], [])


def gentle(noise):
    """Rates of windows by an attitude as noisy as that, and by a gyroscope: below what is judged axis by axis."""
    motion, other = 0.04 * np.random.default_rng(3).standard_normal((2, 800, 3))
    return motion + noise * other, motion


@pytest.mark.parametrize("noise", [0.0, 1.5, 2.5])
@pytest.mark.parametrize(("degrees", "words"), [(180 / np.pi, "about 180/pi"), (np.pi / 180, "about pi/180")])
def test_a_unit_of_a_gyroscope_is_said_beneath_noise_that_hides_its_motion(noise, degrees, words):
    seen, read = gentle(noise)
    _, scaled = gyroscope_apart(seen, degrees * read)
    assert [words in each.what for each in scaled] == [True] * 3
    assert gyroscope_apart(seen, read)[1] == ()


def test_what_does_not_follow_the_attitude_shows_no_unit():
    seen, _ = gentle(0.0)
    other = 0.04 * np.random.default_rng(5).standard_normal(seen.shape)
    assert gyroscope_apart(seen, other * np.pi / 180) == ((), ())


def fit(place=0, value=0.0, error=1e-4, pull=0.0, blocks=21):
    values, errors, pulls = np.zeros(13), np.full(13, error), np.zeros(13)
    values[place], pulls[place] = value, pull
    nothing = np.zeros((1, 3))
    return GyroFit(values, errors, pulls, np.ones(13, dtype=bool), blocks, np.ones(3), nothing, nothing)


def checked(fitted, names=NAMES):
    return [CheckedFault(CATALOGUE[name], fitted.of(CATALOGUE[name].test.estimate)) for name in names]


def named(fitted, period=0.01):
    return [finding.name for finding in findings(checked(fitted), period) if finding.named]


@pytest.mark.parametrize(
    ("place", "small", "large", "name"),
    [
        (0, 0.0014, 0.0016, "gyro_bias"),
        (4, 0.0029, 0.0031, "gyro_scale"),
        (8, 0.0024, 0.0026, "imu_misalignment"),
        (12, 0.0019, 0.0021, "channel_delay"),
    ],
)
def test_significant_but_small_is_not_named(place, small, large, name):
    assert (named(fit(place, -small)), named(fit(place, -large))) == ([], [name])


def test_a_delay_must_exceed_a_fifth_of_a_sample():
    assert (named(fit(12, 0.003), period=0.01), named(fit(12, 0.003), period=0.02)) == (["channel_delay"], [])


def test_the_first_of_ten_counts_ten_times():
    [bias, *_] = findings(checked(fit(0, 0.01075, error=0.005)), 0.01)
    assert bias.p_value == pytest.approx(10 * 2 * stats.t.sf(2.0, 20))
    [alone] = findings(checked(fit(0, 0.01075, error=0.005), ("gyro_bias",)), 0.01)
    assert alone.p_value == pytest.approx(3 * 2 * stats.t.sf(2.0, 20))


def test_what_noise_can_have_pulled_does_not_count():
    assert (named(fit(3, 0.02, pull=0.0)), named(fit(3, 0.02, pull=0.02))) == (["gyro_scale"], [])
    [scale] = findings(checked(fit(3, 0.02, pull=0.01), ("gyro_scale",)), 0.01)
    assert scale.coefficients[0].high == pytest.approx(0.02 + 0.01 + 1e-4 * stats.t.ppf(0.975, 20))


def test_sentences_say_which_way():
    say = {
        f.name: f.sentence
        for place, v in ((3, 0.02), (12, -0.005))
        for f in findings(checked(fit(place, v)), 0.01)
        if f.named
    }
    assert say["gyro_scale"] == "The gyroscope reads 2 % too much about x."
    assert say["channel_delay"] == "The gyroscope runs 5 ms ahead of the attitude."


@pytest.mark.parametrize(
    ("ratios", "suspect"),
    [
        ({"inertia_z": 1 / 29}, "drag_factor_n_m_s2 of vehicle.rotors looks 29 times too small"),
        ({"inertia_z": 12.0}, "drag_factor_n_m_s2 of vehicle.rotors looks 12 times too large"),
        ({"inertia_z": -1.0}, "spin of vehicle.rotors"),
        ({"thrust_scale": 6.0}, "thrust_factor_n_s2 of vehicle.rotors looks 6 times too small, or mass_kg 6 times too"),
        ({"thrust_scale": -1.0}, "the sign and frame of the acceleration"),
        ({"thrust_scale": 0.011, "inertia_z": 91.0}, "the rotor speeds look 9.53 times too large"),
        ({f"inertia_{axis}": 1 / 57.3 for axis in "xyz"}, "the gyroscope looks 57.3 times too large"),
        ({"inertia_x": 4.0}, "inertia_kg_m2 about this axis and position_m"),
        (
            {"inertia_x": 4.0, "inertia_z": 9.0},
            "check the signs, units and order of the gyroscope's and the rotors' columns",
        ),
        ({"inertia_x": -4.0, "inertia_z": 9.0}, "check the signs and order of the gyroscope's and the rotors' columns"),
    ],
)
def test_numbers_that_no_vehicle_has_name_the_suspect(ratios, suspect):
    findings = impossible(ratios)
    assert len(findings) == len(ratios)
    assert all(suspect in each.remedy and each.contradiction for each in findings)
