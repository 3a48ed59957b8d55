"""An attitude that an accelerometer levels, its offset, and an autopilot mounted askew, in closed loop with noise."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from cpfls_cli.consistency.check import audit
from cpfls_cli.consistency.sensors import sensors_of
from cpfls_cli.gap.diagnose import diagnose
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.weak_form.windows import windows
from tests.builders.autopilot_sensors import askew, felt, levelled, noisy
from tests.builders.closed_loop_flights import COARSE, PERIOD, flown, signals_of

WINDOWS = windows(PERIOD, 0.4, 0.5)
# Offsets of the accelerometer, m/s^2: another one in each flight.
OFFSETS = 0.1 * np.random.default_rng(7).standard_normal((5, 3))
TURN = np.array([-0.025, 0.05, 0.01])


def sensed(change=lambda signals: signals, effects=None):
    """Five flights of other swings, by an accelerometer with an offset in each."""
    made = []
    for number, offset in enumerate(OFFSETS):
        flight = flown(20.0, also=0.01 * (1 + number), effects=effects or {}, integration_rate_hz=COARSE)
        made.append(noisy(change(felt(signals_of(flight), offset)), np.random.default_rng(number)))
    return made


@pytest.fixture(scope="module")
def levelled_flights():
    return sensed(lambda signals: levelled(signals, 0.1))


def late(values, delay):
    time = PERIOD * np.arange(len(values))
    return CubicSpline(time, values)(np.maximum(time - delay, 0.0))


def test_an_attitude_that_an_accelerometer_levels_makes_no_gyroscope_late(levelled_flights):
    found = audit(levelled_flights, WINDOWS)
    assert (found.named, found.settled) == ((), ())
    (note,) = [note for note in found.notes if "levelled" in note]
    assert abs(float(re.search(r"within ([\d.]+) s", note)[1]) - 10) < 1
    fit = sensors_of(levelled_flights, WINDOWS).gyroscope.fit
    assert abs(fit.value[13] - 0.1) < 0.01
    assert abs(fit.value[12]) < 4 * fit.error[12]


def test_without_a_log_of_the_accelerometer_it_is_seen_as_well(levelled_flights):
    flights = [replace(s, specific_force=None, rotor_speed=None) for s in levelled_flights]
    assert audit(flights, WINDOWS).named == ()
    assert abs(sensors_of(flights, WINDOWS).gyroscope.fit.value[13] - 0.1) < 0.01


def test_a_delay_is_found_next_to_it(levelled_flights):
    found = audit([replace(s, attitude=late(s.attitude, 0.03)) for s in levelled_flights], WINDOWS)
    assert found.named == ()
    (sentence,) = found.settled
    assert abs(float(re.match(r"The attitude is late by ([\d.]+) ms", sentence)[1]) - 30) < 0.5


def test_one_that_nothing_levels_says_so_of_none():
    assert not any("levelled" in note for note in audit(sensed(), WINDOWS).notes)


def test_of_one_slow_swing_no_gyroscope_is_late_because_the_attitude_may_be_levelled():
    """The lead of a levelled attitude at one frequency is any delay's."""
    assert audit([replace(s, rotor_speed=None) for s in levelled_slowly(0.1)], WINDOWS).named == ()


def test_an_attitude_levelled_so_fast_that_the_gyroscope_hardly_agrees_makes_none_late_either():
    """What it leaves about roll makes only yaw look as if it turned."""
    flights = list(levelled_slowly(1.0, speed=1.0, yaw=0.5))
    assert audit(flights, WINDOWS).named == ()
    assert not sensors_of(flights, WINDOWS).clocks
    assert abs(sensors_of(flights, WINDOWS).gyroscope.fit.value[13] - 1.0) < 0.05


def levelled_slowly(gain, speed=2.0, yaw=0.0):
    time = PERIOD * np.arange(4000)
    for seed in range(2):
        rng = np.random.default_rng(seed)
        angle = 0.2 * np.sin(speed * time + seed)
        rate = 0.2 * speed * np.cos(speed * time + seed)
        signals = signals_of(flown(20.0, integration_rate_hz=COARSE))
        still = np.zeros_like(time)
        heading, turning = yaw * np.sin(1.3 * time), 1.3 * yaw * np.cos(1.3 * time)
        # It accelerates as its lean says, so that the accelerometer feels the thrust alone.
        swing = replace(
            signals,
            time=time,
            attitude=np.stack([angle, still, heading], axis=1),
            body_rate=np.stack([rate, turning * np.sin(angle), turning * np.cos(angle)], axis=1),
            specific_force=np.tile([0.0, 0.0, 9.81], (len(time), 1)),
            velocity=np.zeros((len(time), 3)),
            acceleration=None,
            position=None,
            rotor_speed=np.zeros((len(time), 4)),
        )
        yield noisy(levelled(swing, gain), rng)


def diagnosed(flights):
    return diagnose(flights[:3], flights[3:], GapSettings(), np.random.default_rng(0)).diagnosis


def test_an_accelerometer_with_an_offset_in_each_flight_makes_no_gap():
    assert str(diagnosed(sensed()).verdict) == "NO_GAP"


def test_a_drag_is_named_with_its_number_next_to_the_offset():
    found = diagnosed(sensed(effects={"rotor_drag": [2e-3]}))
    assert [effect.name for effect in found.effects] == ["rotor_drag"]
    (number,) = found.effects[0].numbers
    assert number.low < 2e-3 < number.high
    assert abs(number.value - 2e-3) < 1e-4


@pytest.mark.parametrize(
    "way", [{"change": lambda signals: askew(signals, TURN)}, {"effects": {"mounting": TURN.tolist()}}]
)
def test_an_autopilot_mounted_askew_is_named_with_its_angles(way):
    """By rotating exactly what its sensors say, and flown by the model with the effect."""
    found = diagnosed(sensed(**way))
    assert (str(found.verdict), [effect.name for effect in found.effects]) == ("NAMED", ["mounting"])
    for number, truth in zip(found.effects[0].numbers, TURN, strict=True):
        assert number.low < truth < number.high
        assert abs(number.value - truth) < 0.005
