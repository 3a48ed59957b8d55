"""Logs in ULog, and files that are none."""

import json
import struct
from pathlib import Path

import h5py
import numpy as np
import pytest

from cpfls_cli.rotations import rotation_matrix
from tests.builders import ulogs
from tests.builders.studies import VEHICLE, put_file
from tests.builders.ulogs import data, definitions, header, message

EXAMPLE = Path(__file__).parents[2] / "configs" / "px4.yaml"

CONFIG = """\
import:
  time_column: vehicle_angular_velocity.timestamp
  body_frame: FRD
  world_frame: NED
  signals:
    quaternion:
      columns: ["vehicle_attitude.q[0]", "vehicle_attitude.q[1]", "vehicle_attitude.q[2]", "vehicle_attitude.q[3]"]
      unit: "1"
    body_rate:
      columns: ["vehicle_angular_velocity.xyz[0]", "vehicle_angular_velocity.xyz[1]", "vehicle_angular_velocity.xyz[2]"]
      unit: rad/s
    body_torque:
      columns: ["vehicle_torque_setpoint.xyz[0]", "vehicle_torque_setpoint.xyz[1]", "vehicle_torque_setpoint.xyz[2]"]
      unit: N m
"""
ATTITUDE, RATE, TORQUE = "vehicle_attitude", "vehicle_angular_velocity", "vehicle_torque_setpoint"
FIELDS = {
    ATTITUDE: "uint64_t timestamp;float[4] q",
    RATE: "uint64_t timestamp;float[3] xyz",
    TORQUE: "uint64_t timestamp;float[3] xyz",
}
ROLL_RATE, YAW_RATE, NORTH = 0.0, 2.0, 0.3


