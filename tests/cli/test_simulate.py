"""`cpfls simulate` in closed loop, and what was asked of an autopilot, from the log to the playback."""

import json
import re

import h5py
import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from cpfls_cli.config.load import load_study
from cpfls_cli.flights.playback import flights_to_play
from cpfls_cli.flights.recordings import read_flights
from cpfls_cli.rotations import rotation_matrix
from tests.builders.studies import VEHICLE
from tests.builders.unknown_logs import FLIP, NED, flight, quaternion, ulog_of_flight

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
        return tmp_path / name, cpfls.done("simulate", *short, *options, "-o", tmp_path / name).stdout

    return call


def read(path, *names):
    with h5py.File(path) as file:
        return [file[name][()] for name in names]


def test_flight_is_logged_and_keeps_to_its_format(fly, cpfls):
    path, said = fly()
    assert "off the path by" in said
    assert "effects: none\nnext:\n" in said
    assert "rotor_speed 0.5; rotor_command 0.5" in said
    assert "body_rate 0.002" in said
    cpfls.done("check", path)
    speed, command, rate, torque = read(path, "rotor_speed", "rotor_command", "body_rate", "torque")
    assert speed.shape == command.shape == (301, 4)
    assert rate.shape == torque.shape == (301, 3)
    with h5py.File(path) as file:
        assert file["effects"].attrs["rows"] == 0
        assert "voltage" not in file


def test_noise_that_differs_by_axis_is_listed_by_axis(fly):
    _, said = fly("--set", "simulation.relative_noise={position: 0.01}")
    by_axis = re.search(r"position ([\d.e-]+) ([\d.e-]+) ([\d.e-]+);", said)
    assert by_axis is not None
    assert len({*by_axis.groups()}) > 1


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


def test_effects_are_recorded_with_their_values(fly, cpfls):
    path, said = fly("--effect", "com_offset=0.01,-0.02", "--effect", "torque_bias.M_z=0.05", "--json")
    names, values = read(path, "effects/name", "effects/value")
    expected = {"com_offset.c_x": 0.01, "com_offset.c_y": -0.02, "com_offset.c_z": 0.0}
    expected |= {"torque_bias.M_x": 0.0, "torque_bias.M_y": 0.0, "torque_bias.M_z": 0.05}
    assert dict(zip(names.astype(str), values, strict=True)) == expected
    assert json.loads(said)["effects"] == expected
    shown = "effects: com_offset.c_x = 0.01, com_offset.c_y = -0.02, torque_bias.M_z = 0.05\n"
    assert shown in cpfls.done("info", path).stdout


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
        (["rotor_tilt=0.01"], "takes 5 to 9 values: twist_all (rad), twist_1 (rad), bend_1 (rad)"),
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


def test_a_vehicle_that_its_rotors_cannot_carry_is_refused_with_what_to_check(short, refuse, tmp_path):
    (line,) = refuse("simulate", *short, "--set", "vehicle.mass_kg=150", "-o", tmp_path / "flight.h5", code=1)
    assert "of the weight at most, so nothing can be flown: check mass_kg" in line


def test_an_inertia_that_no_body_has_is_said_with_its_key(short, cpfls, tmp_path):
    one = ("simulate", *short, "-o", tmp_path / "body.h5")
    assert "no body" not in cpfls.done(*one).stderr
    said = cpfls.done(*one, "--set", "vehicle.inertia_kg_m2=[0.6,0.6,1.6]", "--force").stderr
    assert "vehicle.inertia_kg_m2 = [0.6, 0.6, 1.6]: no body has this inertia" in said
    assert "check the units and the order" in said


def test_a_loop_that_oscillates_at_its_limits_is_said_with_what_to_lower(short, cpfls, tmp_path):
    hover = tmp_path / "hover.h5"
    cpfls.done("trajectory", short[0], "--hover", "8", "--excite", "roll,pitch", "-o", hover)
    for size, oscillates in ((6.5, False), (20.0, True)):
        law = ("--autopilot", "px4", "--set", f"simulation.closed_loop.autopilot_parameters.MC_ROLL_P={size}")
        said = cpfls.done("simulate", short[0], hover, *law, "-o", tmp_path / f"{size:g}.h5").stderr
        assert ("roll oscillates at" in said) == oscillates
        assert ("autopilot_parameters: lower the gains of px4; `cpfls tune` finds some" in said) == oscillates
    assert "roll oscillates at" in cpfls("info", tmp_path / "20.h5").stderr


def test_lost_flight_is_refused_with_a_remedy(short, refuse, tmp_path):
    words = ("--effect", "parameter_error.thrust_scale=-0.8", "--set", "simulation.closed_loop.deviation_max_m=5")
    (line,) = refuse("simulate", *short, *words, "-o", tmp_path / "flight.h5", code=1)
    assert "away from the path" in line
    assert "fly more gently" in line


CONFIG = """\
import:
  torque_source: null
  signals:
    attitude: {columns: [roll, pitch, yaw], unit: rad}
    body_rate: {columns: [p, q, r], unit: rad/s}
    rotor_speed: {columns: [w1, w2, w3, w4], unit: rad/s}
    setpoint_attitude: {columns: [roll_sp, pitch_sp, yaw_sp], unit: rad, required: false}
    setpoint_thrust: {columns: [thrust_sp], unit: "1", required: false}
    setpoint_position: {columns: [x_sp, y_sp, z_sp], unit: m, required: false}
"""
SAMPLES = 300


