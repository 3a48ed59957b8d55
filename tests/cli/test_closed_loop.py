"""`cpfls simulate --mode closed-loop`: what it writes and says, and which effects it refuses."""

import json

import h5py
import numpy as np
import pytest

from cpfls_cli.rotations import rotation_matrix
from tests.builders.studies import VEHICLE

SHORT = """\
seed: 5
trajectory: {legs: 1, displacement_m: 1.0, period_s: 0.18, duration_s: 3.0, yaw_turn_rad: 0.3}
simulation:
  closed_loop: {integration_rate_hz: 200.0}
  noise: {body_rate: 0.002, rotor_speed: 0.5, rotor_command: 0.5}
identification:
  base: rigid-body
  population: 10
  generations: 1
  local_search: {enabled: false}
  validation: {draws: 20, windows: 20, horizon_samples: 6}
"""


MOVED = ("position", "velocity", "acceleration", "attitude")


@pytest.fixture(scope="module")
def short(tmp_path_factory, cpfls):
    folder = tmp_path_factory.mktemp("closed_loop")
    config, path = folder / "short.yaml", folder / "trajectory.h5"
    config.write_text(SHORT.replace("simulation:", "simulation:\n  mode: closed-loop") + VEHICLE)
    cpfls.done("trajectory", config, "-o", path)
    return config, path


@pytest.fixture
def fly(short, cpfls, tmp_path):
    def call(*options, name="flight.h5"):
        result = cpfls.done("simulate", *short, *options, "-o", tmp_path / name)
        return tmp_path / name, result.stdout

    return call


def read(path, *names):
    with h5py.File(path) as file:
        return [file[name][()] for name in names]


def test_flight_is_logged_and_keeps_to_its_format(fly, cpfls):
    path, said = fly()
    assert "off the path by" in said
    assert "effects: none\nnext:\n" in said
    cpfls.done("check", path)
    speed, command, rate, torque = read(path, "rotor_speed", "rotor_command", "body_rate", "torque")
    assert speed.shape == command.shape == (301, 4)
    assert rate.shape == torque.shape == (301, 3)
    with h5py.File(path) as file:
        assert file["effects"].attrs["rows"] == 0
        assert "voltage" not in file


def test_a_flight_says_what_its_autopilot_followed(fly, short):
    path, said = fly("--effect", "wind=1e-4,2,0")
    assert "Setpoints position, velocity, attitude" in " ".join(said.split())
    plan = dict(zip(MOVED, read(short[1], *MOVED), strict=True))
    flown = dict(zip(MOVED[:2], read(path, *MOVED[:2]), strict=True))
    position, velocity, attitude = read(path, "setpoint_position", "setpoint_velocity", "setpoint_attitude")
    np.testing.assert_array_equal(position, plan["position"])
    np.testing.assert_array_equal(velocity, plan["velocity"])
    # The thrust is to carry the vehicle and to take it back to its path: 0.25 Hz and a damping of 0.9.
    stiff = 2 * np.pi * 0.25
    pull = plan["acceleration"] + stiff**2 * (position - flown["position"])
    pull += 1.8 * stiff * (velocity - flown["velocity"]) + [0, 0, 9.81]
    up = rotation_matrix(attitude)[:, :, 2]
    np.testing.assert_allclose(up, pull / np.linalg.norm(pull, axis=1, keepdims=True), atol=1e-9)
    np.testing.assert_allclose(attitude[:, 2], plan["attitude"][:, 2], atol=1e-6)


def test_effects_are_recorded_with_their_values(fly):
    path, said = fly("--effect", "com_offset=0.01,-0.02", "--effect", "torque_bias.M_z=0.05", "--json")
    names, values = read(path, "effects/name", "effects/value")
    expected = {"com_offset.c_x": 0.01, "com_offset.c_y": -0.02, "com_offset.c_z": 0.0}
    expected |= {"torque_bias.M_x": 0.0, "torque_bias.M_y": 0.0, "torque_bias.M_z": 0.05}
    assert dict(zip(names.astype(str), values, strict=True)) == expected
    assert json.loads(said)["effects"] == expected


def test_effect_without_values_is_named_alone(fly):
    path, _ = fly("--effect", "euler_axis_torque")
    assert [name.decode() for name in read(path, "effects/name")[0]] == ["euler_axis_torque"]


