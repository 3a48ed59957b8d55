"""The floor that gusts are: what averages over windows show of them, and of those of other flights."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from cpfls_cli.gap.balance.weak_flight import WeakFlight
from cpfls_cli.gap.residual.air import Air
from cpfls_cli.weak_form.windows import windows

PERIOD, SIZE, MEMORY = 0.02, 2.0, 1.2
WINDOWS = windows(PERIOD, 0.4, 0.5)


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
    split = np.arange(6) < 3
    return Air(found, gusts_only=np.zeros(6, dtype=bool), split=split)


def test_the_floor_of_the_flights_that_gusts_were_found_in_is_their_size(air):
    learned = flights(30.0, 30.0)
    floor = air.floor(learned, learned)
    np.testing.assert_allclose(floor[:3], averages(30.0, 400).std(), rtol=0.05)
    # Nothing is split off along the other axes, whose floor is that of the sensors.
    np.testing.assert_array_equal(floor[3:], 0.0)
    assert np.isinf(air.noise(WINDOWS)[3:]).all()


def test_gusts_of_another_flight_seldom_exceed_its_floor(air):
    floor = air.floor(flights(1e6), flights(30.0))[0]
    above = (averages(30.0, 400) ** 2).mean(axis=1) > floor**2
    assert 0.01 < above.mean() < 0.08
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
    spread = np.cov(white[:, 0]) / rows.var()
    np.testing.assert_allclose(spread, np.eye(count), atol=0.12)
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
