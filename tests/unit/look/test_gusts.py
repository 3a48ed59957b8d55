"""Gusts of known size in a loop that answers them."""

import numpy as np
import pytest

from cpfls_cli.look.answers import gusts_of
from cpfls_cli.look.effectiveness import PlantModel
from tests.builders.look_flights import correlated, still_flight

RATE, B, DELAY = 100.0, 200.0, 0.03
PLANT = PlantModel(B, DELAY, lag=0.0, damping=0.0, lead=0.0)


def gusty(seed, size=3.0, memory=0.4, seconds=60.0, noise=0.01):
    """Roll under rate feedback, with what it asks for acting a delay later."""
    generator = np.random.default_rng(seed)
    samples, late = round(seconds * RATE), round(DELAY * RATE)
    gust = size * correlated(generator, samples, RATE, memory)[:, 0]
    measured = noise * generator.normal(size=samples)
    rate, command = np.zeros(samples), np.zeros(samples)
    for k in range(samples - 1):
        command[k] = -0.03 * (rate[k] + measured[k])
        acts = command[k - late] if k >= late else 0.0
        rate[k + 1] = rate[k] + (B * acts + gust[k]) / RATE
    three = np.zeros((samples, 3))
    three[:, 0], commands = rate + measured, three.copy()
    commands[:, 0] = command
    return still_flight(seconds, RATE, body_rate=three, command=commands)


def in_band(size, memory):
    """Root mean square from 0.2 to 6 Hz of a process of first order."""
    return size * np.sqrt(np.diff(np.arctan(2 * np.pi * memory * np.array([0.2, 6.0])))[0] * 2 / np.pi)


def test_size_and_memory_of_gusts_are_found_though_the_loop_answers():
    found = [gusts_of(gusty(seed, memory=0.15), {"roll": PLANT})[0] for seed in range(12)]
    assert found[0].axis == "roll"
    truth = in_band(3.0, 0.15)
    assert sum(each.in_band.low <= truth <= each.in_band.high for each in found) >= 10
    assert sum(each.size.low <= 3.0 <= each.size.high for each in found) >= 10
    assert sum(each.memory.low <= 0.15 <= each.memory.high for each in found) >= 10
    assert abs(np.mean([each.size.value for each in found]) - 3.0) < 0.2


@pytest.mark.parametrize("seed", [2, 3])
def test_long_gusts_have_a_size_in_the_band_alone_which_slower_ones_do_not_raise(seed):
    (found,) = gusts_of(gusty(seed, memory=3.0, seconds=120.0), {"roll": PLANT})
    assert found.size is None
    assert found.memory is None
    assert found.in_band.low < in_band(3.0, 3.0) < found.in_band.high


def test_what_is_not_known_is_left_out():
    assert (gusts_of(gusty(0), {}), gusts_of(gusty(0, seconds=30.0), {"roll": PLANT})) == ((), ())
