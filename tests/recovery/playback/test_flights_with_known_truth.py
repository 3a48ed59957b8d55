"""Flights that recovery is measured on: what flew explains them, down to the noise, and nothing else does."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.shared.playback_scores import free_runs, rate_stays, score
from cpfls_cli.playback.model import Remainder, VehicleModel
from tests.builders.playback_flights import KINDS, MIDDLING, STATED, flown, truth

RATE = 3
# Mean length of the difference of two 3-vectors of noise, for a deviation of 1.
DIFFERENCE = np.sqrt(2) * np.sqrt(8 / np.pi)


def errors(model, flights):
    return score([free_runs(model, flight) for flight in flights])


def everything():
    """A model with all that a model can have."""
    known = truth()
    response = replace(known.response, delay_s=0.007, slow_roll_pitch=-0.3, slow_yaw=-0.2, slow_s=0.4)
    remainder = Remainder(
        breakpoints=np.array([0.0, 0.5, 1.0]),
        harmonic_order=1,
        rows=np.array([0, 1, 5]),
        coefficients=np.full((3, 6, 2), 2e-6),
    )
    return replace(known, response=response, thrust_linear=0.3, remainder=remainder)


@pytest.fixture(scope="module")
def clean():
    return flown(truth(), duration_s=8.0, seed=3)


@pytest.fixture(scope="module")
def noisy():
    return flown(truth(), duration_s=8.0, seed=3, noise=MIDDLING)


@pytest.mark.parametrize("hold", ["previous", "linear"])
@pytest.mark.parametrize("model", [truth(), everything()], ids=["truth", "everything"])
def test_without_noise_the_true_model_plays_every_flight_back(model, hold):
    flights = flown(model, duration_s=4.0, hold=hold)
    stays = score([rate_stays(flight) for flight in flights])
    # What is left are steps of 10 ms with mean rotor speeds where the flight had finer ones.
    assert (errors(model, flights).sums < 0.004 * stays.sums).all()


def test_with_noise_the_true_model_is_off_by_the_noise(noisy):
    found = errors(truth(), noisy)
    sizes = np.array([MIDDLING.position, MIDDLING.velocity, MIDDLING.attitude, MIDDLING.rate])
    assert found.mae[0] == pytest.approx(DIFFERENCE * sizes, rel=0.06)
    # The wrong rate at the start, damped, has turned the body after half a second; rotor noise adds a little.
    assert DIFFERENCE * MIDDLING.rate < 2 * found.mae[49, RATE] < 8 * DIFFERENCE * MIDDLING.rate


def test_the_stated_vehicle_does_not_explain_the_flights(noisy):
    assert errors(VehicleModel(vehicle=STATED), noisy).sums[RATE] > 20 * errors(truth(), noisy).sums[RATE]


@pytest.mark.parametrize("time_constant", [0.0, 0.05])
def test_noise_has_its_size_and_its_colour(clean, time_constant):
    noise = replace(MIDDLING, time_constant_s=time_constant)
    logged = flown(truth(), duration_s=8.0, seed=3, noise=noise)
    rate = np.concatenate([a.motion.rate - b.motion.rate for a, b in zip(logged, clean, strict=True)])
    turned = [
        (Rotation.from_matrix(b.motion.rotation).inv() * Rotation.from_matrix(a.motion.rotation)).as_rotvec()
        for a, b in zip(logged, clean, strict=True)
    ]
    speed = np.concatenate([a.speed - b.speed for a, b in zip(logged, clean, strict=True)])
    assert rate.std() == pytest.approx(noise.rate, rel=0.1)
    assert np.concatenate(turned).std() == pytest.approx(noise.attitude, rel=0.1)
    assert speed.std() == pytest.approx(noise.speed, rel=0.1)
    following = np.mean(rate[1:] * rate[:-1]) / rate.var()
    assert following == pytest.approx(np.exp(-0.01 / time_constant) if time_constant else 0.0, abs=0.05)


def test_a_flight_follows_from_its_seed(noisy):
    again = flown(truth(), duration_s=8.0, seed=3, noise=MIDDLING)
    other = flown(truth(), duration_s=8.0, seed=4, noise=MIDDLING)
    for first, second, third in zip(noisy, again, other, strict=True):
        assert np.array_equal(first.motion.rate, second.motion.rate)
        assert np.array_equal(first.speed, second.speed)
        assert not np.array_equal(first.speed, third.speed)


def test_flights_excite_all_axes_and_stay_in_the_air_that_a_vehicle_can_fly(clean):
    assert [flight.name.partition("-")[0] for flight in clean] == list(KINDS)
    for flight in clean:
        assert (flight.motion.rate.std(axis=0) > 0.1).all()
        assert np.abs(flight.motion.velocity).max() < 15.0
        assert flight.motion.rotation[:, 2, 2].min() > 0.3


def test_a_log_of_250_hz():
    model = truth()
    flights = flown(model, ("multisine",), duration_s=2.0, rate_hz=250.0)
    assert (len(flights[0]), flights[0].motion.period) == (500, 0.004)
    assert errors(model, flights).mae[0, RATE] < 2e-3
