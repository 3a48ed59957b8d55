"""Spectra, lines and filters of a gyroscope with known lines."""

import numpy as np
import pytest

from cpfls_cli.look.flight import Samples
from cpfls_cli.look.vibration import vibration_of
from tests.builders.look_flights import correlated, still_flight

CLOCK = 50.0


def shaking(power=0.0, hz=180.0, size=0.5, rate_hz=1000.0, seconds=30.0, seed=0, spread=0.3, **given):
    """Gyroscope with white noise and a line about pitch whose frequency goes with a power of the collective."""
    generator = np.random.default_rng(seed)
    coarse = np.arange(round(seconds * CLOCK)) / CLOCK
    collective = 0.4 * np.exp(spread * correlated(generator, len(coarse), CLOCK, 1.5)[:, 0])
    time = np.arange(round(seconds * rate_hz)) / rate_hz
    turns = hz * (np.interp(time, coarse, collective) / np.median(collective)) ** power
    values = 0.1 * generator.normal(size=(len(time), 3))
    values[:, 1] += size * np.sin(2 * np.pi * np.cumsum(turns) / rate_hz)
    flight = {"collective": collective, "gyroscope": Samples(time, values, "gyro")} | given
    return still_flight(seconds, CLOCK, **flight), turns


def test_a_line_that_stays_is_fixed():
    flight, _ = shaking()
    (line,) = vibration_of(flight).lines
    assert (line.kind, line.axis, line.hz) == ("fixed", "pitch", pytest.approx(180, abs=4))
    assert line.power.low < 0 < line.power.high


@pytest.mark.parametrize("power", [0.5, 1.0])
def test_a_line_that_moves_with_the_collective_is_followed(power):
    inside = 0
    for seed in range(10):
        flight, turns = shaking(power, seed=seed)
        line = vibration_of(flight).lines[0]
        assert (line.kind, line.hz) == ("moves", pytest.approx(180, abs=9))
        assert [line.lowest_hz, line.highest_hz] == pytest.approx(np.percentile(turns, [5, 95]), rel=0.08)
        inside += line.power.low <= power <= line.power.high
    assert inside >= 9


def test_a_line_above_half_the_rate_comes_back_folded():
    """At 300 samples in a second, 180 Hz and more show at 120 Hz and less."""
    flight, _ = shaking(0.7, rate_hz=300.0, hz=200.0, spread=0.15)
    line = vibration_of(flight).lines[0]
    assert (line.kind, line.hz) == ("folded", pytest.approx(100, abs=8))


def test_a_line_follows_what_moves_and_noise_alone_has_none():
    flight, _ = shaking(spread=0.001)
    (line,) = vibration_of(flight).lines
    assert line.kind == "unknown"
    assert line.power is None
    assert all(vibration_of(shaking(size=0.0, seed=seed)[0]).lines == () for seed in range(10))


def test_logged_speeds_name_the_rotor_and_the_multiple_of_its_turns():
    generator = np.random.default_rng(3)
    flight, turns = shaking(0.5)
    drift = 1 + 0.1 * correlated(generator, len(turns), 1000.0, 1.0, 4)
    speeds = 2 * np.pi * turns[:, None] * drift
    speeds[:, 2] = 2 * np.pi * turns / 2
    flight, _ = shaking(0.5, rotor_speed=Samples(flight.gyroscope.time, speeds))
    line = vibration_of(flight).lines[0]
    assert (line.kind, line.rotor, line.order) == ("rotor", 3, 2)


def test_spectra_have_the_power_of_the_signal():
    """White noise of 0.1 over all frequencies, and a sine of 0.5 about pitch."""
    spectrum = vibration_of(shaking()[0]).spectra["gyroscope before filters"]
    noise = 0.1 * np.sqrt(482 / 500)
    assert spectrum.rms == pytest.approx([noise, np.hypot(noise, 0.5 / np.sqrt(2)), noise], rel=0.02)


def test_slow_logs_show_no_vibration():
    vibration = vibration_of(shaking(rate_hz=25.0, hz=8.0)[0])
    assert (vibration.spectra, vibration.lines_lack) == ({}, "rate")


PX4 = {
    "MC_ROLLRATE_P": 0.15, "MC_ROLLRATE_D": 0.003, "IMU_GYRO_CUTOFF": 40.0, "IMU_GYRO_NF0_FRQ": 120.0,
    "IMU_GYRO_NF0_BW": 20.0, "IMU_DGYRO_CUTOFF": 30.0, "IMU_GYRO_RATEMAX": 800.0,
}  # fmt: skip


def test_filters_are_listed_with_what_they_cost():
    flight, _ = shaking(autopilot="px4", parameters=PX4)
    vibration = vibration_of(flight)
    low, notch = (
        next(each for each in vibration.filters if each.parameter == name)
        for name in ("IMU_GYRO_CUTOFF", "IMU_GYRO_NF0_FRQ")
    )
    # Of a Butterworth low-pass of second order, phase 2 zeta w / (1 - w^2) at 5 Hz; of a notch the same with its width.
    part = 5 / 40
    assert low.delay_ms == pytest.approx(np.arctan(np.sqrt(2) * part / (1 - part**2)) / (2 * np.pi * 5) * 1e3, rel=0.01)
    part = 5 / 120
    assert notch.delay_ms == pytest.approx(np.arctan(20 / 120 * part / (1 - part**2)) / (2 * np.pi * 5) * 1e3, rel=0.1)
    assert vibration.delay_ms == pytest.approx(low.delay_ms + notch.delay_ms)


def test_a_notch_next_to_the_fixed_line_is_moved_to_it():
    flight, _ = shaking(autopilot="px4", parameters=PX4)
    (change,) = vibration_of(flight).changes
    assert (change.parameter, change.now) == ("IMU_GYRO_NF0_FRQ", 120.0)
    assert change.proposed == pytest.approx(180, abs=4)
    there, _ = shaking(autopilot="px4", parameters=PX4 | {"IMU_GYRO_NF0_FRQ": 178.0})
    assert vibration_of(there).changes == ()
    moving, _ = shaking(0.7, autopilot="px4", parameters=PX4)
    assert vibration_of(moving).changes == ()


def test_dynamic_notches_that_begin_above_a_motor_line_begin_lower():
    stated = {"dyn_notch_count": 3, "dyn_notch_min_hz": 200, "dyn_notch_max_hz": 600}
    flight, _ = shaking(0.7, autopilot="betaflight", parameters=stated)
    (change,) = vibration_of(flight).changes
    assert change.parameter == "dyn_notch_min_hz"
    assert change.proposed < 140
    by_speed, _ = shaking(0.7, autopilot="betaflight", parameters=stated | {"rpm_filter_harmonics": 3})
    assert vibration_of(by_speed).changes == ()
