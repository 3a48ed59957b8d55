"""Floors of balances: gusts, lines in a spectrum and its background, and rotors that shake in their wake."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from cpfls_cli.gap.balance.balance_system import scatter_size, scatter_variance, system
from cpfls_cli.gap.balance.weak_flight import WeakFlight
from cpfls_cli.gap.naming.estimate import channel_weight
from cpfls_cli.gap.naming.open_questions import LOWEST, background, grid, narrow_band, noise_like, pooled_power
from cpfls_cli.gap.residual.air import Air
from cpfls_cli.weak_form.windows import windows
from tests.builders.gap_flights import candidate, fly, weak

PERIOD, SIZE, MEMORY = 0.02, 2.0, 1.2
WINDOWS = windows(PERIOD, 0.4, 0.5)
LENGTHS = [2000, 1500]
RING = candidate("vertical_descent", sideways=1.0)


def flights(*seconds):
    signals = [SimpleNamespace(time=np.arange(round(each / PERIOD)), period=PERIOD) for each in seconds]
    return [SimpleNamespace(signals=each, windows=WINDOWS) for each in signals]


def averages(seconds, draws):
    """Draw Gauss-Markov gusts and average them over windows, shape (draw, window)."""
    keep = np.exp(-PERIOD / MEMORY)
    white = SIZE * np.random.default_rng(3).standard_normal((draws, round(seconds / PERIOD)))
    white[:, 1:] *= np.sqrt(1 - keep**2)
    blown = lfilter([1.0], [1.0, -keep], white, axis=1)
    return np.array([WINDOWS.average(run[:, None])[:, 0] for run in blown])


@pytest.fixture
def air():
    found = SimpleNamespace(size=np.full(6, SIZE), memory=np.full(6, MEMORY), noise=np.zeros((6, 2)))
    return Air(found, gusts_only=np.zeros(6, dtype=bool), split=np.arange(6) < 3)


def test_the_floor_of_flights_in_gusts_is_their_size_and_seldom_exceeded_by_others(air):
    learned = flights(30.0, 30.0)
    floor = air.floor(learned, learned)
    np.testing.assert_allclose(floor[:3], averages(30.0, 400).std(), rtol=0.05)
    # Nothing is split off along the other axes, whose floor is that of the sensors.
    np.testing.assert_array_equal(floor[3:], 0.0)
    assert np.isinf(air.noise(WINDOWS)[3:]).all()
    floor = air.floor(flights(1e6), flights(30.0))[0]
    assert 0.01 < ((averages(30.0, 400) ** 2).mean(axis=1) > floor**2).mean() < 0.08
    # The shorter the flights, the more one differs from the next.
    assert air.floor(flights(1e6), flights(5.0))[0] > floor > air.floor(flights(1e6), flights(300.0))[0]


def test_of_gusts_and_noise_the_rows_before_leave_innovations_alike_and_independent():
    flat, sloping, seconds = 0.5, 0.004, 10.0
    found = SimpleNamespace(
        size=np.full(6, SIZE), memory=np.full(6, MEMORY), noise=np.tile([flat**2, sloping**2], (6, 1))
    )
    air = Air(found, gusts_only=np.zeros(6, dtype=bool), split=np.arange(6) < 5)
    rng, count = np.random.default_rng(5), WINDOWS.count(round(seconds / PERIOD))
    noise = rng.standard_normal((2, 4000, round(seconds / PERIOD)))
    rows = averages(seconds, 4000).T + WINDOWS.average(flat * noise[0].T) + WINDOWS.derivative(sloping * noise[1].T)
    flight = WeakFlight(None, WINDOWS, None, np.ones(6, dtype=bool), np.ones(10), lasting=air.lasting(WINDOWS, count))
    # A channel without gusts keeps its rows.
    white = flight.innovations.of_channels(np.repeat(rows[:, None], 6, axis=1))
    np.testing.assert_array_equal(white[:, 5], rows)
    np.testing.assert_allclose(np.cov(white[:, 0]) / rows.var(), np.eye(count), atol=0.12)
    assert np.abs(np.cov(rows) / rows.var() - np.eye(count)).max() > 0.8


def test_rows_of_long_flights_are_predicted_from_as_many_as_a_gust_lasts():
    """The covariance of all windows, summed sample by sample, becomes that of independent ones."""
    flat, sloping, count = 0.5, 0.004, 300
    found = SimpleNamespace(
        size=np.full(6, SIZE), memory=np.full(6, MEMORY), noise=np.tile([flat**2, sloping**2], (6, 1))
    )
    air = Air(found, gusts_only=np.zeros(6, dtype=bool), split=np.ones(6, dtype=bool))
    begins, samples = WINDOWS.hop * np.arange(count), len(WINDOWS.weight)
    weight, slope = (np.zeros((count, begins[-1] + samples)) for _ in range(2))
    for row, begin in enumerate(begins):
        weight[row, begin : begin + samples], slope[row, begin : begin + samples] = WINDOWS.weight, WINDOWS.slope
    at = PERIOD * np.arange(weight.shape[1])
    blown = SIZE**2 * np.exp(-np.abs(at[:, None] - at) / MEMORY)
    covariance = weight @ blown @ weight.T + flat**2 * weight @ weight.T + sloping**2 * slope @ slope.T
    lasting = air.lasting(WINDOWS, count)
    assert lasting.shape[1] < count / 5
    np.testing.assert_allclose(lasting[0], covariance[0, : lasting.shape[1]] / covariance[0, 0], rtol=1e-9)
    flight = WeakFlight(None, WINDOWS, None, np.ones(6, dtype=bool), np.ones(10), lasting=lasting)
    whitened = flight.innovations.of_channels(np.repeat(np.eye(count)[:, None], 6, axis=1))[:, 0]
    np.testing.assert_allclose(whitened @ covariance @ whitened.T / covariance[0, 0], np.eye(count), atol=1e-3)


def red(rng, amplitude=0.0):
    time = 0.2 * np.arange(2000)
    noise = lfilter([1], [1, -0.8], rng.standard_normal((2, 1, 2000)), axis=2)
    line = amplitude * np.sin(2 * np.pi * time)
    return [(own + line)[:, :length] for own, length in zip(noise, LENGTHS, strict=True)]


def test_the_background_is_that_of_the_process_and_does_not_see_a_line():
    on = grid(LENGTHS, 0.2)
    smooth = background(pooled_power(red(np.random.default_rng(0), amplitude=3.0), on), on)[0]
    # Two flights: half the sum of two squared amplitudes, each exponential, has its median at 0.839.
    exact = 2 * 0.839 / np.abs(1 - 0.8 * np.exp(-2j * np.pi * on.frequency * 0.2)) ** 2
    away = np.log(smooth / exact)[LOWEST:]
    assert abs(away.mean()) < 0.1
    assert np.sqrt(np.mean(away**2)) < 0.35
    # The power of the line itself is a thousand times the background.
    line = np.argmin(np.abs(on.frequency - 1.0)) - LOWEST
    assert np.abs(away[line - 20 : line + 20]).max() < 0.5


def test_drawn_noise_has_the_background_it_was_drawn_from():
    on = grid(LENGTHS, 0.2)
    rng = np.random.default_rng(1)
    smooth = 1 / np.abs(1 - 0.8 * np.exp(-2j * np.pi * on.frequency * 0.2))[None] ** 2
    present = np.ones((2, 1), dtype=bool)
    drawn = np.mean([noise_like(smooth, LENGTHS, present, on, rng) for _ in range(200)], axis=0)
    assert (drawn / (2 * smooth))[0, LOWEST:].mean() == pytest.approx(1, abs=0.05)


def test_nothing_to_search_finds_nothing():
    rng = np.random.default_rng(2)
    assert narrow_band([np.zeros((100, 6))], [np.zeros((100, 3))], 0.2, 9, rng) is None
    assert narrow_band([np.ones((20, 6))], [np.zeros((20, 3))], 0.2, 9, rng) is None


def test_a_force_has_no_energy_of_rotation():
    rng = np.random.default_rng(3)
    residual = np.zeros((300, 6))
    residual[:, 5] = np.sin(2 * np.pi * 0.7 * 0.2 * np.arange(300)) + 0.3 * rng.standard_normal(300)
    band = narrow_band([residual, np.zeros((300, 6))], [rng.standard_normal((300, 3))] * 2, 0.2, 19, rng)
    assert (band.channel, band.energy, band.p_value) == ("force z", "neither", 0.05)


@pytest.mark.parametrize(("amplitude", "all_drawn"), [(0.0, False), (3.0, True)])
def test_no_noise_is_drawn_for_what_is_not_significant_any_more(amplitude, all_drawn, monkeypatch):
    drawn = []
    monkeypatch.setattr(
        "cpfls_cli.gap.naming.open_questions.noise_like", lambda *given: drawn.append(None) or noise_like(*given)
    )
    residual = [
        np.column_stack([own[0], *np.zeros((5, own.shape[1]))]) for own in red(np.random.default_rng(4), amplitude)
    ]
    rates = [np.zeros((len(own), 3)) for own in residual]
    whole = narrow_band(residual, rates, 0.2, 99, np.random.default_rng(5))
    assert len(drawn) == 99
    early = narrow_band(residual, rates, 0.2, 99, np.random.default_rng(5), significance=0.05)
    assert (len(drawn) == 198) is all_drawn
    assert (early.p_value <= 0.05) is (whole.p_value <= 0.05) is all_drawn


def sinking():
    """Sinks into its own wake at 7 m/s for a third of the time."""
    signals = fly(1, seconds=60.0, tilt=0.02)
    down = np.zeros_like(signals.velocity)
    down[:, 2] = -7.0 * (np.sin(2 * np.pi * signals.time / 20.0) > 0.5)
    return replace(signals, velocity=down)


def test_variance_is_there_where_the_vehicle_sinks():
    signals = sinking()
    flight = weak(signals)
    variance = scatter_variance(system([flight], [RING]))
    inside = np.interp(flight.windows.centres(signals.time), signals.time, signals.velocity[:, 2]) < -3
    assert variance[inside, 0].min() > 0.1
    assert np.median(variance[~inside, 0]) == 0.0
    assert not variance[:, 2:].any()
    assert not scatter_variance(system([flight], [candidate("com_offset")])).any()


@pytest.mark.parametrize("size", [0.01, 0.1])
def test_the_size_of_the_scatter_comes_back(size):
    variance = scatter_variance(system([weak(sinking())], [RING]))
    floor = np.full(6, 0.05)
    residual = np.random.default_rng(0).standard_normal(variance.shape) * np.sqrt(floor**2 + size**2 * variance)
    assert scatter_size(variance, residual, floor) == pytest.approx(size**2, rel=0.3)


def test_a_residual_that_is_large_everywhere_is_no_scatter():
    variance = scatter_variance(system([weak(sinking())], [RING]))
    floor = np.full(6, 0.05)
    residual = 0.3 * np.random.default_rng(1).standard_normal(variance.shape)
    assert scatter_size(variance, residual, floor) == 0.0
    assert scatter_size(np.zeros_like(variance), residual, floor) == 0.0


def test_where_an_effect_shakes_a_fit_weighs_less():
    hypothesis = system([weak(sinking())], [RING])
    variance = scatter_variance(hypothesis)
    floor, size = np.full(6, 0.05), 0.1
    expected = np.sqrt(floor**2 + size**2 * variance)
    # In place of the residual that the flight would leave.
    vars(hypothesis)["residual"] = np.random.default_rng(2).standard_normal(variance.shape) * expected
    np.testing.assert_allclose(channel_weight(hypothesis, floor)[:, :2], expected[:, :2], rtol=0.2)
