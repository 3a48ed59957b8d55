"""Effectiveness of an axis in gusts, whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.look import flight as reasons
from cpfls_cli.look.effectiveness import PlantModel, axis_effectiveness, effectiveness
from cpfls_cli.look.flight import MADE_BY_STICKS, LogFlight, Samples, explained
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


@pytest.fixture(scope="module")
def calm():
    return flown(np.random.default_rng(2), gusts=0.5, sticks=4.0)


def test_the_delay_is_found_within_two_milliseconds_in_calm_air(calm):
    found = axis_effectiveness(calm, 0)
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


def test_sticks_that_rest_or_move_nothing_identify_nothing(flight):
    found = axis_effectiveness(without_sticks(flight), 0)
    assert found.verdict == "none"
    assert "rests" in found.reason
    assert found.effectiveness is None
    assert found.draws.shape == (0, 5)
    rng = np.random.default_rng(4)
    other = np.where(np.isnan(flight.stick), np.nan, 0.3 * rng.standard_normal(flight.stick.shape))
    found = axis_effectiveness(replace(flight, stick=other, rate_setpoint=0.1 * other), 0)
    assert found.verdict == "weak"
    assert found.effectiveness is None
    assert [each.verdict for each in effectiveness(flight)][1:] == ["none", "none"]


def test_numbers_do_not_hang_on_what_is_not_usable(flight, plant):
    broken = flight.body_rate.copy()
    broken[5000:5200] = 1e3
    usable = flight.usable.copy()
    usable[5000:5200] = False
    found = axis_effectiveness(replace(flight, body_rate=broken, usable=usable), 0)
    assert found.effectiveness.value == pytest.approx(plant.effectiveness.value, rel=0.1)


def test_the_phase_is_that_of_the_vehicle_above_its_crossover(calm):
    found = axis_effectiveness(calm, 0)
    assert found.band_hz[1] > 5
    apart = np.angle(found.model.rate(np.array([5.0, 10.0])) / truth([5.0, 10.0]) * 2j * np.pi * np.array([5.0, 10.0]))
    assert np.degrees(np.abs(apart)).max() < 10


def test_one_flip_does_not_outweigh_a_flight(calm):
    """A flip whose torque is not the model's leaves the estimate where it was."""
    inside = (calm.time > 20) & (calm.time < 20.6)
    flip = np.where(inside, 6.0 * np.sin(np.pi * (calm.time - 20) / 0.6) ** 2, 0.0)[:, None]
    rate, asked, stick = calm.body_rate + 3 * flip, calm.rate_setpoint + flip, calm.stick + flip / 3
    found = axis_effectiveness(replace(calm, body_rate=rate, rate_setpoint=asked, stick=stick), 0)
    assert found.effectiveness.value == pytest.approx(float(np.abs(truth(found.at_hz))), rel=0.1)


def turned_by_rotors(rng, lead):
    """Turn about yaw by a command that sticks make alone, with the momentum of accelerated rotors, at 400 Hz."""
    steps, period, hand = 16000, 1 / 400, np.hanning(48)
    stick = np.convolve(np.repeat(rng.standard_normal(400), 40), hand / hand.sum(), "same")[:steps]
    rate, lagged, sent, rates = 0.0, 0.0, 0.2 * stick, np.zeros(steps)
    for step in range(4, steps):
        change = (sent[step - 4] - lagged) * (1 - np.exp(-period / 0.02))
        lagged += change
        rates[step] = rate
        rate += period * (100 * (lagged + lead * change / period) - 2 * rate + rng.standard_normal())
    time, nothing = np.arange(steps) * period, np.full((steps, 3), np.nan)

    def yaw(values):
        return np.stack([0 * values, 0 * values, values], axis=1)

    return LogFlight(
        name="yaw", rate_hz=400.0, time=time, body_rate=yaw(rates), command=yaw(sent), rate_setpoint=yaw(stick),
        stick=yaw(stick), attitude_setpoint=nothing, attitude=nothing, collective=nothing[:, 0],
        voltage=nothing[:, 0], current=nothing[:, 0], height=nothing[:, 0], climb_rate=nothing[:, 0],
        specific_force=nothing, flown=np.ones(steps, bool), usable=np.ones(steps, bool),
        rotors=Samples(np.zeros(0), np.zeros((0, 4))), gyroscope=Samples(time, yaw(rates)), gaps_s=np.zeros((0, 2)),
    )  # fmt: skip


@pytest.mark.parametrize("lead", [0.03, 0.15])
def test_yaw_leads_by_the_momentum_of_its_rotors(lead):
    found = axis_effectiveness(turned_by_rotors(np.random.default_rng(6), lead), 2)
    assert found.identified
    assert found.model.lead == pytest.approx(lead, rel=0.15)
    actual = PlantModel(100.0, 0.01, 0.02, 2.0, lead)
    assert found.effectiveness.value == pytest.approx(np.abs(actual.acceleration(found.at_hz)), rel=0.05)


def test_reasons_name_what_is_missing(flight):
    silent = np.full_like(flight.command, np.nan)
    assert axis_effectiveness(replace(flight, rate_hz=20.0), 0).reason == reasons.TOO_SLOW
    assert axis_effectiveness(replace(flight, command=silent), 0).reason == reasons.NO_COMMAND
    # A stick that rests all along is not listed among the signals of a log, as if it had none.
    found = axis_effectiveness(replace(flight, stick=np.full_like(flight.stick, np.nan)), 0)
    assert found.reason.startswith("no stick is logged that moves,")
    short = axis_effectiveness(replace(flight, usable=flight.time < 7), 0).reason
    assert short == "7 s are usable in pieces of at least 1 s; 10 s are needed"
    # What slow motion is taken out of has no ends left.
    pieces = axis_effectiveness(replace(flight, usable=flight.time % 1.5 < 1.4), 0).reason
    assert pieces == "0 s are usable in pieces of at least 1 s; 10 s are needed"
    stick = np.where(flight.time[:, None] % 1.5 < 1.4, flight.stick, np.nan)
    unknown = np.full_like(flight.rate_setpoint, np.nan)
    assert axis_effectiveness(replace(flight, stick=stick, rate_setpoint=unknown), 0).reason == pieces


def test_a_setpoint_whose_changes_answer_the_state_is_no_instrument():
    rng, usable = np.random.default_rng(8), np.ones(20000, dtype=bool)
    slow, fast = (
        np.convolve(rng.standard_normal(20400), np.ones(each) / each**0.5, "same")[:20000] for each in (400, 20)
    )
    assert explained(2.0 * slow, slow, usable, 500.0) > 0.99
    assert explained(2.0 * slow + 0.2 * fast, slow, usable, 500.0) < MADE_BY_STICKS
