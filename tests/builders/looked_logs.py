"""The made-up flight as each autopilot logs it, in topics; what acts on it by a formula of its own."""

import numpy as np
from scipy.spatial.transform import Rotation

from cpfls_cli.logs.formats import LogContents
from tests.builders.topic_logs import topic
from tests.builders.unknown_logs import FLIP, HUBS, NED, named, quaternion

FULL = 1000.0
"""Speed of a rotor at full command, rad/s."""

FACTORS = {"px4": (np.sqrt(0.5), 1.0), "ardupilot": (0.5, 0.5), "betaflight": (1.0, 1.0), "": (1.0, 1.0)}
"""Share of a rotor for a full command of roll or pitch, and of yaw, of an X."""
_XKF1 = ("PN", "PE", "PD", "VN", "VE", "VD")


def shares(own):
    """Commands of the rotors, thrust made straight, shape (time, rotor), in the order of `HUBS`."""
    return (own.speed / FULL) ** 2


def command(own, autopilot):
    """What acts about roll to the right, pitch up and yaw clockwise: differences of rotors, by hand."""
    right, left, rear, front = 0.0, 0.0, 0.0, 0.0
    clockwise, counter = 0.0, 0.0
    for (ahead, to_left, spin), share in zip(HUBS, shares(own).T, strict=True):
        left, right = (left + share, right) if to_left > 0 else (left, right + share)
        front, rear = (front + share, rear) if ahead > 0 else (front, rear + share)
        # What turns counter-clockwise turns the body clockwise.
        counter, clockwise = (counter + share, clockwise) if spin > 0 else (counter, clockwise + share)
    tilt, yaw = FACTORS[autopilot]
    return np.column_stack([(left - right) / 4 / tilt, (front - rear) / 4 / tilt, (counter - clockwise) / 4 / yaw])


def _world(own):
    return Rotation.from_matrix(NED @ own.rotation.as_matrix() @ FLIP)


def px4(own, *, motors=1, outputs=1, more=None):
    """Topics of PX4 with a sample at every so many; those of rotors or of the rate loop's output may be none."""
    topics = {
        "vehicle_attitude": topic(own, 2, named(quaternion(_world(own)), *(f"q[{k}]" for k in range(4)))),
        "vehicle_angular_velocity": topic(own, 1, named(own.rate @ FLIP, *(f"xyz[{k}]" for k in range(3)))),
        "sensor_combined": topic(
            own,
            1,
            named(own.rate @ FLIP, *(f"gyro_rad[{k}]" for k in range(3)))
            | named(own.specific_force @ FLIP, *(f"accelerometer_m_s2[{k}]" for k in range(3))),
        ),
        "vehicle_local_position": topic(
            own, 5, named(np.hstack([own.position @ NED.T, own.velocity @ NED.T]), "x", "y", "z", "vx", "vy", "vz")
        ),
        "battery_status": topic(own, 20, {"voltage_v": 16.0 - 0.01 * own.time, "current_a": 9.0 + 0 * own.time}),
    }
    if motors:
        topics["actuator_motors"] = topic(own, motors, named(shares(own), *(f"control[{k}]" for k in range(4))))
    if outputs:
        columns = named(command(own, "px4"), *(f"xyz[{k}]" for k in range(3)))
        topics["vehicle_torque_setpoint"] = topic(own, outputs, columns)
    parameters = {"MAV_TYPE": 2.0, "SYS_AUTOSTART": 4001.0, "CA_ROTOR_COUNT": 4.0, "MC_ROLLRATE_P": 0.2}
    for index, (x, y, spin) in enumerate(HUBS):
        hub = {"PX": 0.12 * x, "PY": -0.12 * y, "PZ": 0.0, "KM": 0.05 * spin}
        parameters |= {f"CA_ROTOR{index}_{name}": value for name, value in hub.items()}
    return LogContents({**topics, **(more or {})}, {}, parameters, "PX4 1.15.0")


def ardupilot(own, *, motors=1, more=None):
    angles = np.degrees(_world(own).as_euler("ZYX")[:, ::-1])
    topics = {
        "ATT": topic(own, 4, named(angles, "Roll", "Pitch", "Yaw")),
        "IMU": topic(
            own,
            1,
            named(own.rate @ FLIP, "GyrX", "GyrY", "GyrZ") | named(own.specific_force @ FLIP, "AccX", "AccY", "AccZ"),
        ),
        "XKF1": topic(own, 10, named(np.hstack([own.position @ NED.T, own.velocity @ NED.T]), *_XKF1)),
        "BAT": topic(own, 10, {"Volt": 16.0 - 0.01 * own.time, "Curr": 9.0 + 0 * own.time}),
    }
    if motors:
        pulses = 1000 + 1000 * shares(own)
        topics["RCOU"] = topic(own, motors, named(pulses, "C1", "C2", "C3", "C4"))
    parameters = {"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0, "MOT_PWM_MIN": 1000.0, "MOT_PWM_MAX": 2000.0}
    return LogContents({**topics, **(more or {})}, {}, parameters, "ArduCopter 4.5.7")


def betaflight(own, *, version="4.5.1", reversed_spins=False, more=None):
    """One clock; motors rear right, front right, rear left, front left."""
    acts = command(own, "betaflight") * [1, -1, -1]
    motors = shares(own)[:, [3, 0, 1, 2]]
    if reversed_spins:
        # The same torques by rotors that turn the other way.
        yaw = np.array([-1.0, 1.0, 1.0, -1.0])
        motors = motors - 2 * np.outer(motors @ yaw / 4, yaw)
    columns = {
        "time": own.time,
        **named(np.degrees(own.rate), *(f"gyroADC[{k}]" for k in range(3))),
        **named(own.specific_force / 9.80665, *(f"accSmooth[{k}]" for k in range(3))),
        **named(48 + 1999 * motors, *(f"motor[{k}]" for k in range(4))),
        **named(1000 * acts - 5.0, *(f"axisP[{k}]" for k in range(3))),
        **{f"axisI[{k}]": np.full(len(own.time), 5.0) for k in range(3)},
        "vbatLatest": 16.0 - 0.01 * own.time,
        "amperageLatest": 900.0 + 0 * own.time,
    }
    units = {f"gyroADC[{k}]": "deg/s" for k in range(3)} | {f"accSmooth[{k}]": "g" for k in range(3)}
    units |= {"time": "s", "vbatLatest": "V"} | {f"setpoint[{k}]": "deg/s" for k in range(3)}
    parameters = {"motorOutput": "48,2047", "rollPID": "45,80,30", "pitchPID": "47,84,34", "yawPID": "45,80,0"}
    return LogContents({"": {**columns, **(more or {})}}, units, parameters, f"Betaflight {version}")


def plain(own):
    """A flat log without a word on who wrote it."""
    columns = {
        "t": own.time,
        **named(quaternion(own.rotation), "qw", "qx", "qy", "qz"),
        **named(own.rate, "gyro_x", "gyro_y", "gyro_z"),
        **named(own.specific_force, "acc_x", "acc_y", "acc_z"),
        **named(own.position, "x", "y", "z"),
        **named(own.velocity, "vx", "vy", "vz"),
        **named(own.speed[:, [2, 0, 3, 1]] / FULL, *(f"motor_cmd_{k}" for k in range(1, 5))),
    }
    return LogContents({"": columns})


WRITERS = {"px4": px4, "ardupilot": ardupilot, "betaflight": betaflight, "": plain}
