"""Signals that are slower than the clock of their log, and filters that a log went through before it was written."""

import numpy as np
import pytest
from scipy.signal import lfilter

from cpfls_cli.flightlog.bandwidth import between_updates, cut_offs, slow_signals, warn_of_cut_offs, warn_of_slow
from cpfls_cli.flightlog.repair import SignalTable
from cpfls_cli.flightlog.settings import ImportSettings
from cpfls_cli.flightlog.smoothing import low_pass
from tests.builders.closed_loop_flights import flown, signals_of

NOISE = {"body_rate": 0.02, "attitude": 0.003, "velocity": 0.02, "position": 0.003, "rotor_speed": 2.0}
LOGGED = ("body_rate", "attitude", "velocity", "position", "rotor_speed")


def flight(noise=None):
    signals = signals_of(flown(12.0, noise=noise))
    return signals.time, {name: getattr(signals, name) for name in LOGGED}


@pytest.fixture(scope="module")
def noisy():
    return flight(NOISE)


@pytest.mark.parametrize("noise", [None, NOISE], ids=["exact", "noisy"])
def test_a_flight_that_no_filter_has_seen_is_not_called_filtered_or_slow(noise):
    time, signals = flight(noise)
    assert slow_signals(SignalTable(time, signals)) == ()
    assert cut_offs(signals, 100.0, ()) == {}


@pytest.mark.parametrize("order", [3, 4, 6])
@pytest.mark.parametrize("hz", [10.0, 12.0, 18.0, 20.0, 25.0])
def test_the_cut_off_of_a_zero_phase_filter_is_found(noisy, order, hz):
    _, signals = noisy
    found = cut_offs({name: low_pass(values, 100.0, hz, order) for name, values in signals.items()}, 100.0, ())
    assert found.keys() == signals.keys()
    assert np.array(list(found.values())) == pytest.approx(hz, rel=0.2 if order == 3 else 0.1)


def test_only_the_filtered_signal_is_named_and_the_remedy_is_the_lowest_cut_off(noisy):
    _, signals = noisy
    found = cut_offs(signals | {"body_rate": low_pass(signals["body_rate"], 100.0, 18.0, 4)}, 100.0, ())
    assert found.keys() == {"body_rate"}
    (warning,) = warn_of_cut_offs({"body_rate": 18.2, "attitude": 12.4}, ImportSettings())
    assert "body_rate at about 18 Hz, attitude at about 12 Hz" in warning
    assert warning.endswith("set import.lowpass_hz to 12 or less")
    assert list(warn_of_cut_offs({"body_rate": 18.2, "attitude": 12.4}, ImportSettings(lowpass_hz=12.0))) == []


def test_a_gentle_filter_and_a_line_of_vibration_are_no_cliff(noisy):
    time, signals = noisy
    keep = np.exp(-2 * np.pi * 10.0 * 0.01)
    gentle = lfilter([1 - keep], [1.0, -keep], signals["body_rate"], axis=0)
    vibration = 0.3 * np.sin(2 * np.pi * 23.0 * time[:, None] + 0.3 * np.sin(5.0 * time[:, None]))
    assert cut_offs({"body_rate": gentle, "attitude": signals["attitude"] + vibration}, 100.0, ()) == {}


def slow(signals, time, rate_hz=50.0):
    return list(warn_of_slow(slow_signals(SignalTable(time, signals)), rate_hz))


TIME = np.arange(2000) / 50
WAVES = 0.5 + 0.1 * np.random.default_rng(1).standard_normal((2000, 4)) + 0.1 * np.sin(TIME)[:, None]


