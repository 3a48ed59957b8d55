"""Torque that feeds or drains the rotation, against torques made to do so."""

import numpy as np

from cpfls_cli.gap.naming.energy import energy_words

RNG = np.random.default_rng(1)
RATE = RNG.normal(size=(400, 3))
BLOCK = np.repeat(np.arange(10), 40)


def test_damping_drains_and_its_opposite_feeds():
    noise = RNG.normal(size=(400, 3))
    torque = np.column_stack([-0.5 * RATE[:, 0], 0.5 * RATE[:, 1], np.zeros(400)]) + noise
    assert energy_words(torque, RATE, BLOCK) == ["drains", "feeds", "neither"]


def test_a_constant_torque_does_neither():
    assert energy_words(np.ones((400, 3)), RATE + 1, BLOCK) == ["neither"] * 3


def test_few_blocks_say_nothing():
    assert energy_words(-RATE, RATE, BLOCK // 4) == ["neither"] * 3


def test_noise_is_seldom_taken_for_either():
    found = [energy_words(RNG.normal(size=(400, 3)), RATE, BLOCK) for _ in range(100)]
    assert sum(word != "neither" for words in found for word in words) < 15
