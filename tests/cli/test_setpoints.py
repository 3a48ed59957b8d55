"""What was asked of an autopilot, from the log to the flight, its page and its playback."""

import h5py
import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from cpfls_cli.config.load import load_study
from cpfls_cli.flights.playback import flights_to_play
from cpfls_cli.flights.recordings import read_flights
from tests.builders.studies import VEHICLE
from tests.builders.unknown_logs import FLIP, NED, flight, quaternion, ulog_of_flight

CONFIG = """\
import:
  time_column: t
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
    rows = np.column_stack(list(columns.values()))
    np.savetxt(log, rows, delimiter=",", header=",".join(columns), comments="")
    return config, log, columns


def test_setpoints_go_into_the_flight_and_are_said(cpfls, flown, tmp_path):
    config, log, columns = flown
    flight = tmp_path / "flight.h5"
    result = cpfls.done("import", config, log, "-o", flight)
    words = " ".join(result.stdout.split())
    assert "Setpoints attitude, thrust (at 160 of 300 samples)" in words
    with h5py.File(flight) as file:
        np.testing.assert_allclose(file["setpoint_attitude"][:, 1], columns["pitch_sp"], atol=1e-12)
        assert "setpoint_position" not in file
        assert np.isnan(file["setpoint_thrust"][:140]).all()
        assert len(file["time"]) == SAMPLES
    summary = cpfls.told("import", config, log, "-o", flight, "--force")
    assert summary["setpoints"] == {"attitude": 300, "thrust": 160}


@pytest.mark.parametrize("imported", [True, False])
def test_readers_of_flights_give_what_is_known_throughout(cpfls, flown, tmp_path, imported):
    config, log, columns = flown
    path = log
    if imported:
        path = tmp_path / "flight.h5"
        cpfls.done("import", config, log, "-o", path)
    study = load_study(config)
    (played,) = flights_to_play([path], study)
    recording = read_flights([path], study).recordings[0]
    for setpoints in (played.parts[0].setpoints, played.playback.setpoints, recording.signals.setpoints):
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
    signals = yaml.safe_load(config.read_text())["import"]["signals"]
    assert signals["setpoint_thrust"] == {
        "columns": ["vehicle_attitude_setpoint.thrust_body[2]"],
        "unit": "1",
        "sign": [-1],
        "required": False,
    }
    summary = cpfls.told("import", config, log, "-o", made)
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
