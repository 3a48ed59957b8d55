"""Forecasts that use the past: what is observed, that nothing later is seen, and gusts whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cpfls_cli.playback.fit import Fitted, fit, windows_of
from cpfls_cli.playback.history_fit import errors_with_past, find_history, fit_observer
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import Observer, free_runs, observed, past_of, player_of
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.playback.structure import Structure
from tests.builders.gusty_flights import SMALL, STORM, Flight, gusty_flights
from tests.builders.playback_flights import MIDDLING, STATED, TRUE_BLOCKS, flown, truth
from tests.builders.random_flights import VEHICLE, flight_of

OBSERVER = Observer(
    rate=np.array([20.0, 20.0, 5.0, 9.0, 9.0, 3.0]), memory_s=np.array([0.2, 0.2, 0.5, 0.3, 0.3, 1.0]), past_s=0.2
)
MODEL = VehicleModel(vehicle=VEHICLE)


def with_past(flight, observer=OBSERVER, model=MODEL):
    return replace(player_of(model, flight), observer=observer)


def test_the_weights_of_the_past_are_those_of_the_recursion():
    period, rng = 0.01, np.random.default_rng(1)
    missed, known = rng.standard_normal((20, 6)), np.zeros(6)
    for step in missed:
        share = 1.0 - np.exp(-OBSERVER.rate * period)
        known = np.exp(-period / OBSERVER.memory_s) * (known + share * (step - known))
    np.testing.assert_allclose((OBSERVER.weights(period) * missed).sum(axis=0), known, rtol=1e-12)


def test_a_constant_push_is_observed_and_acts_on():
    """Torque and force that a vehicle feels and its model does not: a flight that the pushed model itself flies."""
    flight, patient = flight_of(), replace(OBSERVER, rate=np.full(6, 1e4), memory_s=np.full(6, 1e4))
    push = np.array([0.02, -0.03, 0.01, 0.4, 0.3, -0.5])
    player = player_of(MODEL, flight)
    errors = free_runs(replace(player, along=np.tile(push, (len(flight), 1))), flight, np.array([0]), 79).errors[0]
    motion = flight.motion
    flown = flight_of(
        motion=motion._replace(
            velocity=np.concatenate([motion.velocity[:1], motion.velocity[1:] + errors[:, 1]]),
            rate=np.concatenate([motion.rate[:1], motion.rate[1:] + errors[:, 3]]),
            rotation=np.concatenate([motion.rotation[:1], turned(motion.rotation[1:], errors[:, 2])]),
        )
    )
    starts = np.array([30, 40])
    np.testing.assert_allclose(observed(with_past(flown, patient), flown, starts), [push, push], rtol=0.02)
    without, known = (free_runs(each, flown, starts, 30).errors for each in (player, with_past(flown, patient)))
    assert np.abs(known[:, :, 3]).max() < 0.02 * np.abs(without[:, :, 3]).max()


def turned(rotation, vectors):
    return rotation @ Rotation.from_rotvec(vectors).as_matrix()


@pytest.mark.parametrize("signal", ["position", "velocity", "rotation", "rate"])
def test_no_forecast_sees_the_motion_after_its_start(signal):
    flight, start = flight_of(), 30
    later = np.arange(len(flight)) > start
    values = getattr(flight.motion, signal)
    other = np.where(later.reshape(-1, *[1] * (values.ndim - 1)), values[::-1], values)
    peeked = replace(flight, motion=flight.motion._replace(**{signal: other}))
    starts = np.array([start])
    seen = [observed(with_past(each), each, starts) for each in (flight, peeked)]
    np.testing.assert_array_equal(*seen)
    if signal != "rotation":
        row = ("position", "velocity", None, "rate").index(signal)
        forecasts = [
            free_runs(with_past(each), each, starts, 30).errors[0, :, row]
            + getattr(each.motion, signal)[start + 1 : start + 31]
            for each in (flight, peeked)
        ]
        np.testing.assert_allclose(*forecasts, atol=1e-12)


def test_what_comes_before_the_past_or_a_pause_says_nothing():
    flight = flight_of()
    parts = flight_of(stretches=(slice(0, 35), slice(35, 80)))
    steps, known = past_of(parts, np.array([30, 40]), 20)
    assert known.sum(axis=1).tolist() == [20, 5]
    assert steps.min() == 10
    assert np.all(steps[1] >= 35)
    whole, cut = (observed(with_past(each), each, np.array([40]))[0] for each in (flight, parts))
    short = observed(with_past(flight, replace(OBSERVER, past_s=0.05)), flight, np.array([40]))[0]
    np.testing.assert_allclose(cut, short, rtol=1e-12)
    assert np.abs(whole - cut).max() > 1e-6
    np.testing.assert_array_equal(observed(with_past(parts), parts, np.array([0, 35])), np.zeros((2, 6)))


def test_runs_by_batches_are_runs_one_by_one():
    flight = flight_of(samples=400)
    starts = flight.starts(20, 1)
    together = free_runs(with_past(flight), flight, starts, 20).errors
    alone = [free_runs(with_past(flight), flight, starts[[at]], 20).errors[0] for at in (0, 5, 260, len(starts) - 1)]
    np.testing.assert_allclose(together[[0, 5, 260, -1]], alone, rtol=1e-9, atol=1e-12)


@pytest.fixture(scope="module")
def gusty():
    """Flights in storm, and the vehicle that flew them but for the gusts."""
    flights = list(gusty_flights([Flight(SMALL, STORM, path, path) for path in range(3)], seconds=12.0))
    free = Structure(("lag",)).free(SMALL.vehicle)
    values = free.values({"lag.time_constant_s": 0.0})
    return flights, Fitted(free, values, 0.0, np.eye(len(values)))


def test_the_gradient_of_the_observer_is_the_difference_quotient(gusty, monkeypatch):
    (flights, fitted), asked = gusty, []
    monkeypatch.setattr("cpfls_cli.playback.history_fit.minimised", lambda *given: asked.append(given[0]) or given[1])
    fit_observer(fitted, windows_of(flights[:1], 0.3, 1.0), 0.2)
    values, (point,) = np.log([[20.0, 0.2], [8.0, 0.4]] * 2).ravel(), asked
    steps = 1e-4 * np.eye(len(values))
    slopes = [(point(values + step).objective - point(values - step).objective) / 2e-4 for step in steps]
    np.testing.assert_allclose(point(values).gradient, slopes, rtol=1e-3, atol=1e-3 * np.abs(slopes).max())


def test_gusts_that_last_are_forecast_on_a_flight_that_was_kept_aside(gusty):
    """The gusts of the builder last 0.31 to 1.18 s: what was observed before a start lowers the errors after it."""
    flights, fitted = gusty
    observer = fit_observer(fitted, windows_of(flights[:2], 0.5, 0.5), 0.5)
    model, kept = fitted.model, flights[2]
    starts, player = kept.starts(50, 5), player_of(model, kept)
    without, known = (
        np.linalg.norm(free_runs(each, kept, starts, 50).errors[:, :, 3], axis=2).mean(axis=0).sum()
        for each in (player, replace(player, observer=observer))
    )
    assert known < 0.7 * without
    (windows,) = windows_of([kept], 0.5, 0.5)
    still = replace(observer, rate=np.full(6, 1e-9))
    assert errors_with_past(fitted, observer, windows).mean() < 0.7 * errors_with_past(fitted, still, windows).mean()


def test_where_the_model_misses_nothing_no_part_is_fitted_to_see_that():
    """Still air: the observer gains nothing on the flights that it was fitted to; fits without parts are not asked."""
    flights = flown(truth(), ("figure", "steps"), duration_s=5.0, noise=MIDDLING, seed=2)
    fitted = fit(Structure(TRUE_BLOCKS).free(STATED), windows_of(flights, 0.5, 0.5), {}, 12, 1e-4)
    assert find_history(None, fitted, flights, PlaybackSettings()) is None
