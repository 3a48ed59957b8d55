"""Constants of a vehicle in gusts, by what comes again: runs of a path, or setpoints from outside of the loop."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.signal import lfilter

from cpfls_cli.blocks import half_width
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.playback.balances import band_windows
from cpfls_cli.playback.constants import _Search, find_constants
from cpfls_cli.playback.instruments import instruments
from cpfls_cli.playback.parameters import LOG_INERTIA
from tests.builders.gusty_flights import CALM, GUSTS, LARGE, MEMORY_S, SMALL, Flight, gusty_flights

SETS = {"calm": (CALM, 1), "repeats": (GUSTS, 4), "setpoints": (GUSTS, 1)}
"""Gusts, and how often each of two paths is flown."""


@pytest.fixture(scope="module")
def flights():
    """Flights of 40 s of each set; runs of a path have no setpoints, flights that are no runs have them."""
    flown = gusty_flights(
        [Flight(SMALL, gusts, path, draw) for gusts, runs in SETS.values() for path in (0, 1) for draw in range(runs)]
    )
    sets = {name: [next(flown) for _ in range(2 * runs)] for name, (_, runs) in SETS.items()}
    return sets | {"repeats": [replace(flight, setpoints={}) for flight in sets["repeats"]]}


@pytest.fixture(scope="module")
def constants(flights):
    """What each set shows, from moments of inertia twice too large."""
    begun = replace(
        SMALL.vehicle, inertia_kg_m2=(*(2 * moment for moment in SMALL.inertia), 0.0, 0.0, 0.0), unknown=("inertia",)
    )
    return {name: find_constants(begun, flown, instruments(flown)) for name, flown in flights.items()}


def _moments(found):
    """Logarithms of the moments about roll and pitch over the true ones, and half of their 95 % intervals."""
    places = [found.fitted.free.index[name] for name in LOG_INERTIA[:2]]
    error = np.sqrt(np.diag(found.spread.covariance))[places]
    return found.fitted.values[places] + np.log(2.0), half_width(error, found.spread.blocks)


@pytest.mark.parametrize("name", ["repeats", "setpoints"])
def test_in_gusts_instruments_tell_the_body(constants, name):
    """Least squares finds 0.8 to 1.9 times the true moments in such gusts, with intervals of 5 %."""
    off, half = _moments(constants[name])
    assert constants[name].identified
    assert np.abs(off).max() < 0.25
    # Of four intervals of 95 % some do not hold the truth at times.
    assert (np.abs(off) < 2 * half).all()


def test_in_still_air_they_tell_it_to_a_per_cent(constants):
    off, _ = _moments(constants["calm"])
    assert np.abs(off).max() < 0.01
    assert all(band.used for band in constants["calm"].used.bands)


def test_what_instruments_do_not_tell_is_not_determined(constants):
    """About yaw gusts turn the vehicle by more than the path asks for."""
    found = constants["setpoints"]
    assert not found.spread.determined[found.fitted.free.index[LOG_INERTIA[2]]]


@cache
def _of_three_paths(truth):
    return list(gusty_flights([Flight(truth, GUSTS, path, 100 + path, reach=3.0) for path in range(3)], 20.0))


def _by_what_was_before(truth, leave_out=()):
    """What flights of three paths in gusts tell without repeats or setpoints, from moments twice too large."""
    alone = [replace(flight, setpoints={}) for flight in _of_three_paths(truth)]
    twice = (*(2 * moment for moment in truth.inertia), 0.0, 0.0, 0.0)
    begun = replace(truth.vehicle, inertia_kg_m2=twice, unknown=("inertia",))
    return find_constants(begun, alone, instruments(alone), leave_out, past=True)


@pytest.mark.parametrize("truth", [SMALL, LARGE], ids=["45 g", "1.5 kg"])
def test_in_gusts_what_was_before_shows_the_body(truth, monkeypatch):
    """Least squares finds twice the true moments and more; what all bands need, such as a lag, fewer need as well."""
    chosen, found_in = _Search.chosen, []
    monkeypatch.setattr(_Search, "chosen", lambda *given: found_in.append(chosen(*given)) or found_in[-1])
    found = _by_what_was_before(truth)
    assert len(found_in) > 1
    assert all({*found_in[0].blocks} <= {*each.blocks} for each in found_in)
    off, half = _moments(found)
    assert found.identified
    assert found.used.kind == "past"
    assert np.abs(off).max() < 0.06
    assert (np.abs(off) < 2 * half).all()


def test_what_was_before_shows_no_body_whose_damping_is_missing():
    """At 1 Hz damping takes as much as the rotation; without it no moment about roll explains what is predicted."""
    damped = SMALL._replace(damping=2e-4)
    assert not _by_what_was_before(damped, tuple(CATALOGUE)).identified
    assert _by_what_was_before(damped).identified


def test_flights_without_instruments_have_no_constants(flights):
    alone = [replace(flight, setpoints={}) for flight in flights["setpoints"]]
    assert find_constants(SMALL.vehicle, alone, instruments(alone)) is None


@pytest.mark.parametrize("left_out", ["short", "slow", "inertia"])
def test_flights_that_cannot_be_asked_have_no_constants(flights, left_out):
    """Two seconds, a log of 25 Hz, and an inertia that is not to be sought."""
    (first, *_) = flights["setpoints"]
    if left_out == "slow":
        first = replace(first, motion=first.motion._replace(period=0.04))
    if left_out == "short":
        first = replace(first, stretches=(slice(0, 200),))
    known = replace(SMALL.vehicle, unknown=())
    blocks = ("inertia",) if left_out == "inertia" else ()
    assert find_constants(known, [first], instruments([first]), blocks) is None


def _limited_information(torque, turning, asked):
    """Estimate c in ``torque = c turning`` by LIML: the least ratio of residuals without and with instruments."""
    both = np.stack([torque, turning], axis=1)
    left = both - asked @ np.linalg.lstsq(asked, both, rcond=None)[0]
    moments = both.T @ both - eigh(both.T @ both, left.T @ left, eigvals_only=True)[0] * left.T @ left
    return moments[0, 1] / moments[1, 1]


@pytest.fixture(scope="module")
def shaken():
    """Flights whose paths shake, and what they tell."""
    flown = list(gusty_flights([Flight(SMALL, GUSTS, path, 5, reach=2.5) for path in range(3)], 40.0))
    return flown, find_constants(SMALL.vehicle, flown, instruments(flown))


@pytest.mark.parametrize("axis", [0, 1])
def test_limited_information_maximum_likelihood_finds_the_same_body(shaken, axis):
    """Another estimator by hand: one axis, one band, lags of the velocity that is asked for."""
    flown, found = shaken
    place = found.fitted.free.index[LOG_INERTIA[axis]]
    band = band_windows(0.01, 0.3, 0.8)
    torque = [band.average(flight.speed**2 @ SMALL.mixer[1 + axis]) for flight in flown]
    turning = [band.derivative(flight.motion.rate[:, axis]) for flight in flown]
    lags = [
        np.hstack([np.roll(flight.setpoints["velocity"], lag, axis=0) for lag in range(0, 50, 5)]) for flight in flown
    ]
    asked = [band.average(each) for each in lags]
    other = _limited_information(*(np.concatenate(each) for each in (torque, turning, asked))) / SMALL.inertia[axis]
    assert other == pytest.approx(1.0, abs=0.03)
    assert np.exp(found.fitted.values[place]) == pytest.approx(other, abs=0.03)


@pytest.mark.parametrize("name", ["repeats", "setpoints"])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_controller_that_is_designed_on_them_has_its_margin_on_the_true_body(constants, name, axis):
    """A rate loop of 60 degrees is flown in gusts on the true body; its broken loop is measured by a multisine."""
    place = constants[name].fitted.free.index[LOG_INERTIA[axis]]
    body, true = 2 * SMALL.inertia[axis] * np.exp(constants[name].fitted.values[place]), SMALL.inertia[axis]
    crossover = np.tan(np.radians(30)) / SMALL.lag_s
    gain = crossover * body * np.hypot(1, crossover * SMALL.lag_s)
    step, period = 5e-4, 4.0
    count, lines = round(period / step), np.arange(8, 40)
    rng = np.random.default_rng([7, axis])
    time = step * np.arange(count)
    waves = np.cos(2 * np.pi * np.outer(lines / period, time) + rng.uniform(0, 6.0, (len(lines), 1)))
    shake = np.tile(true * waves.sum(axis=0), 20)
    gusts = true * GUSTS[axis] * _remembered(rng, len(shake), np.exp(-step / MEMORY_S[axis]))
    rate = torque = 0.0
    fed, given = np.zeros((2, len(shake)))
    keep = np.exp(-step / SMALL.lag_s)
    for now, (push, gust) in enumerate(zip(shake.tolist(), gusts.tolist(), strict=True)):
        fed[now] = -gain * rate
        given[now] = fed[now] + push
        after = keep * torque + (1 - keep) * given[now]
        rate += step / true * (0.5 * (torque + after) - SMALL.damping * rate + gust)
        torque = after
    answers = [np.fft.rfft(each[count:].reshape(-1, count).mean(axis=0))[lines] for each in (fed, given)]
    broken = -answers[0] / answers[1]
    near = np.abs(np.log(2 * np.pi * lines / period / crossover)) < 0.5
    turn = 2 * np.pi * lines[near] / period
    size = np.polyfit(np.log(np.abs(broken[near])), np.log(turn), 1)[-1]
    margin = 180 + np.polyval(np.polyfit(np.log(turn), np.degrees(np.angle(broken[near])), 1), size)
    assert np.exp(size) == pytest.approx(crossover, rel=0.15)
    assert margin == pytest.approx(60.0, abs=5.0)


def _remembered(rng, samples, keep):
    return lfilter([np.sqrt(1 - keep**2)], [1.0, -keep], rng.standard_normal(samples))
