import numpy as np
import pytest
from scipy.signal import lfilter

from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.flightlog.importing import estimate_delay

INERTIA = np.array([[0.012, 0.001, -0.0005], [0.001, 0.015, 0.0008], [-0.0005, 0.0008, 0.024]])
RATE_HZ = 250


def delayed_signals(delay, noise=0.0, seconds=20.0, seed=3):
    """Body rates of many tones, and the torque that a rigid body needs, commanded earlier by the delay."""
    rng = np.random.default_rng(seed)
    time = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    frequency, phase, amplitude = (rng.uniform(*limits, (9, 3)) for limits in ((0.3, 4), (0, 6.28), (0.1, 0.5)))

    def motion(at):
        angle = 2 * np.pi * frequency * at[:, None, None] + phase
        acceleration = (amplitude * 2 * np.pi * frequency * np.cos(angle)).sum(axis=1)
        return (amplitude * np.sin(angle)).sum(axis=1), acceleration

    rate, _ = motion(time)
    rate_ahead, acceleration_ahead = motion(time + delay)
    torque = acceleration_ahead @ INERTIA + np.cross(rate_ahead, rate_ahead @ INERTIA) + [0.01, -0.02, 0.005]
    rate = rate + noise * rate.std(axis=0) * rng.standard_normal(rate.shape)
    return time, rate, torque + noise * torque.std(axis=0) * rng.standard_normal(torque.shape)


@pytest.mark.parametrize("delay", [0.0, 0.0133, 0.0671, 0.1505])
def test_a_known_delay_comes_back_within_a_millisecond_under_noise(delay):
    estimate = estimate_delay(*delayed_signals(delay, noise=0.1), lowpass_hz=8.0)
    assert estimate.delay_s == pytest.approx(delay, abs=1e-3)
    assert estimate.pooled_r2 > 0.95
    assert not estimate.at_bound


def test_without_noise_delay_and_inertia_come_back_between_the_samples():
    estimate = estimate_delay(*delayed_signals(0.0671))
    assert estimate.delay_s == pytest.approx(0.0671, abs=2e-5)
    upper = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    np.testing.assert_allclose(estimate.inertia, [INERTIA[entry] for entry in upper], rtol=1e-3)
    np.testing.assert_allclose(estimate.r2, 1, atol=1e-5)


def flown_in_loops(rng, delays, seconds=20.0):
    """Rates of vehicles whose loops follow drawn setpoints, logged with coloured noise, and what is commanded."""
    samples, moments, gain = int(seconds * RATE_HZ), np.diag(INERTIA), 12.0
    asked = np.repeat(rng.standard_normal((30, len(delays), 3)), samples // 30 + 1, axis=0)[:samples]
    asked = lfilter([0.07], [1, -0.93], lfilter([0.07], [1, -0.93], asked, axis=0), axis=0)
    gusts = 0.01 * gain * coloured(rng, asked.shape, memory=75)
    rate, torque = np.zeros((samples + 1, len(delays), 3)), np.zeros(asked.shape)
    late = np.round(delays * RATE_HZ).astype(int)
    for sample in range(samples):
        torque[sample] = moments * gain * (asked[sample] - rate[sample])
        acting = torque[np.maximum(sample - late, 0), np.arange(len(delays))]
        turning = np.cross(rate[sample], moments * rate[sample])
        rate[sample + 1] = rate[sample] + ((acting - turning) / moments + gusts[sample]) / RATE_HZ
    time = np.arange(samples) / RATE_HZ
    noise = 0.1 * rate.std(axis=0) * coloured(rng, asked.shape, memory=5)
    return [(time, own, torque[:, draw]) for draw, own in enumerate((rate[:-1] + noise).swapaxes(0, 1))]


def coloured(rng, shape, memory):
    keep = np.exp(-1 / memory)
    return lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal(shape), axis=0)


def test_intervals_hold_in_closed_loops():
    delays = np.random.default_rng(4).integers(1, 20, 80) / RATE_HZ
    flights = flown_in_loops(np.random.default_rng(5), delays)
    found = [estimate_delay(*flight, lowpass_hz=8.0) for flight in flights]
    low, value, high = np.array([(own.low_s, own.delay_s, own.high_s) for own in found]).T
    # A torque acts from its sample to the next.
    true = delays + 0.5 / RATE_HZ
    assert abs(np.mean(value - true)) < 4e-4
    assert 0.88 <= np.mean((low <= true) & (true <= high)) <= 0.99
    assert np.std(value - true) == pytest.approx(np.sqrt(np.mean((high - value) ** 2)) / 2.4, rel=0.3)


def test_only_the_leading_share_is_looked_at():
    time, rate, torque = delayed_signals(0.05)
    spoiled = torque.copy()
    spoiled[len(time) // 2 :] = 1e3
    whole = estimate_delay(time, rate, torque, share=0.5)
    assert estimate_delay(time, rate, spoiled, share=0.5).delay_s == whole.delay_s


def test_a_delay_beyond_the_longest_one_is_reported_at_the_bound():
    estimate = estimate_delay(*delayed_signals(0.12), delay_max_s=0.1)
    assert estimate.at_bound
    assert estimate.high_s - estimate.low_s > 1 / RATE_HZ
    assert estimate.delay_s == pytest.approx(0.1, abs=1e-4)


def test_a_constant_torque_and_a_short_flight_are_refused():
    time, rate, torque = delayed_signals(0.05)
    with pytest.raises(ComputationError, match="torque is constant"):
        estimate_delay(time, rate, np.ones_like(torque))
    with pytest.raises(SettingError, match="at least 50 are needed") as caught:
        estimate_delay(time[:60], rate[:60], torque[:60])
    assert caught.value.key == "delay_max_s"


@pytest.mark.parametrize(("delay", "longest"), [(-0.003, 0.2), (0.034, 0.035), (0.03, 0.005)])
def test_the_interval_holds_the_delay_that_is_taken_out(delay, longest):
    """Of motion ahead of its torque none is taken out, and one near the longest, or beyond it, is tried up to there."""
    estimate = estimate_delay(*delayed_signals(delay, noise=0.1), delay_max_s=longest, lowpass_hz=8.0)
    assert estimate.low_s <= estimate.delay_s <= estimate.high_s
    assert estimate.delays[-1] == pytest.approx(longest)
    assert estimate.delay_s == pytest.approx(np.clip(delay, 0.0, longest), abs=1e-3)
    assert estimate.at_bound is (delay >= longest)


def test_a_torque_that_does_not_change_says_nothing_of_the_delay():
    time, rate, torque = delayed_signals(0.034, noise=0.1)
    torque[:, 2] = 0.1
    assert estimate_delay(time, rate, torque, lowpass_hz=8.0).delay_s == pytest.approx(0.034, abs=1e-3)
