import re

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.flightlog import repair
from cpfls_cli.flightlog.importing import read_signals
from cpfls_cli.flightlog.settings import ImportSettings, SignalMap

RATE = {"body_rate": SignalMap(columns=("p", "q", "r"), unit="rad/s")}
STAMPS = 0.01 * np.arange(3000)


def read(time, crop_s=None):
    columns = {"t": time} | {name: np.arange(len(time), dtype=float) for name in "pqr"}
    return read_signals(columns, ImportSettings(signals=RATE, torque_source=None, crop_s=crop_s, gap_s=10.0))


def refusal(time):
    with pytest.raises(InputError) as caught:
        read(time)
    return str(caught.value)


def test_a_clock_that_restarts_stops_with_the_row_and_the_rows_behind():
    message = refusal(np.concatenate([STAMPS, STAMPS]))
    assert message.startswith(
        "time goes backward at row 3001 (from 29.99 s to 0 s after the first stamp) and stays behind for 2999 rows:"
        " the clock was reset or logs were joined; split the log"
    )
    assert "cannot tell the parts apart" in message


@pytest.mark.parametrize(
    ("time", "rows"),
    [
        (np.concatenate([STAMPS + 500, STAMPS]), 3000),
        (np.concatenate([STAMPS, STAMPS + 20]), 2000),
        (np.concatenate([STAMPS[:1000], STAMPS[1000:1001] + 4e6, STAMPS[1001:]]), 2999),
    ],
    ids=["reset from a later clock", "joined with some overlap", "one stamp far in the future"],
)
def test_a_crop_that_is_offered_keeps_what_it_says(time, rows):
    offer = re.search(r"keep one part of (\d+) rows with import.crop_s = \[(.*), (.*)\]", refusal(time))
    assert int(offer[1]) == pytest.approx(rows, abs=2)
    kept = read(time, crop_s=(float(offer[2]), float(offer[3])))
    assert kept.samples_read - sum(kept.dropped.values()) == pytest.approx(int(offer[1]), abs=1)
    assert "backward_time" not in kept.dropped


def test_late_packets_are_dropped_and_counted_however_many():
    time = STAMPS.copy()
    time[10::10] -= 0.015
    assert read(time).dropped["backward_time"] == 299


def test_bursts_of_late_packets_up_to_five_per_cent_are_dropped():
    time = STAMPS.copy()
    time[1000:1150] -= 5
    assert read(time).dropped["backward_time"] == 150
    time[1000:1160] = STAMPS[1000:1160] - 5
    assert "at row 1001 (from 9.99 s to 5 s" in refusal(time)


def test_rows_without_a_stamp_do_not_hide_a_restart():
    time = np.concatenate([STAMPS, STAMPS])
    time[3001::2] = np.nan
    assert "time goes backward at row 3001" in refusal(time)


def test_rows_are_those_of_the_log_under_a_crop_too():
    time = np.concatenate([STAMPS, STAMPS])
    with pytest.raises(InputError, match="at row 3501 "):
        read(time, crop_s=(5.0, 25.0))


def turning(time):
    return np.stack([np.sin(3 * time), 2 * np.cos(7 * time), np.sin(11 * time)], axis=1)


def scattered(seed):
    """Stamps of messages that wait for 1.5 ms on average, with lost ones, and when they were sent."""
    rng = np.random.default_rng(seed)
    kept = np.ones(len(STAMPS), dtype=bool)
    kept[rng.choice(len(STAMPS), 20, replace=False)], kept[1000:1003] = False, False
    return STAMPS[kept], np.maximum.accumulate(STAMPS + rng.exponential(1.5e-3, len(STAMPS)))[kept]


def rows_of(time, rates, noise=0.002):
    rates = rates + noise * np.random.default_rng(9).standard_normal(rates.shape)
    columns = {"t": time} | dict(zip("pqr", rates.T, strict=True))
    return read_signals(columns, ImportSettings(signals=RATE, torque_source=None, gap_s=10.0))


