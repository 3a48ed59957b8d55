"""Bags of ROS 1 and 2, with messages of the standard and one as PX4 sends it."""

import numpy as np
import pytest

pytest.importorskip("rosbags")

from rosbags import rosbag1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

BEGIN_NS = 1_700_000_000_000_000_000
RATES = "px4_msgs/msg/VehicleAngularVelocity"
STORE = get_typestore(Stores.ROS2_HUMBLE)
STORE.register(get_types_from_msg("uint64 timestamp\nuint64 timestamp_sample\nfloat32[3] xyz\n", RATES))


def imu(stamp_ns, rate, acceleration):
    types = STORE.types
    vector, time = types["geometry_msgs/msg/Vector3"], types["builtin_interfaces/msg/Time"]
    header = types["std_msgs/msg/Header"](time(stamp_ns // 10**9, stamp_ns % 10**9), "base_link")
    turn = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    return types["sensor_msgs/msg/Imu"](
        header, turn, np.zeros(9), vector(*rate), np.zeros(9), vector(*acceleration), np.zeros(9)
    )


def rates(stamp_us, xyz):
    return STORE.types[RATES](stamp_us, stamp_us - 1000, np.array(xyz, dtype=np.float32))


def write_bag(folder, kind, sent):
    """Write a bag of a kind, ``.bag`` of ROS 1, of topics, when received in ns, and messages; give its file."""
    if kind == ".bag":
        return _write_old_bag(folder, sent)
    plugin = {".db3": StoragePlugin.SQLITE3, ".mcap": StoragePlugin.MCAP}[kind]
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        connections = {}
        for topic, received, message in sent:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=STORE)
            writer.write(connections[topic], received, STORE.serialize_cdr(message, message.__msgtype__))
    return folder / f"{folder.name}{kind}"


def _write_old_bag(folder, sent):
    """Write a bag of ROS 1, whose headers count."""
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("uint64 timestamp\nuint64 timestamp_sample\nfloat32[3] xyz\n", RATES))
    folder.mkdir()
    path = folder / f"{folder.name}.bag"
    with rosbag1.Writer(path) as writer:
        connections = {}
        for topic, received, message in sent:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            if hasattr(message, "header"):
                header = store.types["std_msgs/msg/Header"](0, message.header.stamp, message.header.frame_id)
                message = store.types[kind](**(vars(message) | {"header": header}))
            writer.write(connections[topic], received, store.serialize_ros1(message, kind))
    return path
