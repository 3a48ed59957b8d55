"""A recording that hardly turns is not identified in silence: it is said how short it is, and how long would do."""

import numpy as np
import pytest

from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.findings import swings
from cpfls_cli.regressor.regressor import Motion
from tests.builders.studies import VEHICLE

STUDY = """\
seed: 1
import:
  signals:
    attitude: {columns: [roll, pitch, yaw], unit: rad}
    body_rate: {columns: [p, q, r], unit: rad/s}
    body_torque: {columns: [mx, my, mz], unit: N m}
identification:
  structure: cpfls
  base: none
  input_map: data-range
  consequents: seesaw
  products: additive
  membership_functions: 5
  population: 10
  generations: 1
  local_search: {enabled: false}
  validation: {enabled: false}
"""
INERTIA = np.array([0.6, 0.6, 1.2])


@pytest.fixture
def notes(cpfls, tmp_path):
    """Identify a model in a log of some seconds; give the notes of it."""

    def call(seconds):
        time, rng = np.arange(0.0, seconds, 0.02), np.random.default_rng(3)
        pace = np.array([3.0, 2.5, 2.0])
        attitude = 0.3 * np.sin(pace * time[:, None])
        rate, change = 0.3 * pace * np.cos(pace * time[:, None]), -0.3 * pace**2 * np.sin(pace * time[:, None])
        torque = INERTIA * change + 0.01 * rng.standard_normal(change.shape)
        rows = np.column_stack([time, attitude, rate + 0.01 * rng.standard_normal(rate.shape), torque])
        log, config, flight = (tmp_path / name for name in ("log.csv", "study.yaml", "flight.h5"))
        np.savetxt(log, rows, delimiter=",", header="t,roll,pitch,yaw,p,q,r,mx,my,mz", comments="")
        config.write_text(STUDY + VEHICLE)
        for words in (("import", config, log, "-o", flight), ("identify", config, flight, "-o", tmp_path / "m.h5")):
            result = cpfls.done(*words, "--force", "-v")
        return [line for line in result.stderr.splitlines() if "swings" in line]

    return call


def test_two_seconds_are_too_short_and_it_says_how_long_would_do(notes):
    (note,) = notes(2.0)
    assert note.startswith("cpfls: note: the training flights are short: in 2 s the rates reverse 2, 2, 1 times about")
    assert "roll, pitch, yaw, 5 swings for " in note
    assert "train on about " in note


def test_two_minutes_are_long_enough(notes):
    assert notes(120.0) == []


def test_noise_is_no_swing():
    time = np.arange(0.0, 20.0, 0.01)
    noise = 0.05 * np.random.default_rng(1).standard_normal((2000, 3))
    rate = np.sin(np.array([1.0, 2.0, 3.0]) * time[:, None]) + noise
    still = np.zeros_like(rate)
    found = swings(TorqueData(time, Motion(still, rate, still), still))
    assert found.seconds == pytest.approx(20.0)
    np.testing.assert_allclose(found.by_axis, 20 * np.array([1, 2, 3]) / np.pi, atol=1.5)
