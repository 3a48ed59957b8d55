"""`cpfls simulate --model`: attitude control with an identified model, and what it is compared with."""

import json
import re

import h5py
import numpy as np
import pytest

from tests.builders.artifacts import edited
from tests.builders.studies import VEHICLE

CONFIG = """\
seed: 5
trajectory: {legs: 1, displacement_m: 1.0, period_s: 0.18, duration_s: 3.0, sample_time_s: 0.02, yaw_turn_rad: 0.3}
simulation: {closed_loop: {integration_rate_hz: 200}, computed_torque: {control_rate_hz: 50}}
identification:
  base: rigid-body
  population: 10
  generations: 1
  local_search: {enabled: false}
  validation: {draws: 20, windows: 20, horizon_samples: 6}
"""
CONTROLLERS = ["model", "rigid-body", "pd", "vehicle"]
NAMED = ["identified model", "rigid body", "PD alone", "exact vehicle"]


@pytest.fixture(scope="module")
def made(tmp_path_factory, cpfls):
    """A config, its trajectory, and a model of a flight along it."""
    folder = tmp_path_factory.mktemp("tracking")
    config, path, flight, model = (folder / name for name in ("study.yaml", "trajectory.h5", "flight.h5", "model.h5"))
    config.write_text(CONFIG + VEHICLE)
    for words in (
        ("trajectory", config, "-o", path),
        ("simulate", config, path, "-o", flight),
        ("identify", config, flight, "-o", model),
    ):
        result = cpfls(*words)
        assert result.exit_code == 0, result.stderr
    return config, path, model


@pytest.fixture
def control(made, cpfls, tmp_path):
    def call(*options, name="tracked.h5"):
        config, path, model = made
        result = cpfls("simulate", config, path, "--model", model, *options, "-o", tmp_path / name)
        assert result.exit_code == 0, result.stderr
        return tmp_path / name, result

    return call


def read(path, *names):
    with h5py.File(path) as file:
        return [file[name][()] for name in names]


def test_controllers_are_compared_and_the_flight_keeps_to_its_format(control, cpfls):
    path, result = control("--json")
    summary = json.loads(result.stdout)
    assert [one["name"] for one in summary["controllers"]] == CONTROLLERS
    by_name = {one["name"]: np.array(one["settled_rms_rad"]) for one in summary["controllers"]}
    np.testing.assert_allclose(by_name["model"], by_name["vehicle"], rtol=0.05)
    assert np.all(by_name["pd"][:2] > 2 * by_name["model"][:2])
    assert cpfls("check", path).exit_code == 0
    names, time, tracked = read(path, "tracking/controller", "time", "tracking/time")
    assert names.astype(str).tolist() == CONTROLLERS
    np.testing.assert_array_equal(time, tracked)
    with h5py.File(path) as file:
        assert b"mode: computed-torque" in file["config"][()]
        assert "position" not in file
        assert file["rotor_speed"].shape == (151, 4)


def test_errors_are_those_of_the_flight_that_is_written(control, made):
    path, _ = control()
    flown, error, rms = read(path, "attitude", "tracking/error", "tracking/rms")
    (planned,) = read(made[1], "attitude")
    np.testing.assert_allclose(error[0], planned - flown, atol=1e-12)
    np.testing.assert_allclose(error[:, 0], np.tile([0.1, -0.1, 0.1], (4, 1)), atol=1e-12)
    np.testing.assert_allclose(rms[0], np.sqrt(np.mean((planned - flown) ** 2, axis=0)))


def test_people_get_a_row_for_each_controller(control):
    _, result = control()
    lines = result.stdout.splitlines()
    assert "attitude only" in lines[0]
    assert [re.split("  +", line)[0] for line in lines[3:7]] == NAMED


def test_the_flight_trains_a_model_again(control, cpfls, made, tmp_path):
    path, _ = control()
    result = cpfls("identify", made[0], path, "-o", tmp_path / "again.h5", "--json")
    assert result.exit_code == 0, result.stderr
    with h5py.File(tmp_path / "again.h5") as file:
        np.testing.assert_allclose(file["baselines/rigid_body"], [0.6, 0.6, 1.2, 0, 0, 0], atol=1e-9)


def test_noise_of_the_log_is_recorded_and_torques_fit_each_other(control):
    exact, _ = control()
    noisy, _ = control("--set", "simulation.noise={torque: 0.01}", name="noisy.h5")
    (before,), (after, std) = read(exact, "torque"), read(noisy, "torque", "noise/std")
    np.testing.assert_allclose(np.std(after - before, axis=0), std[0], rtol=0.3)
    q, tau, body = read(noisy, "attitude", "torque", "body_torque")
    sine, cosine = np.sin(q), np.cos(q)
    np.testing.assert_allclose(tau[:, 0], body[:, 0], atol=1e-12)
    np.testing.assert_allclose(tau[:, 1], cosine[:, 0] * body[:, 1] - sine[:, 0] * body[:, 2], atol=1e-12)


