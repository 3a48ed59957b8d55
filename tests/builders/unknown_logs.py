"""A made-up flight of a small quadrotor, exactly consistent, and the ways in which logs write one down."""

from types import SimpleNamespace

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from cpfls_cli.logs.formats import LogContents
from tests.builders import ulogs

GRAVITY, MASS, INERTIA = 9.80665, 0.8, np.array([0.004, 0.0044, 0.0075])
ARM, THRUST_FACTOR, DRAG_FACTOR = 0.16, 6e-6, 1.4e-7
# Front right, rear left (counter-clockwise), front left, rear right: as PX4 numbers them.
HUBS = ((1, -1, 1), (-1, 1, 1), (1, 1, -1), (-1, -1, -1))
FLIP = np.diag([1.0, -1.0, -1.0])
NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def flight(seconds=30.0, rate_hz=100.0, seed=3, noise=1.0, push=0.0, angle=0.25, highest_hz=1.5, climb=0.6):
    """A flight in FLU and ENU with all that a log can hold, SI units; noise as multiples of a usual one.

    With `push`, m/s^2, it flies a circle that takes as much; it leans by `angle`, rad, and climbs with `climb`, m/s^2.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1 / rate_hz)

    def wave(size, lowest, highest):
        parts = zip(rng.uniform(lowest, highest, 6), rng.uniform(0, 2 * np.pi, 6), rng.uniform(0.3, 1, 6), strict=True)
        return size * sum(a * np.sin(2 * np.pi * f * time + p) for f, p, a in parts) / 2

    angles = np.column_stack(
        [wave(angle, 0.2, highest_hz), wave(angle, 0.2, highest_hz), wave(3.2 * angle, 0.05, 0.4 * highest_hz)]
    )
    rotation = Rotation.from_euler("ZYX", angles[:, ::-1])
    if push:
        # Leaning to the middle of a circle, heading ahead.
        turn = 1.5 * time
        lean = np.column_stack([turn, 0 * time, np.full_like(time, -np.arctan(push / GRAVITY))])
        rotation = Rotation.from_euler("ZYX", lean) * rotation
        angles = rotation.as_euler("ZYX")[:, ::-1]
    steps = CubicSpline(time, rotation.as_quat()).derivative()(time)
    rate = _product(2 * (Rotation.from_quat(rotation.as_quat()).inv().as_quat()), steps)
    up = rotation.as_matrix()[:, :, 2]
    lift = (GRAVITY + wave(climb, 0.2, 0.8 * highest_hz / 1.5)) / up[:, 2]
    acceleration = lift[:, None] * up - [0.0, 0.0, GRAVITY]
    acceleration -= acceleration.mean(axis=0)
    velocity = cumulative_trapezoid(acceleration, time, axis=0, initial=0)
    velocity -= velocity.mean(axis=0)
    position = cumulative_trapezoid(velocity, time, axis=0, initial=0)
    torque = INERTIA * CubicSpline(time, rate).derivative()(time) + np.cross(rate, INERTIA * rate)
    squared = np.column_stack([MASS * lift, torque]) @ np.linalg.inv(mixer()).T

    def noisy(values, size):
        return values + noise * size * rng.standard_normal(values.shape)

    return SimpleNamespace(
        time=time,
        rotation=rotation,
        angles=angles,
        rate=noisy(rate, 0.02),
        position=noisy(position, 0.002),
        velocity=noisy(velocity, 0.01),
        acceleration=noisy(acceleration, 0.1),
        specific_force=noisy(lift[:, None] * [0.0, 0.0, 1.0], 0.2),
        speed=noisy(np.sqrt(squared), 2.0),
    )


def mixer():
    hubs = np.array(HUBS, dtype=float)
    x, y = (hubs[:, axis] * ARM / np.sqrt(2) for axis in (0, 1))
    return np.array([THRUST_FACTOR * np.ones(4), THRUST_FACTOR * y, -THRUST_FACTOR * x, -DRAG_FACTOR * hubs[:, 2]])


def _product(first, second):
    """Vector part of the product of two quaternions x, y, z, w."""
    return first[:, 3:] * second[:, :3] + second[:, 3:] * first[:, :3] + np.cross(first[:, :3], second[:, :3])


def named(values, *names):
    """Columns by name."""
    return dict(zip(names, np.asarray(values).T, strict=True))


def quaternion(rotation, order="wxyz"):
    """Columns of a quaternion in an order."""
    scalar_last = rotation.as_quat()
    return np.roll(scalar_last, 1, axis=1) if order == "wxyz" else scalar_last


def flat_log(own, **changed):
    """A flat log with plain names; what is given replaces columns, None leaves them out."""
    columns = {
        "t": {"t": own.time},
        "attitude": named(own.angles, "roll", "pitch", "yaw"),
        "rate": named(own.rate, "gyro_x", "gyro_y", "gyro_z"),
        "force": named(own.specific_force, "acc_x", "acc_y", "acc_z"),
        "position": named(own.position, "x", "y", "z"),
        "velocity": named(own.velocity, "vx", "vy", "vz"),
        "speed": named(own.speed, "rpm1", "rpm2", "rpm3", "rpm4"),
        **changed,
    }
    speed = columns["speed"]
    if speed is not None and "rpm1" in speed and "speed" not in changed:
        columns["speed"] = {name: values * 60 / (2 * np.pi) for name, values in speed.items()}
    return LogContents({"": {name: v for part in columns.values() if part for name, v in part.items()}})


def write_csv(path, contents):
    """Write a flat log as CSV."""
    columns = contents.topics[""]
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    return path


def with_ground(own, before_s=5.0, after_s=4.0, idle=0.25):
    """The same flight with time on the ground: the rotors stand, then idle, then fly, then stand."""
    step = own.time[1] - own.time[0]
    before, after = (round(seconds / step) for seconds in (before_s, after_s))
    longer = SimpleNamespace(**vars(own))
    longer.time = np.arange(len(own.time) + before + after) * step
    for name in ("angles", "rate", "position", "velocity", "acceleration", "specific_force", "speed"):
        values = getattr(own, name)
        still = np.zeros_like(values[:1]) if name not in ("position", "angles", "specific_force") else values[:1]
        if name == "position":
            values = values + np.array([0.0, 0.0, 2.0])
        longer.__dict__[name] = np.vstack([np.repeat(still, before, 0), values, np.repeat(still, after, 0)])
    longer.speed[before // 2 : before] = idle * own.speed.mean()
    longer.rotation = Rotation.from_euler("ZYX", longer.angles[:, ::-1])
    return longer


def ulog_of_flight(own, without=None, asked=None, **parameters):
    """The flight as PX4 writes it: FRD in NED, topics at rates of their own, thrust linearised, parameters.

    `asked` has further topics: their fields, rows from one sample to the next, and their values.
    """
    turned = Rotation.from_matrix(NED @ own.rotation.as_matrix() @ FLIP)
    share = (own.speed / 1000.0) ** 2
    motors = np.hstack([share, np.full((len(share), 8), np.nan)])
    topics = {
        "vehicle_attitude": ("float[4] q", 2, quaternion(turned)),
        "vehicle_angular_velocity": ("float[3] xyz", 1, own.rate @ FLIP),
        "sensor_combined": (
            "float[3] gyro_rad;float[3] accelerometer_m_s2",
            1,
            np.hstack([own.rate @ FLIP, own.specific_force @ FLIP]),
        ),
        "vehicle_local_position": (
            "float x;float y;float z;float vx;float vy;float vz",
            5,
            np.hstack([own.position @ NED.T, own.velocity @ NED.T]),
        ),
        "actuator_motors": ("float[12] control", 1, motors),
    }
    topics |= asked or {}
    topics.pop(without, None)
    rows = [
        (round(1e6 * own.time[row]), number, values[row])
        for number, (_, every, values) in enumerate(topics.values())
        for row in range(0, len(own.time), every)
    ]
    facts = {"sys_name": "PX4", "MAV_TYPE": 2, "SYS_AUTOSTART": 4001, "THR_MDL_FAC": 1, "CA_ROTOR_COUNT": len(HUBS)}
    for index, (x, y, spin) in enumerate(HUBS):
        hub = {"PX": 0.11 * x, "PY": -0.12 * y, "PZ": 0.0, "KM": 0.05 * spin}
        facts |= {f"CA_ROTOR{index}_{name}": value for name, value in hub.items()}
    fields = {name: f"uint64_t timestamp;{own}" for name, (own, _, _) in topics.items()}
    return ulogs.ulog(sorted(rows, key=lambda row: row[:2]), fields, facts | parameters)


def run_on(contents, at_s, *groups):
    """The same flat log with columns that run on in a straight line from a time on, as interpolators make them."""
    columns = dict(contents.topics[""])
    row = int(np.searchsorted(columns["t"], at_s))
    steps = np.arange(1, len(columns["t"]) - row + 1)
    for name in (name for name in columns if name.startswith(groups)):
        values = columns[name].astype(float)
        values[row:] = values[row - 1] + (values[row - 1] - values[row - 2]) * steps
        columns[name] = values
    return LogContents({"": columns})