def rows():
    """A turn about the vertical with a constant roll of 0, in NED and FRD: topic, stamp and values, in order."""
    sent = []
    for number, step_us in ((0, 10_000), (1, 4_000), (2, 8_000)):
        for stamp in range(500 * number, 2_000_000, step_us):
            time = 1e-6 * stamp
            yaw = NORTH + YAW_RATE * time
            # The estimator may give either sign.
            sign = -1.0 if (stamp // 50_000) % 2 else 1.0
            values = {
                0: sign * np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]),
                1: np.array([0.0, 0.0, YAW_RATE]),
                2: np.array([0.1 * time, 0.02, 0.01 * (stamp // 8_000)]),
            }[number]
            sent.append((stamp, number, values))
    return sorted(sent, key=lambda row: row[:2])


def ulog(sent=None, fields=FIELDS):
    return ulogs.ulog(rows() if sent is None else sent, fields)


@pytest.fixture
def config(tmp_path):
    return put_file(tmp_path / "study.yaml", CONFIG + VEHICLE)


@pytest.fixture
def write(tmp_path):
    def call(content):
        return put_file(tmp_path / "log.ulg", content)

    return call


@pytest.fixture
def flown(cpfls, config, write, tmp_path):
    def call(content, *words):
        flight = tmp_path / "flight.h5"
        result = cpfls.done("import", config, write(content), "-o", flight, "--json", "-v", *words)
        with h5py.File(flight) as file:
            signals = {name: file[name][()] for name in ("time", "attitude", "body_rate", "body_torque")}
        return json.loads(result.stdout), signals, result.stderr

    return call


def test_topics_of_three_rates_become_one_flight_in_the_frames_of_the_program(flown):
    summary, flight, _ = flown(ulog())
    assert summary["log_rate_hz"] == pytest.approx(250.0)
    assert summary["rate_hz"] == pytest.approx(250.0)
    time = flight["time"] + summary["span_s"][0] + 0.0005
    # Heading NORTH clockwise from north is a quarter turn less NORTH counter-clockwise from east; FRD's z is down.
    np.testing.assert_allclose(flight["attitude"][:, 2], np.pi / 2 - NORTH - YAW_RATE * time, atol=1e-4)
    np.testing.assert_allclose(flight["attitude"][:, :2], 0.0, atol=1e-6)
    np.testing.assert_allclose(flight["body_rate"], [0.0, 0.0, -YAW_RATE] * np.ones((len(time), 1)), atol=1e-6)
    held = np.floor((time - 0.001) / 0.008 + 1e-6)
    np.testing.assert_allclose(flight["body_torque"][:, 2], -0.01 * held, atol=1e-6)
    np.testing.assert_allclose(flight["body_torque"][:, 0], 0.1 * (0.001 + 0.008 * held), atol=1e-6)
    forward = rotation_matrix(flight["attitude"])[0, :, 0]
    heading = NORTH + YAW_RATE * time[0]
    np.testing.assert_allclose(forward, [np.sin(heading), np.cos(heading), 0.0], atol=1e-4)


def test_stamps_are_microseconds_whatever_the_config_says(flown):
    summary, _, _ = flown(ulog(), "--set", "import.time_unit=ms")
    assert summary["log_rate_hz"] == pytest.approx(250.0)


def test_dropouts_of_the_logger_are_warned_of(flown):
    sent = rows()
    cut = next(place for place, row in enumerate(sent) if row[0] > 1_000_000)
    begin, end = (b"".join(data(*row) for row in part) for part in (sent[:cut], sent[cut:]))
    dropouts = message("O", struct.pack("<H", 40)) + message("O", struct.pack("<H", 120))
    _, _, stderr = flown(header() + definitions(FIELDS) + begin + dropouts + end)
    assert "2 dropouts of the logger, 0.16 s in all, the longest 0.12 s at 1.000 s" in " ".join(stderr.split())


def test_an_end_that_is_cut_off_is_read_up_to_it(flown):
    summary, _, _ = flown(ulog()[:-9])
    assert 480 < summary["samples"] <= 500


def test_bytes_that_are_broken_are_warned_of(flown):
    content = bytearray(ulog())
    place = content.find(data(*rows()[300]))
    content[place + 3 : place + 5] = b"\xff\xff"
    _, _, stderr = flown(bytes(content))
    assert "the file is damaged in places" in " ".join(stderr.split())


def test_other_topics_are_not_in_the_way(flown):
    fields = FIELDS | {"battery_status": "uint64_t timestamp;float voltage_v;uint8_t[3] _padding0"}
    sent = sorted([*rows(), *((stamp, 3, [16.0]) for stamp in range(0, 2_000_000, 200_000))], key=lambda row: row[:2])
    assert flown(ulog(sent, fields))[0]["samples"] == flown(ulog(), "--force")[0]["samples"]


def test_a_topic_that_is_not_there_is_named_with_those_that_are(refuse, config, write, tmp_path):
    words = ("import", config, write(ulog()), "-o", tmp_path / "flight.h5")
    config.write_text(
        CONFIG.replace("vehicle_attitude.q[2]", "vehicle_atitude.q[2]").replace(".xyz[1]", ".rates[1]") + VEHICLE
    )
    lines = [line.replace(str(words[2]), "LOG") for line in refuse(*words)]
    assert lines[0].startswith(
        "LOG: import.signals.quaternion.columns: the log has no column 'vehicle_atitude.q[2]'"
        " (nearest: vehicle_attitude.q[2], "
    )
    assert "no column 'vehicle_angular_velocity.rates[1]' (nearest: vehicle_angular_velocity.xyz[1]" in lines[1]
    config.write_text(CONFIG.replace('"vehicle_torque_setpoint.xyz[0]"', '"?!"') + VEHICLE)
    topics = "vehicle_angular_velocity, vehicle_attitude, vehicle_torque_setpoint"
    assert [line.replace(str(words[2]), "LOG") for line in refuse(*words)] == [
        "LOG: import.signals.body_torque.columns: the log has no column '?!'",
        f"LOG: import.signals: the log has the topics {topics}; `cpfls init LOG` proposes the mapping",
    ]


def test_the_example_gives_torques_in_the_directions_of_px4(cpfls, write, tmp_path):
    """Roll to the right takes the left motors, nose up the front ones, nose to the right the counter-clockwise ones."""
    fields = {ATTITUDE: FIELDS[ATTITUDE], RATE: FIELDS[RATE], "actuator_motors": "uint64_t timestamp;float[12] control"}
    push = {"roll": (-1, 1, 1, -1), "pitch": (1, -1, 1, -1), "yaw": (1, 1, -1, -1)}
    moves = [0.6 + 0.1 * np.array(motors) for motors in push.values()]
    sent = [row for row in rows() if row[1] != 2]
    for stamp in range(200_000, 1_900_000, 4_000):
        control = np.full(12, np.nan)
        control[:4] = moves[min(2, (stamp - 200_000) // 600_000)]
        sent.append((stamp, 2, control))
    log, flight = write(ulog(sorted(sent, key=lambda row: row[:2]), fields)), tmp_path / "flight.h5"
    words = ["--set", "import.delay_s=0", "--set", "import.lowpass_hz=null"]
    cpfls.done("import", EXAMPLE, log, "-o", flight, *words)
    with h5py.File(flight) as file:
        torque = file["body_torque"][()]
        assert "position" not in file
    # In FLU, whose y and z are those of FRD turned round.
    for axis, (own, sign) in enumerate(zip([torque[50], torque[200], torque[350]], (1, -1, -1), strict=True)):
        assert sign * own[axis] > 0
        np.testing.assert_allclose(np.delete(own, axis), 0.0, atol=1e-9)


def of_version(version, removed=()):
    """A log with the topics of one version of PX4; the vehicle turns about the vertical, and its left motors push."""
    rate = {
        "1.9": ("vehicle_attitude", "uint64_t timestamp;float rollspeed;float pitchspeed;float yawspeed;float[4] q")
    }
    fields = {
        "vehicle_attitude": FIELDS[ATTITUDE],
        "sensor_combined": "uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2",
        "actuator_controls_0": "uint64_t timestamp;float[8] control",
        "actuator_outputs": "uint64_t timestamp;uint32_t noutputs;float[16] output",
    }
    fields |= {rate[version][0]: rate[version][1]} if version in rate else {RATE: FIELDS[RATE]}
    if version in ("1.13", "1.17"):
        fields |= {"actuator_motors": "uint64_t timestamp;float[12] control"}
    if version == "1.17":
        fields |= {"vehicle_acceleration": "uint64_t timestamp;float[3] xyz"}
        fields |= {
            "esc_status": "uint64_t timestamp;esc_report[4] esc",
            "battery_status": "uint64_t timestamp;float voltage_v",
        }
    fields = {name: own for name, own in fields.items() if name not in removed}
    turning, pulling = [0.0, 0.0, YAW_RATE], [0.0, 0.0, -9.81]
    sent = []
    for number, name in enumerate(fields):
        for stamp in range(1_000 * number, 2_000_000, 4_000 if name in ("sensor_combined", RATE) else 8_000):
            yaw = NORTH + YAW_RATE * 1e-6 * stamp
            attitude = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
            more = 0.1 if stamp > 1_000_000 else 0.0
            motors = [0.5, 0.5 + more, 0.5 + more, 0.5]
            values = {
                "vehicle_attitude": [*(turning if version == "1.9" else ()), *attitude],
                "sensor_combined": [*turning, *pulling],
                "actuator_controls_0": [more, *[0.0] * 7],
                "actuator_outputs": [0.0, *(1000 + 1000 * np.array(motors)), *[900] * 12],
                RATE: turning,
                "actuator_motors": [*motors, *[np.nan] * 8],
                "vehicle_acceleration": pulling,
                "esc_status": [*(9000 + 1000 * np.array(motors))],
                "battery_status": [16.0 - 1e-6 * stamp],
            }[name]
            sent.append((stamp, number, values))
    return ulogs.ulog(sorted(sent, key=lambda row: row[:2]), fields, nested={"esc_report": "float esc_rpm"})


VERSIONS = {
    "1.9": ("vehicle_attitude.rollspeed", "actuator_outputs.output[0]"),
    "1.10": (None, "actuator_outputs.output[0]"),
    "1.13": (None, None),
    "1.17": (None, None),
}


@pytest.mark.parametrize("version", VERSIONS)
def test_one_example_takes_logs_of_all_versions(cpfls, write, tmp_path, version):
    flight = tmp_path / "flight.h5"
    words = ["-v", "--set", "import.delay_s=0", "--set", "import.lowpass_hz=null"]
    result = cpfls.done("import", EXAMPLE, write(of_version(version)), "-o", flight, *words)
    answer = " ".join(result.stderr.split())
    for signal, column in zip(("body_rate", "rotor_command"), VERSIONS[version], strict=True):
        assert (f"{signal} is taken from {column}" in answer) == (column is not None)
    assert ("acceleration is taken from sensor_combined.accelerometer_m_s2[0]" in answer) == (version != "1.17")
    with h5py.File(flight) as file:
        np.testing.assert_allclose(file["body_rate"][()], [[0.0, 0.0, -YAW_RATE]] * len(file["time"]), atol=1e-6)
        np.testing.assert_allclose(file["rotor_command"][-20], [0.5, 0.6, 0.6, 0.5], atol=1e-6)
        # The left motors push more: a roll to the right.
        assert file["body_torque"][-20, 0] > 0.1
        assert ("rotor_speed" in file) == ("voltage" in file) == (version == "1.17")
        np.testing.assert_allclose(file["acceleration"][()], 0.0, atol=0.01)
        if version == "1.17":
            speed = (9000 + 1000 * np.array([0.5, 0.6, 0.6, 0.5])) * np.pi / 30
            np.testing.assert_allclose(file["rotor_speed"][-20], speed, rtol=1e-6)


def test_where_motors_are_not_logged_the_pulses_are_offered(refuse, write, tmp_path):
    study = tmp_path / "study.yaml"
    text = EXAMPLE.read_text()
    begin, end = text.index("      # Up to 1.12"), text.index("    # Speeds that")
    study.write_text(text[:begin] + text[end:])
    lines = refuse("import", study, write(of_version("1.10")), "-o", tmp_path / "flight.h5")
    assert [line.partition(": import")[2] for line in lines] == [
        f".signals.rotor_command.columns: the log has no column 'actuator_motors.control[{motor}]'"
        f" (PX4 of this version has actuator_outputs.output[{motor}])"
        for motor in range(4)
    ]


def test_what_no_version_has_is_said_to_have_been_tried(refuse, write, tmp_path):
    log = write(of_version("1.10", removed=("actuator_outputs",)))
    lines = refuse("import", EXAMPLE, log, "-o", tmp_path / "flight.h5")
    begin = ".signals.rotor_command.columns: the log has no column 'actuator_motors.control[0]', nor all columns of any"
    assert lines[0].partition(": import")[2].startswith(f"{begin} entry of otherwise (")
