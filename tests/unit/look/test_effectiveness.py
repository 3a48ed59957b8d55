"""Effectiveness of an axis in gusts, whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.look.effectiveness import PlantModel, axis_effectiveness, effectiveness
from tests.builders.looked_flights import TRUTH, flown, without_sticks


@pytest.fixture(scope="module")
def flight():
    return flown(np.random.default_rng(1), gusts=8.0, sticks=4.0)


@pytest.fixture(scope="module")
def plant(flight):
    return axis_effectiveness(flight, 0)


def truth(frequency):
    return PlantModel(TRUTH.gain, TRUTH.delay, TRUTH.lag, TRUTH.damping, 0.0).acceleration(np.asarray(frequency))


def test_the_setpoint_identifies_what_least_squares_misses(plant):
    actual = float(np.abs(truth(plant.at_hz)))
    assert plant.identified
    assert plant.instrument == "rate setpoint"
    assert plant.effectiveness.low <= actual <= plant.effectiveness.high
    assert plant.effectiveness.half < 0.3 * actual
    assert abs(plant.least_squares.value / actual - 1) > 2 * abs(plant.effectiveness.value / actual - 1)


def test_the_delay_is_found_within_two_milliseconds_in_calm_air():
    found = axis_effectiveness(flown(np.random.default_rng(2), gusts=0.5, sticks=4.0), 0)
    turn = 2 * np.pi * found.at_hz
    actual = TRUTH.delay + np.arctan(turn * TRUTH.lag) / turn
    assert found.total_delay.value == pytest.approx(actual, abs=0.002)
    assert found.total_delay.low <= actual <= found.total_delay.high


def test_possible_plants_scatter_as_the_interval(plant):
    possible = np.abs(plant.possible.acceleration(np.array([plant.at_hz])))[:, 0]
    half = 0.5 * np.ptp(np.quantile(possible, [0.025, 0.975]))
    assert half == pytest.approx(plant.effectiveness.half, rel=0.25)


def test_what_is_asked_of_the_state_is_no_instrument():
    found = axis_effectiveness(flown(np.random.default_rng(3), gusts=8.0, angle=6.0, sticks=2.0), 0)
    assert found.instrument == "stick"


def test_resting_sticks_identify_nothing(flight):
    found = axis_effectiveness(without_sticks(flight), 0)
    assert found.verdict == "none"
    assert "rests" in found.reason
    assert found.effectiveness is None
    assert found.draws.shape == (0, 5)


def test_a_stick_that_does_not_move_the_vehicle_is_weak(flight):
    rng = np.random.default_rng(4)
    other = np.where(np.isnan(flight.stick), np.nan, 0.3 * rng.standard_normal(flight.stick.shape))
    found = axis_effectiveness(replace(flight, stick=other, rate_setpoint=0.1 * other), 0)
    assert found.verdict == "weak"
    assert found.effectiveness is None


def test_silent_axes_are_not_identified(flight):
    assert [each.verdict for each in effectiveness(flight)][1:] == ["none", "none"]


def test_numbers_do_not_hang_on_what_is_not_usable(flight, plant):
    broken = flight.body_rate.copy()
    broken[5000:5200] = 1e3
    usable = flight.usable.copy()
    usable[5000:5200] = False
    found = axis_effectiveness(replace(flight, body_rate=broken, usable=usable), 0)
    assert found.effectiveness.value == pytest.approx(plant.effectiveness.value, rel=0.1)
