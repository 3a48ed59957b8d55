"""Resets of the estimated yaw, which PX4 states and ArduPilot marks: undone as a log is read."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cpfls_cli.flightlog.topics import STAMP, YAW_RESETS
from cpfls_cli.logs.formats import log_contents
from cpfls_cli.logs.records import stamps_while
from tests.builders import ulogs
from tests.builders.dataflash_logs import dataflash

NAME = "log.bin"
TIME = np.arange(0.0, 60.0, 0.1)
RESETS = np.array([[12.0, 23.0], [30.0, -8.0], [55.0, 120.0]])
"""When, s, and by how much, deg: two in flight, which is from 10 s to 50 s and longest after the second, one after."""


def angles(time):
    """Roll, pitch and yaw, rad, of a vehicle that turns several times a minute."""
    yaw = 0.5 * time + np.sin(0.9 * time)
    return np.column_stack([0.2 * np.sin(0.7 * time), 0.3 * np.sin(0.5 * time + 1), yaw])


def off(time, resets=RESETS):
    """By how much, rad, an estimate is off that is right between the second reset and the third."""
    turns = np.radians(resets[:, 1])
    return (time[:, None] >= resets[:, 0]) @ turns - turns[:2].sum()


def apart(one, other):
    return np.degrees((one.inv() * other).magnitude().max())


def of_px4(path, counts=(1, 1, 1), asked="float[4] q_d"):
    """Write what PX4 logs: the stated quaternion is that of the turn, or its negative, which is the same one."""
    true = Rotation.from_euler("ZYX", angles(TIME)[:, ::-1])
    logged = (Rotation.from_rotvec(off(TIME)[:, None] * [0, 0, 1]) * true).as_quat()[:, [3, 0, 1, 2]]
    counted, stated = np.full(len(TIME), 250.0), np.zeros((len(TIME), 2))
    for (at, turn), count, sign in zip(RESETS, counts, (1, -1, 1), strict=True):
        half = np.radians(turn) / 2
        counted[at <= TIME] += count
        stated[at <= TIME] = np.array([np.cos(half), np.sin(half)]) * sign
    fields = {
        "vehicle_attitude": "uint64_t timestamp;float[4] q;float quat_reset_counter;float[4] delta_q_reset",
        "vehicle_attitude_setpoint": f"uint64_t timestamp;{asked};float yaw_body",
        "vehicle_land_detected": "uint64_t timestamp;float landed",
    }
    sent = []
    for row, at in enumerate(TIME):
        stamp = round(1e6 * at)
        sent.append((stamp, 0, [*logged[row], counted[row] % 256, stated[row, 0], 0.0, 0.0, stated[row, 1]]))
        sent.append((stamp, 1, [*logged[row], angles(at)[0, 2] + off(TIME[row : row + 1])[0]]))
        sent.append((stamp, 2, [not 10.0 <= at < 50.0]))
    path.write_bytes(ulogs.ulog(sent, fields, {"sys_name": "PX4"}))
    return true


def test_px4_s_resets_are_undone_into_the_axes_of_the_flight(tmp_path):
    true = of_px4(tmp_path / "log.ulg")
    topics = log_contents(tmp_path / "log.ulg").topics
    held = topics["vehicle_attitude"]
    read = Rotation.from_quat(np.column_stack([held[f"q[{each}]"] for each in (1, 2, 3, 0)]))
    assert apart(read, true) < 1e-3
    asked = topics["vehicle_attitude_setpoint"]
    assert apart(Rotation.from_quat(np.column_stack([asked[f"q_d[{each}]"] for each in (1, 2, 3, 0)])), true) < 1e-3
    assert np.abs(np.sin(asked["yaw_body"] - angles(TIME)[:, 2])).max() < 1e-4
    np.testing.assert_allclose(topics[YAW_RESETS][STAMP], RESETS[:, 0], atol=1e-9)
    np.testing.assert_allclose(np.degrees(topics[YAW_RESETS]["turn"]), RESETS[:, 1], atol=1e-3)


def test_of_two_resets_between_two_rows_neither_is_known(tmp_path):
    of_px4(tmp_path / "log.ulg", counts=(2, 1, 1))
    topics = log_contents(tmp_path / "log.ulg").topics
    np.testing.assert_allclose(topics[YAW_RESETS][STAMP], RESETS[1:, 0], atol=1e-9)


def test_px4_s_yaw_asked_for_is_turned_where_no_quaternion_is(tmp_path):
    of_px4(tmp_path / "log.ulg", asked="float[4] roll_pitch")
    asked = log_contents(tmp_path / "log.ulg").topics["vehicle_attitude_setpoint"]
    assert np.abs(np.sin(asked["yaw_body"] - angles(TIME)[:, 2])).max() < 1e-4


def of_ardupilot(events, turns=RESETS, noise_rad_s=0.0):
    """Write what ArduCopter logs: an attitude in hundredths of a degree, a gyroscope faster, and events."""
    fast = np.arange(0.0, 60.0, 0.04)
    true = angles(fast)
    (roll, pitch, _), (d_roll, d_pitch, d_yaw) = true.T, np.gradient(true, fast, axis=0).T
    rate = np.column_stack(
        [
            d_roll - np.sin(pitch) * d_yaw,
            np.cos(roll) * d_pitch + np.sin(roll) * np.cos(pitch) * d_yaw,
            np.cos(roll) * np.cos(pitch) * d_yaw - np.sin(roll) * d_pitch,
        ]
    )
    rate += noise_rad_s * np.random.default_rng(1).standard_normal(rate.shape)
    kinds = {
        "ATT": ("Qcccc", "TimeUS,Roll,Pitch,Yaw,DesYaw"),
        "IMU": ("Qfff", "TimeUS,GyrX,GyrY,GyrZ"),
        "EV": ("QB", "TimeUS,Id"),
    }
    logged = angles(TIME) + np.column_stack([0 * TIME, 0 * TIME, off(TIME, turns) if len(turns) else 0 * TIME])
    hundredths = np.round(100 * ((np.degrees(logged) + 180) % 360 - 180)).astype(int)
    rows = [(at, "ATT", (round(1e6 * at), *own, own[2])) for at, own in zip(TIME, hundredths.tolist(), strict=True)]
    rows += [(at, "IMU", (round(1e6 * at), *own)) for at, own in zip(fast, rate.tolist(), strict=True)]
    rows += [(at, "EV", (round(1e6 * at), number)) for at, number in events]
    return dataflash(kinds, [own[1:] for own in sorted(rows, key=lambda own: own[0])])


FLIES = [(9.9, 10), (10.0, 28), (50.0, 18), (50.5, 11)]


@pytest.mark.parametrize("noise_rad_s", [0.0, 0.05])
def test_ardupilot_s_resets_are_measured_and_undone(read, noise_rad_s):
    marked = [(at - 0.03, 62) for at, _ in RESETS]
    topics = read(of_ardupilot([*FLIES, *marked], noise_rad_s=noise_rad_s)).topics
    for name in ("Yaw", "DesYaw"):
        beyond = np.radians(topics["ATT"][name]) - angles(TIME)[:, 2]
        # What it turns by between two rows is known to a degree or so, as their stamps and the gyroscope's are.
        assert np.degrees(np.abs(np.angle(np.exp(1j * beyond)))).max() < 1.5
        assert topics["ATT"][name].min() >= 0.0
    np.testing.assert_allclose(np.degrees(topics[YAW_RESETS]["turn"]), RESETS[:, 1], atol=1.0)


@pytest.mark.parametrize(("first", "second"), [(20.0, 12.0), (12.0, 20.0), (-20.0, 20.0)])
def test_of_ardupilot_s_resets_near_each_other_each_is_undone(read, first, second):
    resets = np.array([[20.0, first], [20.3, second]])
    topics = read(of_ardupilot([*FLIES, *((at, 62) for at, _ in resets)], resets)).topics
    np.testing.assert_allclose(topics[YAW_RESETS][STAMP], resets[:, 0], atol=1e-9)
    np.testing.assert_allclose(np.degrees(topics[YAW_RESETS]["turn"]), resets[:, 1], atol=1.0)


def test_an_event_of_ardupilot_is_of_one_turn(read):
    topics = read(of_ardupilot([*FLIES, (20.1, 62)], np.array([[20.0, 20.0], [20.3, 12.0]]))).topics
    assert topics[YAW_RESETS][STAMP] == pytest.approx([20.0])


def test_ardupilot_s_reset_that_is_as_small_as_what_vibration_makes_is_none(read):
    marked = [(at, 62) for at in np.arange(12.0, 48.0, 3.0)]
    assert YAW_RESETS not in read(of_ardupilot([*FLIES, *marked], (), noise_rad_s=1.0)).topics


def test_what_ardupilot_does_not_call_a_reset_is_none(read):
    for events, turns in ((FLIES, RESETS), ([*FLIES, (20.0, 62)], ())):
        topics = read(of_ardupilot(events, turns)).topics
        assert YAW_RESETS not in topics
        jumps = [abs((b - a + 180) % 360 - 180) for a, b in pairwise(topics["ATT"]["Yaw"])]
        assert (max(jumps) > 100.0) == bool(len(turns))


def test_a_log_that_never_flies_has_the_axes_of_most_of_it():
    stamps, changes = np.arange(5.0), np.array([1.0, 3.0])
    assert stamps_while(stamps, changes, np.array([True, False])).tolist() == [1.0, 2.0]
    assert stamps_while(stamps, changes, np.array([False, False])).tolist() == stamps.tolist()
