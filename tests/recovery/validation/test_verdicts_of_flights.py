"""Whole validations of flights whose nature is known: a push that no inertia makes, several parts, short parts."""

from collections.abc import Mapping

import numpy as np
import pytest

from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.identify import identify
from cpfls_cli.identification.settings import IdentificationSettings, LocalSearchSettings, ValidationSettings
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.rotations import generalised_torque
from cpfls_cli.validation.evidence import compare_torque
from cpfls_cli.validation.validate import validate
from tests.builders.flights import bent_torque, coloured_noise, rigid_torque

INERTIA = symmetric([0.6, 0.8, 1.2])
rigid, bent = rigid_torque(INERTIA), bent_torque(INERTIA, 0.3)
as_heavy = rigid_torque(symmetric([0.6, 1.087, 1.2]))
"""The rigid body that comes closest to the bent vehicle."""
SETTINGS = IdentificationSettings(
    population=2,
    generations=0,
    local_search=LocalSearchSettings(enabled=False),
    validation=ValidationSettings(structures=False, draws=20, windows=60),
)


def path(seed, samples):
    """Sums of five sines a channel, up to about 30 degrees."""
    rng, time = np.random.default_rng(seed), 0.01 * np.arange(samples)[:, None]
    angle, rate, acceleration = np.zeros((3, samples, 3))
    for _ in range(5):
        w, size, phase = rng.uniform(2, 9, 3), 0.125 * rng.uniform(0.3, 1, 3), rng.uniform(0, 6.28, 3)
        angle += size * np.sin(w * time + phase)
        rate += size * w * np.cos(w * time + phase)
        acceleration -= size * w**2 * np.sin(w * time + phase)
    return time[:, 0], Motion(angle, rate, acceleration)


def pushed(m):
    """A rigid body and a constant torque."""
    return rigid(m) + generalised_torque(m.attitude, np.tile([0.5, -0.5, 0.25], (len(m), 1)))


def flight_of_sines(torque_of, seed, noise=0.02, samples=1200, memory=0.0):
    time, m = path(seed, samples)
    coloured = coloured_noise(np.random.default_rng(seed + 1), samples, memory)
    torque = torque_of(m)
    return TorqueData(time, m, torque + noise * torque.std(axis=0) * coloured)


def judged(training, parts: Mapping[str, TorqueData], settings=SETTINGS):
    found = identify(training, training, parts, settings, np.random.default_rng(1))
    return found, validate(training, training, parts, settings, found, np.random.default_rng(5)).verdict


def test_a_constant_torque_is_no_reason_for_a_fuzzy_inertia():
    """The fuzzy part imitates the push and beats a rigid body that has no constant."""
    training, other = flight_of_sines(pushed, 10), flight_of_sines(pushed, 60)
    found, verdict = judged(training, {"other": other})
    assert compare_torque(other, found.model.torque, found.baselines[0].torque).lower
    assert verdict.label == "not-better-than-rigid-body"
    assert sum("a constant torque of" in text for text, _ in verdict.reasons) == 3


@pytest.mark.parametrize("order", [1, -1])
def test_all_parts_are_judged_in_whatever_order(order):
    training = flight_of_sines(bent, 10)
    parts = {"bent": flight_of_sines(bent, 60), "rigid": flight_of_sines(as_heavy, 70)}
    assert judged(training, {"bent": parts["bent"]})[1].label == "good-inside-region"
    _, verdict = judged(training, dict(list(parts.items())[::order]))
    assert verdict.label == "not-better-than-rigid-body"
    compared = [text for text, _ in verdict.reasons if text.startswith("squared error")]
    assert sum("(bent)" in text for text in compared) == 2
    assert sum("(rigid)" in text for text in compared) == 2


@pytest.mark.parametrize("seed", [10, 11, 12])
def test_a_short_part_with_coloured_noise_proves_nothing(seed):
    training = flight_of_sines(rigid, seed, 0.2, memory=20)
    _, verdict = judged(training, {"other": flight_of_sines(rigid, seed + 50, 0.2, memory=20)[500:540]})
    assert verdict.label in ("not-better-than-rigid-body", "do-not-use")
    assert not any("by more than chance over" in text for text, _ in verdict.reasons)


def test_a_short_part_of_a_bent_vehicle_proves_nothing_either():
    _, verdict = judged(flight_of_sines(bent, 10), {"other": flight_of_sines(bent, 60)[500:550]})
    assert verdict.label == "not-better-than-rigid-body"
