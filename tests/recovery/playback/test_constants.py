"""Constants of a vehicle in gusts, by what comes again: runs of a path, or setpoints from outside of the loop."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.blocks import half_width
from cpfls_cli.playback.constants import find_constants
from cpfls_cli.playback.instruments import instruments
from cpfls_cli.playback.parameters import LOG_INERTIA
from tests.builders.gusty_flights import CALM, GUSTS, SMALL, Flight, gusty_flights

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
    """What each set tells, from moments of inertia twice too large."""
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
    assert constants[name].tells
    assert np.abs(off).max() < 0.25
    # Of four intervals of 95 % some do not hold the truth at times.
    assert (np.abs(off) < 2 * half).all()


def test_in_still_air_they_tell_it_to_a_per_cent(constants):
    off, _ = _moments(constants["calm"])
    assert np.abs(off).max() < 0.01
    assert constants["calm"].explained.used.all()


def test_what_instruments_do_not_tell_is_not_determined(constants):
    """About yaw gusts turn the vehicle by more than the path asks for."""
    found = constants["setpoints"]
    yaw = found.fitted.free.index[LOG_INERTIA[2]]
    assert not found.spread.determined[yaw]


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