@pytest.mark.parametrize("seed", range(3))
def test_messages_that_wait_are_put_where_a_regular_clock_has_them(seed):
    sent, stamps = scattered(seed)
    found = rows_of(stamps, turning(sent))
    assert [each for each in found.warnings if each.startswith("stamps scatter by 1.")]
    off = found.body_rate - turning(found.time + sent[0])
    # They wait so long on average.
    as_stamped = [np.interp(STAMPS, stamps, own) for own in turning(sent + 1.5e-3).T]
    assert off.std() < 0.5 * (np.stack(as_stamped, axis=1) - turning(STAMPS)).std()


def test_samples_that_were_taken_irregularly_stay_at_their_stamps():
    _, stamps = scattered(0)
    found = rows_of(stamps, turning(stamps))
    assert not [each for each in found.warnings if "scatter" in each]
    # Straight lines between samples leave so much.
    assert (found.body_rate - turning(found.time + stamps[0])).std() < 0.004


def test_motion_below_its_noise_decides_on_no_stamps():
    sent, stamps = scattered(0)
    assert not [each for each in rows_of(stamps, turning(sent), noise=3.0).warnings if "scatter" in each]


def stamped(sent, stamps):
    """Stamps as corrected, less when they were sent, in steps of 2.5 ms, and what is said."""
    motion = turning(sent) + 0.002 * np.random.default_rng(9).standard_normal((len(sent), 3))
    found, said = repair.regular_stamps(stamps, [motion])
    return (found - sent) / 2.5e-3, said


TICKS = 2.5e-3 * np.arange(12000)


@pytest.mark.parametrize("waiting", [2, 4, 8])
def test_messages_that_wait_for_each_other_are_not_taken_for_lost_ones(waiting):
    stamps = TICKS.copy()
    for first in range(500, 11900, 811):
        stamps[first : first + waiting] = TICKS[first + waiting] - 1e-6 * np.arange(waiting, 0, -1)
    off, said = stamped(TICKS, stamps)
    assert said
    assert np.ptp(off) < 0.5 < np.ptp((stamps - TICKS) / 2.5e-3)


@pytest.mark.parametrize("rate", [1.01, 1.1, 2.0])
def test_stamps_of_a_log_whose_rate_changes_stay(rate):
    sent = np.concatenate([TICKS[:6000], TICKS[5999] + rate * TICKS[1:6001]])
    waits = np.random.default_rng(0).exponential(0.75e-3, 12000)
    off, said = stamped(sent, np.maximum.accumulate(sent + waits) + 1e-9 * np.arange(12000))
    assert not said
    assert off.min() >= 0


@pytest.mark.parametrize("pause", [10.4, 1000.5])
def test_stamps_of_a_clock_that_begins_anew_behind_a_pause_stay(pause):
    sent = TICKS + np.where(np.arange(12000) > 6000, pause * 2.5e-3, 0.0)
    waits = np.random.default_rng(0).exponential(0.75e-3, 12000)
    assert not stamped(sent, np.maximum.accumulate(sent + waits) + 1e-9 * np.arange(12000))[1]


@pytest.mark.parametrize(("rate_hz", "digit_s"), [(400.0, 1e-3), (400.0, 2e-3), (90.0, 5e-3), (300.0, 1e-3)])
def test_rounded_stamps_are_put_back(rate_hz, digit_s):
    sent = np.arange(12000) / rate_hz + 3.7e-4
    motion = turning(sent) + 0.002 * np.random.default_rng(9).standard_normal((12000, 3))
    found, said = repair.regular_stamps(np.floor(sent / digit_s + 1e-9) * digit_s, [motion])
    assert said
    assert np.ptp(found - sent) < 0.02 / rate_hz


def test_rows_of_which_each_other_is_missing_have_no_curve_to_compare():
    time = np.where(np.arange(3000) % 3 > 0, TICKS[:3000] + 1e-4 * np.sin(TICKS[:3000]), np.nan)
    time = time[np.isfinite(time)]
    assert repair.regular_stamps(time, [turning(time)])[1] == []


def test_values_without_bound_decide_on_no_stamps():
    _, stamps = scattered(0)
    wild = np.where(np.arange(len(stamps))[:, None] % 7 == 0, [1e300, np.inf, np.nan], 0.0)
    assert repair.regular_stamps(stamps, [wild])[1] == []


def test_a_stamp_without_bound_is_no_clock():
    stamps = np.append(TICKS[:999], np.inf)
    assert repair.regular_stamps(stamps, [turning(TICKS[:1000])]) == (stamps, [])
