"""The loop that flew against the loop that was simulated."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.autopilots.law import Controller
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.look import flight as reasons
from cpfls_cli.look.effectiveness import PlantModel, axis_effectiveness
from cpfls_cli.look.loop import PlantAndLaw, _bandwidth, loops_of
from tests.builders.looked_flights import PARAMETERS, RATE_HZ, TRUTH, flown, without_sticks


@pytest.fixture(scope="module")
def flight():
    return flown(np.random.default_rng(5), gusts=2.0, sticks=4.0)


@pytest.fixture(scope="module")
def loop(flight):
    return loops_of(flight, tuple(axis_effectiveness(flight, axis) for axis in range(3)))[0]


def stepped():
    """Step the law and the axis without gusts."""
    controller, period = Controller(AUTOPILOTS["crazyflie"].law(PARAMETERS)), 1 / RATE_HZ
    sent, lagged, rate, shown = np.zeros(round(TRUTH.delay / period) + 1), 0.0, 0.0, []
    controller.command(np.zeros(3), np.zeros(3))
    for _ in range(300):
        command = float(controller.command(np.array([1.0, 0, 0]), np.array([rate, 0, 0]))[0])
        sent = np.concatenate([[command], sent[:-1]])
        lagged += (sent[-1] - lagged) * (1 - np.exp(-period / TRUTH.lag))
        shown.append(rate)
        rate += period * (TRUTH.gain * lagged - TRUTH.damping * rate)
    return np.array(shown)


def test_overshoot_is_that_of_a_simulated_step(loop):
    actual = stepped()
    assert loop.law_step.max() == pytest.approx(actual.max(), abs=0.05)
    assert loop.by_step.overshoot.value == pytest.approx(actual.max() - 1, abs=0.08)
    half = np.argmax(actual > 0.5 * actual[150:250].mean()) / RATE_HZ
    assert loop.time[np.argmax(loop.law_step > 0.5)] == pytest.approx(half, abs=0.012)
    assert loop.by_step.half_s.value == pytest.approx(half, abs=0.012)
    assert (loop.step_low <= loop.step_high).all()


def test_the_law_explains_what_it_flew_and_another_does_not(flight, loop):
    assert loop.law_explains
    assert loop.overshoot == loop.by_step.overshoot
    other = replace(flight, parameters={**PARAMETERS, "pid_rate.roll_kp": 3 * PARAMETERS["pid_rate.roll_kp"]})
    found = loops_of(other, tuple(axis_effectiveness(other, axis) for axis in range(3)))[0]
    assert not found.law_explains
    assert np.isnan(found.law_step).all()
    assert found.overshoot.value == pytest.approx(loop.overshoot.value)


def test_a_response_that_is_cut_shows_no_overshoot(flight):
    # What follows at once has its whole power where the measurement ends.
    at_once = replace(flight, body_rate=flight.rate_setpoint + 0.02 * flight.body_rate)
    found = loops_of(at_once, tuple(axis_effectiveness(flight, axis) for axis in range(3)))[0]
    assert found.measured
    assert found.bandwidth_hz is None
    assert found.overshoot is None


def test_reasons_name_what_is_missing(flight):
    plants = tuple(axis_effectiveness(flight, axis) for axis in range(3))

    def reason(**changed):
        return loops_of(replace(flight, **changed), plants)[0].reason

    assert reason(rate_setpoint=np.full_like(flight.rate_setpoint, np.nan)) == reasons.NO_SETPOINT
    assert reason(rate_hz=20.0) == reasons.TOO_SLOW
    assert reason(usable=flight.time < 12) == "12 s are usable in pieces of at least 2 s; 19 s are needed"


def test_the_response_is_that_of_plant_and_law_where_it_is_clear(loop):
    clear = (loop.frequency > 1) & (loop.frequency < min(loop.clear_hz, 5))
    assert clear.sum() > 4
    plant, law = (
        PlantModel(TRUTH.gain, TRUTH.delay, TRUTH.lag, TRUTH.damping, 0.0),
        AUTOPILOTS["crazyflie"].law(PARAMETERS),
    )
    apart = np.abs(np.log(loop.gain / np.abs(PlantAndLaw(plant, law, 0).closed(np.maximum(loop.frequency, 0.1)))))
    assert apart[clear].mean() < 0.15
    assert loop.bandwidth_hz.low < loop.bandwidth_hz.value < loop.bandwidth_hz.high


def test_resting_sticks_measure_no_response(flight):
    resting = without_sticks(flight)
    found = loops_of(resting, tuple(axis_effectiveness(resting, axis) for axis in range(3)))[0]
    assert not found.measured
    assert "rests" in found.reason
    assert found.by_step is None
    assert found.overshoot is None


def test_a_response_that_begins_below_half_power_has_no_bandwidth():
    frequency = np.arange(6.0)
    assert _bandwidth(frequency, np.array([1.0, 1.0, 1.0, 0.5, 0.1, 0.1]), 5.0) == pytest.approx(
        2.0 + (1 - np.sqrt(0.5)) / 0.5
    )
    assert np.isnan(_bandwidth(frequency, np.full(6, 0.5), 5.0))
