"""Bags of ROS 1, and of ROS 2 in both kinds of storage, whole and broken."""

import sqlite3

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.logs.formats import log_contents
from tests.builders.ros_bags import BEGIN_NS, STORE, imu, rates, write_bag

MILLISECOND = 10**6
LATE = 3 * MILLISECOND
KINDS = (".bag", ".db3", ".mcap")


def sent(count=20):
    messages = [("/note", BEGIN_NS, STORE.types["std_msgs/msg/String"]("hello"))]
    for number in range(count):
        now = BEGIN_NS + 10 * number * MILLISECOND
        messages.append(("/imu/data", now, imu(now - LATE, (number, 1.0, 2.0), (0.0, 0.0, 9.81))))
        # The autopilot counts from when it was switched on.
        messages.append(("/fmu/out/rates", now, rates(5_000_000 + 10_000 * number, (number, 0.5, 0.25))))
    return messages


@pytest.fixture(params=KINDS)
def bag(request, tmp_path):
    return write_bag(tmp_path / "bag", request.param, sent())


def test_messages_are_flattened_and_stamped_by_who_sent_them(bag):
    contents = log_contents(bag)
    inertial, turning = contents.topics["/imu/data"], contents.topics["/fmu/out/rates"]
    np.testing.assert_allclose(inertial["timestamp"], 0.01 * np.arange(20) - 0.003, atol=1e-9)
    np.testing.assert_allclose(inertial["timestamp_received"], 0.01 * np.arange(20), atol=1e-9)
    assert inertial["angular_velocity.x"].tolist() == list(range(20))
    assert inertial["linear_acceleration_covariance[8]"].tolist() == [0.0] * 20
    assert turning["xyz[1]"].tolist() == [0.5] * 20
    # On the recorder's clock, by the median.
    np.testing.assert_allclose(turning["timestamp"], 0.01 * np.arange(20), atol=1e-6)
    np.testing.assert_allclose(turning["timestamp_sample"], 0.01 * np.arange(20) - 0.001, atol=1e-6)
    (warning,) = contents.warnings
    assert warning.startswith(
        "these topics do not use the recorder's clock and are shifted by the median offset: /fmu/out/rates (+1.7e+09 s)"
    )
    assert contents.system == ("ROS 1" if bag.suffix == ".bag" else "ROS 2")


def slowed(pace, jump=0):
    """Write 10 s of recorder's time: a simulation's stamps from 0 on, one on the recorder's clock, one without any."""
    vector = STORE.types["geometry_msgs/msg/Vector3"]
    for number in range(1000):
        now = BEGIN_NS + 10 * number * MILLISECOND
        simulated = int((now - BEGIN_NS) * (pace(number) if callable(pace) else pace)) + jump * (number > 500)
        yield "/odometry", now, imu(simulated, (number, 0.0, 0.0), (0.0, 0.0, 9.81))
        yield "/wanted", now, imu(now, (number, 0.0, 0.0), (0.0, 0.0, 9.81))
        yield "/motors", now, vector(float(number), 0.0, 0.0)


def test_all_stamps_are_put_on_the_clock_of_a_simulation_that_runs_slower_than_the_recorder(tmp_path):
    contents = log_contents(write_bag(tmp_path / "bag", ".mcap", slowed(0.5)))
    for topic in ("/odometry", "/wanted", "/motors"):
        np.testing.assert_allclose(contents.topics[topic]["timestamp"], 0.005 * np.arange(1000), atol=1e-6)
    (warning,) = contents.warnings
    assert warning.startswith("all stamps are put on a clock at another pace")
    assert warning.endswith(": /odometry")


def test_a_simulation_may_change_its_pace(tmp_path):
    contents = log_contents(write_bag(tmp_path / "bag", ".mcap", slowed(lambda number: 0.4 + number / 5000)))
    own, motors = contents.topics["/odometry"], contents.topics["/motors"]
    np.testing.assert_allclose(motors["timestamp"], own["timestamp"], atol=1e-6)
    assert own["timestamp"][-1] == pytest.approx(0.6 * 9.99, rel=1e-3)


@pytest.mark.parametrize(("pace", "jump"), [(1.0, 0), (1.0, 5 * 10**9), (1.05, 0), (0.001, 0)])
def test_a_clock_that_keeps_pace_or_jumps_once_or_hardly_runs_is_shifted_by_the_median(tmp_path, pace, jump):
    contents = log_contents(write_bag(tmp_path / "bag", ".mcap", slowed(pace, jump)))
    np.testing.assert_allclose(contents.topics["/motors"]["timestamp"], 0.01 * np.arange(1000), atol=1e-6)
    (warning,) = contents.warnings
    assert "shifted by the median offset: /odometry" in warning


def test_standard_messages_have_the_units_of_the_standard(bag):
    units = log_contents(bag).units
    assert units["/imu/data.angular_velocity.z"] == "rad/s"
    assert units["/imu/data.linear_acceleration.x"] == "m/s^2"
    assert units["/imu/data.orientation.w"] == "1"
    assert not [name for name in units if "rates" in name or "covariance" in name]


def test_only_topics_that_are_wanted_are_read(bag):
    topics = log_contents(bag, ["/fmu/out/rates.xyz[0]"]).topics
    assert {name for name, own in topics.items() if len(own["timestamp"])} == {"/fmu/out/rates"}
    assert topics.keys() == {"/note", "/imu/data", "/fmu/out/rates"}


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_that_is_cut_off(tmp_path, kind):
    path = write_bag(tmp_path / "bag", kind, sent(400))
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(InputError, match=r"cannot be read as a bag of ROS: \w+"):
        log_contents(path)


def test_types_without_definition_are_named(tmp_path):
    path = write_bag(tmp_path / "bag", ".db3", sent())
    # As bags were before ROS 2 Iron.
    with sqlite3.connect(path) as database:
        database.execute("DROP TABLE message_definitions")
        database.execute("DROP TABLE schema")
    database.close()
    contents = log_contents(path)
    assert contents.topics.keys() == {"/imu/data", "/note"}
    (warning,) = contents.warnings
    assert warning == (
        "topics left out because the file has no matching definition of their messages: /fmu/out/rates"
        " (px4_msgs/msg/VehicleAngularVelocity)"
    )


def test_a_bag_without_messages(tmp_path):
    with pytest.raises(InputError, match=r"a bag of ROS without readable messages$"):
        log_contents(write_bag(tmp_path / "bag", ".mcap", []))


@pytest.mark.parametrize("change", [("float32[3] xyz", "float32[3) xyz"), ("float32[3] xyz", "float32[] xyz")])
def test_a_definition_that_does_not_fit_costs_its_topic_only(tmp_path, change):
    path = write_bag(tmp_path / "bag", ".db3", sent())
    with sqlite3.connect(path) as database:
        database.execute(
            "UPDATE message_definitions SET encoded_message_definition = replace(encoded_message_definition, ?, ?)",
            change,
        )
    database.close()
    contents = log_contents(path)
    assert contents.topics.keys() == {"/imu/data", "/note"}
    assert "no matching definition of their messages: /fmu/out/rates" in contents.warnings[0]


def test_constants_of_a_type_are_no_columns(tmp_path):
    status = STORE.types["sensor_msgs/msg/NavSatStatus"]
    path = write_bag(
        tmp_path / "bag", ".mcap", [("/gps", BEGIN_NS, status(1, 2)), ("/gps", BEGIN_NS + 1, status(0, 2))]
    )
    assert log_contents(path).topics["/gps"].keys() == {"status", "service", "timestamp", "timestamp_received"}