def test_same_seed_same_bytes(control):
    noise = ("--set", "simulation.computed_torque.attitude_noise_rad=0.001")
    one, two, other = (control(*noise, *seed, name=f"{n}.h5")[0] for n, seed in enumerate([(), (), ("--seed", 6)]))
    assert one.read_bytes() == two.read_bytes()
    assert np.abs(read(one, "attitude")[0] - read(other, "attitude")[0]).max() > 1e-6


def test_the_model_itself_can_be_controlled(control):
    path, _ = control("--set", "simulation.computed_torque.plant=model", "--set", "trajectory.legs=1")
    other, _ = control(name="vehicle.h5")
    np.testing.assert_allclose(read(path, "attitude")[0], read(other, "attitude")[0], atol=1e-4)


def test_a_loss_is_a_result(control, cpfls):
    """At 50 commands in a second feedback of 30 Hz throws the vehicle about."""
    path, result = control("--set", "simulation.computed_torque.natural_frequency_hz=[30, 30, 30]")
    lost, error = read(path, "tracking/lost_at", "tracking/error")
    (time,) = read(path, "time")
    assert np.isfinite(lost).all()
    assert result.stdout.count("lost at ") == len(CONTROLLERS)
    assert "where the controller with the model lost the vehicle" in result.stderr
    assert np.isfinite(error[0, : len(time)]).all()
    assert np.isnan(error[0, len(time) :]).all()
    assert cpfls("check", path).exit_code == 0


def test_torques_beyond_the_rotors_leave_their_speeds_out(control):
    path, result = control("--set", "simulation.computed_torque.initial_error_rad=[0.5, 0.5, 0.8]")
    with h5py.File(path) as file:
        assert "rotor_speed" not in file
        assert file["tracking/outside"][()].sum() > 0
    assert "rotor_speed is left out" in result.stderr
    assert "outside the attitudes that training visited" in result.stderr


def test_an_unfinished_search_is_said(control, made):
    with edited(made[2]) as file:
        file["search/complete"][()] = 0
    try:
        _, result = control()
    finally:
        with edited(made[2]) as file:
            file["search/complete"][()] = 1
    assert "is incomplete: its search was stopped" in result.stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--set", "vehicle.mass_kg=7"], "was made with another vehicle; these differ: vehicle.mass_kg"),
        (["--mode", "inverse"], "no model is flown in mode inverse; leave the mode out"),
        (["--effect", "rotor_drag=0.001"], "effects are flown in closed loop only; add --mode closed-loop"),
        (["--set", "simulation.noise={position: 0.1}"], "position: a vehicle with only attitude control"),
        (
            ["--set", "simulation.computed_torque.control_rate_hz=40"],
            "simulation.computed_torque.control_rate_hz = 40.0: lower than the 50 samples in a second",
        ),
        (
            ["--set", "simulation.computed_torque.initial_error_rad=[2, 0, 0]"],
            "simulation.computed_torque.initial_error_rad = [2.0, 0.0, 0.0]: a vehicle that is off by 90 degrees",
        ),
        (["--set", "simulation.computed_torque.damping=0"], "simulation.computed_torque.damping = 0: must be"),
        (["--set", "simulation.computed_torque.plant=rigid"], "must be 'vehicle' or 'model'"),
    ],
)
@pytest.mark.parametrize("dry", [[], ["--dry-run"]])
def test_what_cannot_be_controlled_is_refused(made, refuse, tmp_path, options, message, dry):
    config, path, model = made
    (line,) = refuse("simulate", config, path, "--model", model, *options, *dry, "-o", tmp_path / "x.h5")
    assert message in line


def test_computed_torque_without_a_model_is_refused(made, refuse, tmp_path):
    (line,) = refuse("simulate", *made[:2], "--mode", "computed-torque", "-o", tmp_path / "x.h5")
    assert line == "simulation.mode = computed-torque: controls the attitude with a model; add --model MODEL"


def test_a_file_that_is_no_model_is_refused(made, refuse, tmp_path):
    (line,) = refuse("simulate", *made[:2], "--model", made[1], "-o", tmp_path / "x.h5")
    assert "is a cpfls/trajectory; this command needs a cpfls/model" in line


def test_full_rotations_are_refused_with_the_time_and_a_remedy(made, refuse, cpfls, tmp_path):
    config, _, model = made
    path = tmp_path / "turning.h5"
    turning = "trajectory={path: full-rotation, duration_s: 8.0, sample_time_s: 0.02, infeasible: report}"
    assert cpfls("trajectory", config, "--set", turning, "-o", path).exit_code == 0
    (line,) = refuse("simulate", config, path, "--model", model, "-o", tmp_path / "x.h5", code=1)
    assert line.startswith(f"{path}: the planned pitch comes within 5.7 degrees of the vertical at t = ")
    assert "cube-diagonal" in line


def test_closed_loop_still_flies_the_model(made, cpfls, tmp_path):
    config, path, model = made
    words = ("--model", model, "--mode", "closed-loop", "-o", tmp_path / "flown.h5")
    result = cpfls("simulate", config, path, *words)
    assert result.exit_code == 0, result.stderr
    assert "off the path by" in result.stdout