def held(values, jitter=False):
    late = np.random.default_rng(2).integers(0, 2, len(values)) if jitter else 0
    return values[np.maximum.accumulate((np.arange(len(values)) - late).clip(0) // 5 * 5)]


@pytest.mark.parametrize("jitter", [False, True])
def test_commands_that_are_repeated_four_times_are_named_with_their_rate_and_its_cost(jitter):
    (warning,) = slow({"rotor_command": held(WAVES, jitter), "body_rate": WAVES[:, :3]}, TIME)
    assert warning.startswith("rotor_command is updated 10 times a second, but the log has 50 rows a second")
    assert "repeat the last value: it is 50 ms late on average, and knows nothing of motion above 5 Hz" in warning


@pytest.mark.parametrize("shift_s", [0.0, 0.013])
def test_straight_lines_between_updates_are_found(shift_s):
    updates = TIME[::5] + shift_s
    lines = np.column_stack([np.interp(TIME, updates, WAVES[::5, axis]) for axis in range(3)])
    (warning,) = slow({"body_rate": lines}, TIME)
    assert warning.startswith("body_rate is updated 10 times a second")
    assert "lie on a straight line between two updates: it knows nothing of motion above 5 Hz" in warning


def test_a_coarse_signal_and_a_smooth_one_are_not_slow():
    coarse = np.round(np.column_stack([np.sin(0.9 * TIME), np.cos(1.7 * TIME)]), 2)
    smooth = np.column_stack([np.sin(6.0 * TIME), np.sin(6.0 * TIME + 0.4)])
    assert slow({"body_rate": coarse, "attitude": smooth}, TIME) == []


def test_what_is_updated_a_hundred_times_a_second_is_fast_enough():
    assert slow({"rotor_command": WAVES[np.arange(2000) // 2 * 2]}, TIME / 10, 500.0) == []


def test_what_has_stamps_of_its_own_is_as_fast_as_these_say_whatever_is_lost():
    sent = TIME[::17][np.arange(len(TIME[::17])) % 5 > 0]
    lossy = np.interp(TIME, sent, np.sin(sent))
    (found,) = slow_signals(SignalTable(TIME, {"rotor_speed": lossy[:, None]}), {"rotor_speed": 2.4})
    assert (found.name, found.rate_hz, found.between) == ("rotor_speed", 2.4, "interpolated")
    assert slow_signals(SignalTable(TIME, {"rotor_speed": WAVES}), {"rotor_speed": 40.0}) == ()
    # Values that come slower than their stamps are as slow as they come.
    (slower,) = slow_signals(SignalTable(TIME, {"rotor_command": held(WAVES)}), {"rotor_command": 20.0})
    assert slower.rate_hz == pytest.approx(10, rel=0.01)


def test_straight_lines_go_from_update_to_update_and_through_what_changes_in_every_row():
    rows = np.arange(400)
    repeated = np.column_stack([rows // 10 * 10.0] * 2)
    assert np.abs(between_updates(repeated, 10)[:390] - rows[:390, None]).max() < 1e-9
    repeated[200:240] += np.sin(rows[200:240, None])
    assert np.abs(between_updates(repeated, 10)[205:235] - repeated[205:235]).max() < 1e-9


def test_an_update_that_rounding_spreads_over_two_rows_is_at_the_first():
    rows = np.arange(400)
    repeated = np.column_stack([rows // 10 * 10.0] * 2)
    repeated[rows % 10 == 0] -= 1e-12
    assert np.abs(between_updates(repeated, 10)[:390] - rows[:390, None]).max() < 1e-9


def test_what_stays_does_so_until_the_update_before_the_one_that_changes_it():
    rows = np.arange(600)
    true = np.where(rows < 300, 100.0, 400.0 + rows)
    between = between_updates(true[rows // 10 * 10, None], 10)[:, 0]
    assert (between[:290] == 100.0).all()
    assert np.abs(between[300:590] - true[300:590]).max() < 1e-9


def test_a_pause_without_changes_makes_no_update_slower():
    values = held(WAVES).copy()
    values[:400] = values[400]
    (found,) = slow_signals(SignalTable(TIME, {"rotor_command": values}))
    assert found.rate_hz == pytest.approx(10, rel=0.01)


def test_updates_of_a_short_stretch_lie_on_straight_lines_too():
    rows = np.arange(60)
    assert np.abs(between_updates((rows // 10 * 10.0)[:, None], 10)[:, 0][:50] - rows[:50]).max() < 1e-9
    assert between_updates(np.ones((1, 4)), 10).shape == (1, 4)


@pytest.mark.parametrize("rate_hz", [250, 62.5])
def test_updates_that_another_clock_spreads_over_rows_lie_on_straight_lines(rate_hz):
    clock = np.arange(0.0, 10.0, 1 / rate_hz)
    repeated = np.interp(clock, TIME, TIME // 0.1 * 0.1)[:, None]
    inside = (clock > 0.5) & (clock < 9.0)
    late = clock - between_updates(repeated, 0.1 * rate_hz)[:, 0]
    # By a row of either clock at most, where rows that repeat are late by 0.1 s.
    assert np.abs(late[inside]).max() < 1 / rate_hz + (TIME[1] - TIME[0])


def test_updates_that_were_low_passed_are_not_late():
    rate_hz = 1 / float(TIME[1] - TIME[0])
    known = slice(50, -50)
    waves = np.sin(3 * TIME)[:, None]
    low_passed = low_pass(held(waves), rate_hz, 20.0, 4)
    late = np.abs(low_passed - waves)[known].max()
    assert np.abs(between_updates(low_passed, 0.1 * rate_hz) - waves)[known].max() < 0.3 * late
