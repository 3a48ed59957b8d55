"""Logs of PX4 before ULog: messages without stamps, behind one that holds the time."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.topics import STAMP
from tests.builders.dataflash_logs import definition, message

NAME = "log.px4log"
KINDS = {
    "TIME": ("Q", "StartTime"),
    "ATT": ("fffffff", "qw,qx,qy,qz,Roll,Pitch,Yaw"),
    "IMU": ("ffffff", "AccX,AccY,AccZ,GyroX,GyroY,GyroZ"),
    "OUT0": ("ffffffff", ",".join(f"Out{each}" for each in range(8))),
    "ATTC": ("ffff", "Roll,Pitch,Yaw,Thrust"),
    "STAT": ("BBB", "MainState,ArmS,Landed"),
    "GPS": ("QB", "GPSTime,Fix"),
    "PARM": ("Nf", "Name,Value"),
}
BEGIN = 7_000_000


def sdlog2(rows, kinds=KINDS):
    numbers = {name: 2 + place for place, name in enumerate(kinds)}
    parts = [definition(numbers[name], name, *own) for name, own in kinds.items()]
    return b"".join(parts + [message(numbers[name], kinds[name][0], values) for name, values in rows])


def flight(angles):
    """Write the attitude 50 times a second, quaternions left out as versions do, and outputs at every other time."""
    rows = [("PARM", (b"PWM_MIN", 1100.0)), ("ATTC", (9.0, 9.0, 9.0, 9.0))]
    for number, own in enumerate(angles.tolist()):
        rows += [("TIME", (BEGIN + 20_000 * number,)), ("ATT", (0.0, 0.0, 0.0, 0.0, *own))]
        rows += [("IMU", (*own, 1.0, 2.0, 3.0)), ("ATTC", (0.1, 0.2, 0.3, 0.01 * number))]
        if number % 2 == 0:
            rows += [("OUT0", [1100.0 + number + each for each in range(8)]), ("STAT", (2, 2, number < 4))]
        if number == 10:
            rows += [("GPS", (1_446_709_400_000_000, 3))]
    return rows


ANGLES = np.random.default_rng(0).uniform(-1.2, 1.2, (20, 3))


@pytest.mark.parametrize("name", ["log.px4log", "log001.bin", "log"])
def test_messages_have_the_time_before_them_and_the_names_of_ulog(read, name):
    contents = read(sdlog2(flight(ANGLES)), name)
    topics = contents.topics
    attitude, clock = topics["vehicle_attitude"], 0.02 * np.arange(20)
    np.testing.assert_allclose(attitude[STAMP], clock, atol=1e-9)
    turned = Rotation.from_quat(np.column_stack([attitude[f"q[{each}]"] for each in (1, 2, 3, 0)]))
    assert (turned.inv() * Rotation.from_euler("ZYX", ANGLES[:, ::-1])).magnitude().max() < 1e-6
    np.testing.assert_allclose(topics["sensor_combined"]["gyro_rad[2]"], 3.0)
    np.testing.assert_allclose(topics["sensor_combined"]["accelerometer_m_s2[1]"], ANGLES[:, 1], rtol=1e-6)
    np.testing.assert_allclose(topics["actuator_outputs"][STAMP], clock[::2], atol=1e-9)
    np.testing.assert_allclose(topics["actuator_outputs"]["output[3]"], 1103.0 + np.arange(0, 20, 2))
    # What came before the first time has none.
    np.testing.assert_allclose(topics["actuator_controls_0"]["control[3]"], 0.01 * np.arange(20), rtol=1e-5)
    assert topics["vehicle_land_detected"]["landed"].tolist() == [1, 1, *[0] * 8]
    assert topics["vehicle_status"].keys() == {STAMP, "nav_state", "arming_state"}
    assert (contents.system, contents.parameters) == ("PX4", {"PWM_MIN": 1100.0})
    assert contents.flown_at == pytest.approx(1_446_709_400 - 0.2)
    assert contents.begins == {"": 7.0}


def test_a_kind_that_is_described_again_and_never_written_changes_nothing(read):
    again = b"".join(definition(60 + place, name, *KINDS[name]) for place, name in enumerate(("ATT", "TIME")))
    assert len(read(sdlog2(flight(ANGLES)) + again).topics["vehicle_attitude"][STAMP]) == 20


def test_without_an_attitude_it_is_said_what_the_file_is(read):
    with pytest.raises(InputError, match=r"before ULog \(sdlog2\), without the attitude"):
        read(sdlog2([("TIME", (5,)), ("GPS", (5, 3))]))


@pytest.mark.parametrize(
    "kinds", [{"PARM": ("Nn", "Name,Value")}, {"IMU": ("nnnnnn", KINDS["IMU"][1])}, {"TIME": ("Q", "StartTime")}]
)
def test_what_a_damaged_log_describes_otherwise_is_left_out(read, kinds):
    rows = [(name, own) for name, own in flight(ANGLES) if name not in kinds or name == "TIME"]
    texts = {"PARM": (b"PWM_MIN", b"1100"), "IMU": [b"1"] * 6, "TIME": (BEGIN - 5,)}
    rows += [(name, texts[name]) for name in kinds]
    contents = read(sdlog2(rows, KINDS | kinds) + b"\xa3\x95\x07")
    assert len(contents.topics["vehicle_attitude"][STAMP]) == 20
    assert ("sensor_combined" in contents.topics) == ("IMU" not in kinds)
    assert ("PWM_MIN" in contents.parameters) == ("PARM" not in kinds)
