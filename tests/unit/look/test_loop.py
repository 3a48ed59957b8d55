"""The loop that flew against the loop that was simulated."""

import numpy as np
import pytest

from cpfls_cli.autopilots.law import Controller
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.look.effectiveness import PlantModel, axis_effectiveness
from cpfls_cli.look.loop import loops_of
from tests.builders.looked_flights import PARAMETERS, RATE_HZ, TRUTH, flown, without_sticks


@pytest.fixture(scope="module")
def flight():
    return flown(np.random.default_rng(5), gusts=2.0, sticks=4.0)


@pytest.fixture(scope="module")
def loop(flight):
    plants = tuple(axis_effectiveness(flight, axis) for axis in range(3))
    return loops_of(flight, plants)[0]


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
    assert loop.by_law.overshoot.value == pytest.approx(actual.max() - 1, abs=0.05)
    assert loop.by_step.overshoot.value == pytest.approx(actual.max() - 1, abs=0.08)
    half = np.argmax(actual > 0.5 * actual[150:250].mean()) / RATE_HZ
    assert loop.by_law.half_s.value == pytest.approx(half, abs=0.006)
    assert loop.by_step.half_s.value == pytest.approx(half, abs=0.012)
    assert (loop.step_low <= loop.step_high).all()


def test_margins_hold_those_of_the_vehicle(loop):
    frequency = np.geomspace(0.5, 100, 20000)
    law = AUTOPILOTS["crazyflie"].law(PARAMETERS)
    model = PlantModel(TRUTH.gain, TRUTH.delay, TRUTH.lag, TRUTH.damping, 0.0)
    opened = model.rate(frequency) * law.response(0, frequency).feedback
    phase = np.unwrap(np.angle(opened)) / np.pi * 180
    turned, crosses = np.argmax(phase < -180), np.argmax(np.abs(opened) < 1)
    actual = {
        "gain_db": -20 * np.log10(np.abs(opened[turned])),
        "phase_deg": 180 + phase[crosses],
        "disk_deg": np.degrees(2 * np.arctan(0.5 / np.abs(0.5 * (1 - opened) / (1 + opened)).max())),
        "crossover_hz": frequency[crosses],
    }
    for name, value in actual.items():
        found = getattr(loop.margins, name)
        assert found.low <= value <= found.high, name
    assert loop.margins.delay_s.value == pytest.approx(
        loop.margins.phase_deg.value / 360 / loop.margins.crossover_hz.value, rel=1e-6
    )


def test_the_response_is_that_of_plant_and_law_where_it_is_clear(loop):
    clear = (loop.frequency > 1) & (loop.frequency < min(loop.clear_hz, 5))
    assert clear.sum() > 4
    apart = np.abs(np.log(loop.gain / loop.law_gain))
    assert apart[clear].mean() < 0.15
    assert loop.bandwidth_hz.low < loop.bandwidth_hz.value < loop.bandwidth_hz.high
    assert 0 < loop.tracking < 1.5


def test_resting_sticks_measure_no_response(flight):
    resting = without_sticks(flight)
    found = loops_of(resting, tuple(axis_effectiveness(resting, axis) for axis in range(3)))[0]
    assert not found.measured
    assert "rests" in found.reason
    assert found.by_step is None
    assert found.margins is None
    assert np.isfinite(found.tracking)
