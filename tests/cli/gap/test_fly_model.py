"""`cpfls simulate --model`: what was extended or identified is flown."""

import json

import h5py
import numpy as np
import pytest

PATH = {"legs": 1, "displacement_m": 1.0, "period_s": 0.18, "duration_s": 3.0, "yaw_turn_rad": 0.3}
CLOSED = ("--mode", "closed-loop", "--set", "simulation.closed_loop.integration_rate_hz=200")


@pytest.fixture(scope="module")
def path(cpfls, gap_config, tmp_path_factory):
    target = tmp_path_factory.mktemp("path") / "trajectory.h5"
    cpfls.done("trajectory", gap_config, "--set", f"trajectory={json.dumps(PATH)}", "-o", target)
    return target


@pytest.fixture
def fly(cpfls, gap_config, path, tmp_path):
    def call(name, *options):
        target = tmp_path / name
        result = cpfls.done("simulate", gap_config, path, *CLOSED, *options, "-o", target, "--json")
        with h5py.File(target) as file:
            return file["rotor_speed"][()], json.loads(result.stdout)["effects"]

    return call


def test_extended_model_flies_as_its_effects_do(fly, extended):
    plain, _ = fly("plain.h5")
    model, effects = fly("model.h5", "--model", extended)
    truth, _ = fly("truth.h5", "--effect", "com_offset=0.008,-0.005")
    # The rotors in front and behind balance what hangs off centre.
    assert np.abs(truth - plain).max() > 5
    assert np.abs(model - truth).max() < 0.05 * np.abs(truth - plain).max()
    assert effects["com_offset.c_x"] == pytest.approx(0.008, rel=0.02)
    # What the refit makes of the inertia stands in the vehicle.
    assert "parameter_error.inertia_x" not in effects


def test_effects_come_on_top_of_a_model(fly, extended):
    model, _ = fly("model.h5", "--model", extended)
    more, effects = fly("more.h5", "--model", extended, "--effect", "torque_bias.M_z=0.1")
    assert effects["torque_bias.M_z"] == 0.1
    assert np.abs(more - model).max() > 5


def test_identified_model_is_flown(cpfls, fly, gap_config, path, tmp_path):
    """A rigid body under a fuzzy part without weight flies as the vehicle whose inertia it found."""
    flight, model = tmp_path / "flight.h5", tmp_path / "model.h5"
    cpfls.done("simulate", gap_config, path, "-o", flight)
    off = "local_search: {enabled: false}, validation: {enabled: false}"
    words = ("--set", f"identification={{base: rigid-body, population: 10, generations: 1, {off}}}")
    cpfls.done("identify", gap_config, flight, *words, "-o", model)
    identified, effects = fly("identified.h5", "--model", model)
    plain, _ = fly("plain.h5")
    assert effects == {}
    assert np.abs(identified - plain).max() < 0.01 * plain.mean()


def test_a_file_that_is_no_model_is_refused(refuse, gap_config, path, tmp_path):
    (line,) = refuse("simulate", gap_config, path, *CLOSED, "--model", path, "-o", tmp_path / "x.h5")
    assert "is a cpfls/trajectory; this command needs a model (made by `cpfls identify`" in line
