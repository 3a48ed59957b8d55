"""A gyroscope is held against the attitude: one motion, in one unit, about each body axis."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.consistency.axes import gyroscope_apart
from cpfls_cli.consistency.check import check
from cpfls_cli.effects.signals import Signals
from cpfls_cli.flightlog.smoothing import low_pass
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.rotations import body_rate
from cpfls_cli.vehicle.settings import VehicleSettings

TIME = np.arange(2000) / 250


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
    told = found(replace(signals, **{signal: getattr(signals, signal)[:, [1, 0, 2]]}))
    assert [each.what.split(" the ")[0] for each in told[:2]] == ["about body x (roll)", "about body y (pitch)"]
    assert all("check columns, signs and frames of import.signals.attitude" in each.remedy for each in told)
    assert all("import.signals.body_rate" in each.remedy for each in told)
    assert all(each.contradiction and not each.repairable for each in told)


@pytest.mark.parametrize(("axis", "words"), [(0, "x (roll)"), (1, "y (pitch)"), (2, "z (yaw)")])
def test_a_wrong_sign_is_found_about_its_axis_alone(axis, words):
    (told,) = found(turned(log(noise=0.1), [-1.0 if each == axis else 1.0 for each in range(3)]))
    assert words in told.what
    assert "opposite signs" in told.what
    assert told.size == pytest.approx(-1.0, abs=0.05)


def test_an_attitude_in_other_axes_than_the_gyroscope_is_found():
    """An attitude in FRD against NED of a gyroscope in FLU: pitch and yaw have the other sign."""
    signals = log()
    assert len(found(replace(signals, attitude=signals.attitude * [1.0, -1.0, -1.0]))) == 2


def test_a_gyroscope_that_stands_still_in_a_flight_that_moves_is_found():
    assert len(found(turned(log(), [1.0, 0.0, 1.0]))) == 1


def test_an_axis_that_hardly_turns_is_not_judged():
    assert found(log(sizes=(0.001, 0.001, 0.001), noise=0.05)) == []
    still = turned(log(sizes=(0.01, 0.9, 0.001)), [1.0, 1.0, 0.0])
    assert not any("yaw" in each.what for each in found(still))


def gains(signals):
    return found(signals, "times the attitude's derivative")


@pytest.mark.parametrize("noise", [0.0, 0.3])
@pytest.mark.parametrize(
    ("factor", "unit"), [(180 / np.pi, "deg/s"), (np.pi / 180, "rad/s")], ids=["taken for rad/s", "taken for deg/s"]
)
def test_rates_in_the_other_unit_are_named_by_their_gain(factor, unit, noise):
    told = gains(turned(log(noise=noise), [factor] * 3))
    assert [each.what.split(" the ")[0] for each in told] == [
        "about body x (roll)",
        "about body y (pitch)",
        "about body z (yaw)",
    ]
    np.testing.assert_allclose([each.size for each in told], factor, rtol=0.1 if noise else 0.005)
    assert all(f"does the log give rates in {unit} (import.signals.body_rate.unit" in each.remedy for each in told)
    assert all(each.contradiction for each in told)


@pytest.mark.parametrize(("gain", "warned"), [(0.45, True), (0.55, False), (1.9, False), (2.1, True)])
def test_a_gain_between_a_half_and_two_is_let_pass(gain, warned):
    told = gains(turned(log(), [1.0, gain, 1.0]))
    assert len(told) == warned
    assert all("about body y (pitch)" in each.what and "check the units" in each.remedy for each in told)


def test_noise_alone_is_no_gain():
    assert gains(log(noise=0.3, held=5)) == []
    assert gains(log(noise=5.0)) == []


def gentle(noise):
    """Rates of windows by an attitude as noisy as that, and by a gyroscope: below what is judged axis by axis."""
    motion, other = 0.04 * np.random.default_rng(3).standard_normal((2, 800, 3))
    return motion + noise * other, motion


@pytest.mark.parametrize("noise", [0.0, 1.5, 2.5])
@pytest.mark.parametrize(("degrees", "words"), [(180 / np.pi, "about 180/pi"), (np.pi / 180, "about pi/180")])
def test_a_unit_of_a_gyroscope_is_told_beneath_noise_that_hides_its_motion(noise, degrees, words):
    seen, read = gentle(noise)
    _, scaled = gyroscope_apart(seen, degrees * read)
    assert [words in each.what for each in scaled] == [True] * 3
    assert gyroscope_apart(seen, read)[1] == ()


def test_what_does_not_follow_the_attitude_tells_no_unit():
    seen, _ = gentle(0.0)
    other = 0.04 * np.random.default_rng(5).standard_normal(seen.shape)
    assert gyroscope_apart(seen, other * np.pi / 180) == ((), ())