def test_hidden_rotor_speeds_stay_hidden(fly):
    path, _ = fly("--effect", "motor_lag=0.04", "--effect", "battery_sag.exponent=1")
    with h5py.File(path) as file:
        assert "rotor_speed" not in file
        assert {"rotor_command", "voltage"} <= set(file)


def test_effects_of_the_config_do_the_same_as_those_of_the_command_line(fly):
    first, _ = fly("--effect", "rotor_drag=0.0013", name="first.h5")
    second, _ = fly("--set", "simulation.closed_loop.effects={rotor_drag: {k_d: 0.0013}}", name="second.h5")
    for name in ("attitude", "rotor_speed", "body_rate"):
        np.testing.assert_array_equal(*(read(path, name)[0] for path in (first, second)))


def test_same_seed_same_bytes(fly):
    first, second, other = (fly(*words, name=f"{n}.h5")[0] for n, words in enumerate([(), (), ("--seed", 6)]))
    assert first.read_bytes() == second.read_bytes()
    assert np.abs(read(first, "body_rate")[0] - read(other, "body_rate")[0]).max() > 1e-3


def test_mode_of_the_command_line_goes_before_that_of_the_config(fly, short, cpfls, tmp_path):
    path, said = fly("--mode", "inverse", "--set", "simulation.noise={}")
    assert "off the path" not in said
    with h5py.File(path) as file:
        assert "rotor_command" not in file
    plain = tmp_path / "plain.yaml"
    plain.write_text("seed: 5\nsimulation: {closed_loop: {integration_rate_hz: 200.0}}\n" + VEHICLE)
    closed = cpfls("simulate", plain, short[1], "--mode", "closed-loop", "-o", tmp_path / "closed.h5")
    assert "off the path" in closed.stdout


def test_a_flight_in_closed_loop_can_be_identified(fly, short, cpfls, tmp_path):
    path, _ = fly()
    cpfls.done("identify", short[0], path, "-o", tmp_path / "model.h5")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["rotr_drag=1"], "rotr_drag: no such effect (did you mean rotor_drag"),
        (["rotor_drag=much"], "much is not a number; write NAME=VALUE"),
        (["rotor_drag=9"], "k_d = 9 is not possible on this vehicle: 0 to"),
        (["com_offset=0.01"], "takes 2 values: c_x (m), c_y (m); by name also c_z (m); 1 given"),
        (["com_offset.c_w=0.01"], "has no c_w; takes 2 values: c_x (m), c_y (m); by name also c_z (m)"),
        (["com_offset=0.01,0", "com_offset.c_x=0.01"], "com_offset is given twice"),
        (["com_offset.c_x=0.01,0"], "a coefficient takes one value"),
        (["ground_effect=4"], "needs vehicle.rotors.radius_m"),
    ],
)
@pytest.mark.parametrize("dry", [[], ["--dry-run"]])
def test_impossible_effects_are_refused(short, refuse, tmp_path, options, message, dry):
    words = [word for option in options for word in ("--effect", option)]
    (line,) = refuse("simulate", *short, *words, *dry, "-o", tmp_path / "flight.h5")
    assert message in line


def test_effects_without_closed_loop_are_refused(short, refuse, tmp_path):
    plain = tmp_path / "plain.yaml"
    plain.write_text("seed: 5\nsimulation: {closed_loop: {integration_rate_hz: 200.0}}\n" + VEHICLE)
    (line,) = refuse("simulate", plain, short[1], "--effect", "rotor_drag=0.001", "-o", tmp_path / "flight.h5")
    assert "effects are flown in closed loop only; add --mode closed-loop" in line


def test_unknown_mode_is_refused(short, refuse, tmp_path):
    (line,) = refuse("simulate", *short, "--mode", "open", "-o", tmp_path / "flight.h5")
    assert "'inverse' or 'closed-loop'" in line


def test_control_by_a_model_is_refused_with_what_to_use_instead(short, refuse, tmp_path):
    (line,) = refuse("simulate", *short, "--mode", "computed-torque", "-o", tmp_path / "flight.h5")
    assert "is no longer a mode: leave it out; a model is flown by `simulate --model` in closed loop" in line


def test_lost_flight_is_refused_with_a_remedy(short, refuse, tmp_path):
    words = ("--effect", "parameter_error.thrust_scale=-0.8", "--set", "simulation.closed_loop.deviation_max_m=5")
    (line,) = refuse("simulate", *short, *words, "-o", tmp_path / "flight.h5", code=1)
    assert "away from the path" in line
    assert "fly more gently" in line