@pytest.fixture
def flown(tmp_path):
    """A config and a log; the thrust is asked for in the second half alone, a position never."""
    config, log = tmp_path / "study.yaml", tmp_path / "log.csv"
    config.write_text(CONFIG + VEHICLE)
    time = 0.01 * np.arange(SAMPLES)
    angles = 0.2 * np.sin(np.outer(time, [3.0, 4.0, 2.0]))
    columns = {"t": time, "roll": angles[:, 0], "pitch": angles[:, 1], "yaw": angles[:, 2]}
    columns |= {name: np.gradient(own, time) for name, own in zip("pqr", angles.T, strict=True)}
    columns |= {f"w{rotor}": 340 + 5 * np.sin(rotor * time) for rotor in range(1, 5)}
    columns |= {f"{name}_sp": np.roll(columns[name], -5) for name in ("roll", "pitch", "yaw")}
    columns["thrust_sp"] = np.where(time < 1.5, np.nan, 0.4 + 0.1 * np.sin(time))
    np.savetxt(log, np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns), comments="")
    return config, log, columns


def test_setpoints_go_into_the_flight_and_are_said(cpfls, flown, tmp_path):
    config, log, columns = flown
    flight = tmp_path / "flight.h5"
    words = " ".join(cpfls.done("import", config, log, "-o", flight).stdout.split())
    assert "Setpoints attitude, thrust (at 160 of 300 samples)" in words
    with h5py.File(flight) as file:
        np.testing.assert_allclose(file["setpoint_attitude"][:, 1], columns["pitch_sp"], atol=1e-12)
        assert "setpoint_position" not in file
        assert np.isnan(file["setpoint_thrust"][:140]).all()
        assert len(file["time"]) == SAMPLES
    summary = cpfls.summary("import", config, log, "-o", flight, "--force")
    assert summary["setpoints"] == {"attitude": 300, "thrust": 160}


@pytest.mark.parametrize("imported", [True, False])
def test_readers_of_flights_give_what_is_known_throughout(cpfls, flown, tmp_path, imported):
    config, log, columns = flown
    path = log
    if imported:
        path = cpfls.made("import", config, log, at=tmp_path / "flight.h5")
    study = load_study(config)
    (played,) = flights_to_play([path], study)
    flight = read_flights([path], study).flights[0]
    for setpoints in (played.parts[0].setpoints, played.playback.setpoints, flight.setpoints):
        assert list(setpoints) == ["attitude"], "the thrust is not asked for throughout"
        np.testing.assert_allclose(setpoints["attitude"][:, 0], columns["roll_sp"], atol=1e-12)
    assert len(played.parts[0]) == SAMPLES


def test_a_flight_without_them_has_none(cpfls, flown, tmp_path):
    config, log, _ = flown
    flight = tmp_path / "flight.h5"
    without = [line for line in config.read_text().splitlines() if "setpoint_" not in line]
    config.write_text("\n".join(without))
    cpfls.done("import", config, log, "-o", flight)
    (played,) = flights_to_play([flight], load_study(config))
    assert played.playback.setpoints == {}


def ahead(values, samples=10):
    """What was asked for a tenth of a second before it was flown."""
    return np.vstack([values[samples:], np.repeat(values[-1:], samples, axis=0)])


def test_init_proposes_the_setpoints_of_px4_and_import_takes_them(cpfls, tmp_path):
    own = flight(seconds=20.0)
    wished = Rotation.from_matrix(NED @ own.rotation.as_matrix()[10:] @ FLIP)
    columns = ahead(own.position) @ NED.T
    attitude = np.vstack([quaternion(wished), np.repeat(quaternion(wished)[-1:], 10, axis=0)])
    thrust = np.column_stack([0 * own.time, 0 * own.time, -0.4 - 0.1 * np.sin(own.time)])
    asked = {
        "trajectory_setpoint": ("float[3] position", 20, columns),
        "vehicle_attitude_setpoint": ("float[4] q_d;float[3] thrust_body", 5, np.hstack([attitude, thrust])),
    }
    log, config, made = tmp_path / "log.ulg", tmp_path / "study.yaml", tmp_path / "flight.h5"
    log.write_bytes(ulog_of_flight(own, asked=asked))
    cpfls.done("init", log, "-o", config, "--mass", "0.8", "--arm", "0.16")
    assert "the attitude follows it" in " ".join(config.read_text().replace("#", "").split())
    assert yaml.safe_load(config.read_text())["import"]["signals"]["setpoint_thrust"] == {
        "columns": ["vehicle_attitude_setpoint.thrust_body[2]"],
        "unit": "1",
        "sign": [-1],
        "required": False,
    }
    summary = cpfls.summary("import", config, log, "-o", made)
    samples = summary["samples"]
    assert summary["setpoints"] == {"position": samples, "attitude": samples, "thrust": samples}
    with h5py.File(made) as file:
        first = round(100 * summary["span_s"][0])
        held = np.arange(first, first + samples) // 20 * 20
        np.testing.assert_allclose(file["setpoint_position"], ahead(own.position)[held], atol=1e-5)
        held = np.arange(first, first + samples) // 5 * 5
        turned = Rotation.from_euler("ZYX", file["setpoint_attitude"][()][:, ::-1])
        away = Rotation.from_euler("ZYX", ahead(own.angles)[held][:, ::-1]) * turned.inv()
        assert away.magnitude().max() < 1e-5
        np.testing.assert_allclose(file["setpoint_thrust"], -thrust[held, 2], atol=1e-6)
