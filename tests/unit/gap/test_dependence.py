"""Views of a residual, and its dependence on one signal, judged against chance."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binned_statistic_2d
from scipy.stats import f as f_law

from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.weak_flight import weak_flight
from cpfls_cli.gap.residual.dependence import heat_map, joined_states, rank_dependence, state_signals, stretches
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import mirror_shifted, windows

FLIGHTS, LENGTH = 3, 120
FLIGHT_INDEX = np.repeat(np.arange(FLIGHTS), LENGTH)
BLOCK = np.arange(FLIGHTS * LENGTH) // 20
TIME = 5.0 + 0.01 * np.arange(1000)
VEHICLE = VehicleSettings()
HOP = 0.2
CENTRES = np.tile(0.3 + HOP * np.arange(200), 2)
OF_FLIGHT = np.repeat([0, 1], 200)


def correlated(rng, channels, correlation):
    """Stationary first-order autoregression of unit variance, flight by flight."""
    drive = rng.standard_normal((FLIGHTS, LENGTH + 200, channels)) * np.sqrt(1 - correlation**2)
    return lfilter([1], [1, -correlation], drive, axis=1)[:, 200:].reshape(-1, channels)


def state_of(rng):
    slow = correlated(rng, 4, 0.95)
    yaw = (2 * slow[:, 3] + np.pi) % (2 * np.pi) - np.pi
    return {"speed": slow[:, 0], "height": slow[:, 1], "thrust": slow[:, 2], "yaw": yaw}


def residual_of(rng, channels=2):
    return np.column_stack([correlated(rng, channels, 0.9), np.zeros((FLIGHTS * LENGTH, 6 - channels))])


def ranked(residual, state, rng, shifts=99):
    return rank_dependence(residual, FLIGHT_INDEX, BLOCK, state, shifts, rng)


def f_test(residual, signal):
    """Smallest p-value of a quartic under independent rows."""
    powers = np.vander((signal - signal.mean()) / signal.std(), 5)
    left = residual - powers @ np.linalg.lstsq(powers, residual, rcond=None)[0]
    freedom = len(signal) - 5
    explained = ((residual - residual.mean()) ** 2).sum() - (left**2).sum()
    return f_law.sf(explained / 4 / ((left**2).sum() / freedom), 4, freedom)


def test_chance_is_named_as_rarely_as_promised_where_an_f_test_names_it_always():
    named, named_by_f = 0, 0
    for seed in range(100):
        rng = np.random.default_rng(seed)
        state, residual = state_of(rng), residual_of(rng)
        named += min(one.p_value for one in ranked(residual, state, rng)) <= 0.05
        signals = [state[name] for name in ("speed", "height", "thrust")]
        named_by_f += min(f_test(residual[:, c], s) for c in (0, 1) for s in signals) <= 0.05
    # 5 of 100 are expected; 11 or more have a probability of 1 %.
    assert named <= 10
    assert named_by_f >= 90


def test_a_curve_of_one_signal_is_found_under_correlated_noise():
    rng = np.random.default_rng(1)
    state, residual = state_of(rng), residual_of(rng)
    residual[:, 1] += 1.5 * state["height"] * np.abs(state["height"])
    best = ranked(residual, state, rng)[0]
    assert (best.channel, best.signal) == ("torque y", "height")
    assert best.p_value <= 0.02
    assert 0.4 < best.r2 < 1


def test_three_turns_of_yaw_need_harmonics():
    rng = np.random.default_rng(2)
    state, residual = state_of(rng), residual_of(rng)
    residual[:, 0] += 2 * np.cos(3 * state["yaw"])
    best = ranked(residual, state, rng)[0]
    assert (best.channel, best.signal, best.p_value <= 0.02) == ("torque x", "yaw", True)


def test_the_share_is_that_of_an_explicit_cross_validation():
    rng = np.random.default_rng(3)
    state, residual = state_of(rng), residual_of(rng)
    residual[:, 0] += state["speed"]
    low, high = np.percentile(state["speed"], [0.5, 99.5])
    scaled = np.clip((state["speed"] - low) / (high - low), 0, 1)

    def within(values):
        return np.concatenate([v - v.mean(axis=0) for v in np.split(values, FLIGHTS)])

    powers, right = within(scaled[:, None] ** np.arange(1, 5)), within(residual[:, 0])
    error = 0.0
    for block in range(BLOCK.max() + 1):
        out = block == BLOCK
        error += ((right[out] - powers[out] @ np.linalg.lstsq(powers[~out], right[~out], rcond=None)[0]) ** 2).sum()
    found = next(one for one in ranked(residual, state, rng) if (one.channel, one.signal) == ("torque x", "speed"))
    assert found.r2 == pytest.approx(1 - error / (right**2).sum(), abs=1e-5)


def test_a_signal_that_one_flight_lacks_is_judged_on_the_others():
    rng = np.random.default_rng(4)
    state, residual = state_of(rng), residual_of(rng)
    residual[:, 0] += 3 * state["speed"]
    full = {one.signal: one.r2 for one in ranked(residual, state, rng) if one.channel == "torque x"}
    state["speed"] = np.where(FLIGHT_INDEX == 2, np.nan, state["speed"])
    residual[FLIGHT_INDEX == 2, 0] += 50 * rng.standard_normal(LENGTH)
    part = {one.signal: one.r2 for one in ranked(residual, state, rng) if one.channel == "torque x"}
    assert part["speed"] > 0.8
    assert part["height"] < full["speed"]


def test_nothing_to_judge_ranks_nothing():
    rng = np.random.default_rng(5)
    assert ranked(np.zeros((FLIGHTS * LENGTH, 6)), state_of(rng), rng) == ()
    assert ranked(residual_of(rng), {"height": np.ones(FLIGHTS * LENGTH)}, rng) == ()


def test_shifted_residuals_keep_neighbours_together():
    rng = np.random.default_rng(6)
    line = np.linspace(0, 1, FLIGHTS * LENGTH)[:, None]
    draws = mirror_shifted(line, FLIGHT_INDEX, 20, rng)
    assert np.abs(np.diff(draws.reshape(FLIGHTS, LENGTH, 20), axis=1)).max() < 1.01 * np.diff(line[:, 0]).max()
    np.testing.assert_allclose(draws.reshape(FLIGHTS, LENGTH, 20).mean(axis=1), 0, atol=1e-12)


def windowed_flight(**given):
    rate = np.column_stack([np.sin(TIME), np.cos(TIME), 0.1 * TIME])
    signals = Signals(time=TIME, body_rate=rate, vehicle=VEHICLE, **given)
    return weak_flight(signals, windows(0.01, 0.4, 0.5), None, force=False), signals


def test_a_full_flight_has_every_signal_and_a_bare_one_its_rates():
    full = state_signals(
        *windowed_flight(
            attitude=np.column_stack([0.1 * np.ones(1000), np.zeros(1000), 0.9 * TIME]),
            velocity=np.column_stack([3 + 0 * TIME, 4 + 0 * TIME, 0.5 + 0 * TIME]),
            position=np.column_stack([TIME, TIME, 2 * TIME]),
            rotor_speed=np.full((1000, 4), 348.0),
            voltage=np.ones(1000),
        )
    )
    assert (len(full), full["horizontal speed"]) == (1 + 3 + 3 + 3 + 3 + 1 + 4 + 1 + 3 + 1, pytest.approx(5))
    assert full["vertical speed"] == pytest.approx(0.5)
    assert full["thrust"] == pytest.approx(4 * 121.5e-6 * 348.0**2)
    assert full["height"] == pytest.approx(2 * (full["time"] + TIME[0]))
    assert set(state_signals(*windowed_flight())) == {"time", "body rate x", "body rate y", "body rate z"}


def test_a_turn_through_half_a_turn_does_not_average_to_zero():
    yaw = (0.9 * TIME + np.pi) % (2 * np.pi) - np.pi
    state = state_signals(*windowed_flight(attitude=np.column_stack([0 * yaw, 0 * yaw, yaw])))
    np.testing.assert_allclose(np.exp(1j * state["yaw"]), np.exp(0.9j * (state["time"] + TIME[0])), atol=1e-9)


def test_what_a_flight_lacks_is_not_a_number_there():
    with_voltage, without = state_signals(*windowed_flight(voltage=np.ones(1000))), state_signals(*windowed_flight())
    joined = joined_states([without, with_voltage])
    assert np.isnan(joined["voltage"][: len(without["time"])]).all()
    assert joined["voltage"][len(without["time"]) :] == pytest.approx(1)
    assert np.isfinite(joined["body rate x"]).all()


def quiet():
    return np.random.default_rng(0).standard_normal((400, 6))


def test_a_burst_is_one_stretch_with_its_flight_and_times():
    residual = quiet()
    residual[260:280, 2] += 8 * (-1.0) ** np.arange(20)
    (found,) = stretches(residual, CENTRES, OF_FLIGHT)
    assert (found.flight, found.channel) == (1, "torque z")
    assert found.start_s == pytest.approx(CENTRES[260], abs=3 * HOP)
    assert found.end_s == pytest.approx(CENTRES[279], abs=3 * HOP)
    assert 6 < found.rms_floors < 9


def test_a_short_pause_joins_and_a_long_one_does_not():
    residual = quiet()
    residual[[*range(20, 30), *range(35, 45), *range(150, 160)], 0] += 9
    found = sorted(stretches(residual, CENTRES, OF_FLIGHT), key=lambda one: one.start_s)
    assert len(found) == 2
    assert found[0].end_s - found[0].start_s > 25 * HOP - 2 * HOP


def test_noise_alone_has_no_stretch_and_many_bursts_are_cut_to_the_largest():
    assert stretches(quiet(), CENTRES, OF_FLIGHT) == ()
    residual = quiet()
    for number in range(8):
        residual[20 + 45 * number : 24 + 45 * number, 4] += 10 + number
    found = stretches(residual, CENTRES, OF_FLIGHT, most=3)
    assert len(found) == 3
    assert found[0].rms_floors >= found[-1].rms_floors
    assert {one.channel for one in found} == {"force y"}


def test_cells_hold_the_mean_and_count_every_known_window():
    first, second, residual = np.random.default_rng(0).standard_normal((3, 500))
    second[::50] = np.nan
    found = heat_map("torque x", residual, ("first", "second"), {"first": first, "second": second}, bins=6)
    edges = (found.first_edge, found.second_edge)
    known = np.isfinite(second)
    inside = [np.clip(s[known], e[0], e[-1]) for s, e in zip((first, second), edges, strict=True)]
    expected = binned_statistic_2d(*inside, residual[known], "mean", bins=list(edges)).statistic
    np.testing.assert_allclose(found.mean, expected)
    assert found.count.sum() == known.sum()


def test_a_signal_that_stands_still_has_one_filled_column_and_no_windows_none():
    found = heat_map(
        "torque x", np.arange(4.0), ("still", "moves"), {"still": np.ones(4), "moves": np.arange(4.0)}, bins=3
    )
    assert (found.count.sum(axis=1) > 0).sum() == 1
    assert np.isnan(found.mean).any()
    found = heat_map("torque x", np.zeros(3), ("a", "b"), {"a": np.full(3, np.nan), "b": np.zeros(3)})
    assert found.count.sum() == 0
