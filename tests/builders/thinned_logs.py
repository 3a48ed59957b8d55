"""Flights under autopilots' own laws, and their logs as autopilots write them by default: motors ten times a second."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np
from scipy.spatial.transform import Rotation

from cpfls_cli.autopilots.motors import Motors
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.playback.gusts import Gusts
from cpfls_cli.rotations import rotation_matrix
from cpfls_cli.simulation.autopilot import GyroscopeNoise
from cpfls_cli.simulation.closed_loop import ClosedLoop, Setpoints, clock_of, fly_setpoints
from cpfls_cli.simulation.settings import ClosedLoopSettings
from tests.builders.autopilots import CROSS
from tests.builders.ulogs import ulog


def _gain(along, shares, top):
    ways = [0.0]
    for own, share in zip(along, shares, strict=True):
        if abs(own) > 1e-7 and share < 0:
            ways.append(-share / own)
        if abs(own) > 1e-7 and share > top:
            ways.append((top - share) / own)
    return min(ways) + max(ways)


def _desaturated(shares, along, top=1.0, down=False):
    gain = _gain(along, shares, top)
    if down and gain > 0:
        return shares
    shares = [share + gain * own for share, own in zip(shares, along, strict=True)]
    gain = 0.5 * _gain(along, shares, top)
    return [share + gain * own for share, own in zip(shares, along, strict=True)]


def mixed_by_px4(mix, thrust, turning, airmode=0):
    """One sample as the sequential desaturation of PX4 mixes it, motor by motor."""
    lift, roll, pitch, yaw = np.asarray(mix).T.tolist()
    shares = [lift[m] * thrust + roll[m] * turning[0] + pitch[m] * turning[1] for m in range(len(lift))]
    turned = [yaw[m] * turning[2] for m in range(len(lift))]
    if airmode == 2:
        shares = [share + own for share, own in zip(shares, turned, strict=True)]
        shares = _desaturated(_desaturated(shares, lift), yaw)
        return [min(max(share, 0.0), 1.0) for share in shares]
    if airmode == 1:
        shares = _desaturated(shares, lift)
    else:
        for along, down in ((lift, True), (roll, False), (pitch, False)):
            shares = _desaturated(shares, along, down=down)
    shares = [share + own for share, own in zip(shares, turned, strict=True)]
    shares = _desaturated(_desaturated(shares, yaw, 1.15), lift, down=True)
    return [min(max(share, 0.0), 1.0) for share in shares]


def mixed_by_ardupilot(mix, thrust, turning, headroom=0.2, mean=0.175):
    """One sample as the matrix of ArduPilot mixes it, motor by motor."""
    thrust = min(max(thrust, 0.0), 1.0)
    mean = min(max(mean, thrust), 1.0)
    best, allowed = min(0.5, mean), 1.0
    tilted = [row[1] * turning[0] + row[2] * turning[1] for row in mix]
    for row, own in zip(mix, tilted, strict=True):
        if row[3]:
            room = 1.0 - best - own if row[3] * turning[2] > 0 else best + own
            allowed = min(allowed, max(room, 0.0) / abs(row[3]))
    allowed = max(allowed, headroom)
    yaw = min(max(turning[2], -allowed), allowed)
    shares = [own + yaw * row[3] for row, own in zip(mix, tilted, strict=True)]
    scale = 1.0
    if max(shares) - min(shares) > 1.0:
        scale = 1.0 / (max(shares) - min(shares))
    if mean + min(shares) < 0:
        scale = min(scale, -mean / min(shares))
    low, high = scale * min(shares), scale * max(shares)
    more = thrust + low
    more = 0.0 if scale < 1.0 or more < 0 else min(more, 1.0 - (high - low))
    return [min(max(more - low + scale * share, 0.0), 1.0) for share in shares]


MIXED = {"px4": mixed_by_px4, "ardupilot": mixed_by_ardupilot}
FRD = np.array([1.0, -1.0, -1.0])
NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
CA = {"CA_ROTOR_COUNT": 4.0} | {
    f"CA_ROTOR{number}_{name}": value
    for number, rotor in enumerate(CROSS.rotors)
    for name, value in zip(
        ("PX", "PY", "KM"), (rotor.position_m[0], -rotor.position_m[1], 0.05 * rotor.spin), strict=True
    )
}

AP = {"MOT_THST_EXPO": 0.6, "MOT_SPIN_MIN": 0.12, "MOT_SPIN_MAX": 0.9}
COPTER = AP | {"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0, "MOT_PWM_MIN": 1000.0, "MOT_PWM_MAX": 2000.0}
COPTER |= {"MOT_YAW_HEADROOM": 200.0, "MOT_THST_HOVER": 0.35}


class Flown:
    """A flight: the law's steps on its own clock, with what it asked of its mixer, and the motion with its rotors.

    Attributes
    ----------
    time, thrust, turning, command
        Steps of the law: s, shares of full; FRD, shape (step, 3); of the rotors, shape (step, rotor).
    rate, attitude : array, shape (step, 3)
        Body rate with noise and roll, pitch, yaw, FLU and ENU.
    """

    def __init__(self, autopilot, values=None, *, seconds=20.0, seed=1, size=0.25, vehicle=CROSS, noise=0.01):
        settings = ClosedLoopSettings(
            autopilot=autopilot,
            autopilot_parameters=values or {},
            rotor_time_constant_s=0.03,
            integration_rate_hz=400.0,
        )
        rng = np.random.default_rng(seed)
        time = np.arange(round(seconds * 250) + 1) / 250
        steps = rng.uniform(-1, 1, (round(seconds / 0.4) + 2, 4)) * [size, size, 1.6 * size, 0.06]
        asked = steps[(time / 0.4).astype(int)]
        law = settings.law
        # In the order in which the autopilot numbers its motors.
        rotors = [
            replace(one, position_m=(x * 0.16, y * 0.16, 0.0), spin=spin)
            for one, (x, y, spin) in zip(vehicle.rotors, AUTOPILOTS[autopilot].cross, strict=True)
        ]
        vehicle = replace(vehicle, rotors=tuple(rotors))
        motors = Motors.of(law.mixer, law.curve, vehicle)
        lift = sum(rotor.thrust_factor_n_s2 for rotor in vehicle.rotors)
        hover = motors.share_of(float(np.sqrt(vehicle.mass_kg * vehicle.gravity_m_s2 / lift)))
        clock = clock_of(time, settings)
        gusts = Gusts(np.array([0.02, 0.02, 0.005, 0.3, 0.3, 0.3]), np.full(6, 0.4))
        push = gusts.drawn(rng, clock.step, clock.steps)
        mixed, mix = [], Motors.speeds

        def recorded(self, thrust, turning):
            found = mix(self, thrust, turning)
            shares = MIXED[autopilot](self.mix * [1.0, *FRD], thrust, FRD * turning)
            speed = self.curve.signal(np.array(shares)) * self.speed_max
            mixed.append((thrust, *turning, *(speed / self.speed_max)))
            return found._replace(speed=speed)

        with patch.object(Motors, "speeds", recorded):
            motion = fly_setpoints(
                ClosedLoop(vehicle, settings),
                time,
                Setpoints(asked[:, :3], None, hover * (1 + asked[:, 3])),
                np.zeros(12),
                push,
                GyroscopeNoise(noise, rng.spawn(1)[0]),
            )
        sent = np.array(mixed[1:])
        self.law, self.vehicle = law, vehicle
        self.time = np.arange(len(sent)) * seconds / len(sent)
        self.thrust, self.turning, self.command = sent[:, 0], sent[:, 1:4] * FRD, sent[:, 4:]
        noisy = motion.state[:, 9:12] + noise * rng.standard_normal((len(time), 3))
        self.motion_time, self.state, self.rate, self.change = time, motion.state, noisy, motion.change
        self.speed = motion.speed

    def at(self, rate_hz):
        """Pick the steps of the law that a logger takes at a rate."""
        return np.searchsorted(self.time, np.arange(0.0, self.time[-1], 1 / rate_hz) + 1e-9, side="right") - 1

    def px4_topics(self, torque_hz=50.0, motors_hz=10.0):
        """What PX4 logs of its allocation, by topic."""
        slow, fast = self.at(motors_hz), self.at(torque_hz)
        thrust = np.zeros((len(fast), 3))
        thrust[:, 2] = -self.thrust[fast]
        return {
            "vehicle_torque_setpoint": topic(self.time[fast], "xyz", self.turning[fast]),
            "vehicle_thrust_setpoint": topic(self.time[fast], "xyz", thrust),
            "actuator_motors": topic(self.time[slow], "control", self.command[slow]),
        }

    def ardupilot_topics(self, rate_hz=400.0, outputs_hz=10.0, *, late_s=0.0, seed=1):
        """What ArduPilot logs of its mixer, by topic; outputs that another processor sends are read back late."""
        slow, fast = self.at(outputs_hz), self.at(rate_hz)
        late = late_s * np.random.default_rng(seed).uniform(0, 1, len(slow))
        sent = self.command[np.maximum(np.searchsorted(self.time, self.time[slow] - late + 1e-9, side="right") - 1, 0)]
        rates = np.column_stack([self.turning[fast], self.thrust[fast]])
        names = ("ROut", "POut", "YOut", "AOut")
        return {
            "RATE": {"timestamp": self.time[fast]} | dict(zip(names, rates.T, strict=True)),
            "RCOU": {"timestamp": self.time[slow]}
            | {f"C{index + 1}": np.round(1000 + 1000 * own) for index, own in enumerate(sent.T)},
        }


def topic(time, name, values):
    return {"timestamp": time} | {f"{name}[{index}]": own for index, own in enumerate(values.T)}


def quaternions(attitude):
    """Body FRD in NED of roll, pitch, yaw of FLU in ENU, shape (time, 4)."""
    turned = NED @ rotation_matrix(attitude) @ np.diag(FRD)
    return np.roll(Rotation.from_matrix(turned).as_quat(canonical=True), 1, axis=1)


FIELDS = {
    "vehicle_attitude": "uint64_t timestamp;float[4] q",
    "vehicle_angular_velocity": "uint64_t timestamp;float[3] xyz",
    "vehicle_local_position": "uint64_t timestamp;float x;float y;float z;float vx;float vy;float vz",
    "vehicle_torque_setpoint": "uint64_t timestamp;float[3] xyz",
    "vehicle_thrust_setpoint": "uint64_t timestamp;float[3] xyz",
    "actuator_motors": "uint64_t timestamp;float[4] control",
    "vehicle_rates_setpoint": "uint64_t timestamp;float roll;float pitch;float yaw",
}


def write_px4(path, flown, *, torque_hz=50.0, motors_hz=10.0, motion_hz=250.0, more=None):
    """Write a ULog of PX4 with its allocation at the rates of its default profile."""
    every = round(250 / motion_hz)
    position, velocity = flown.state[:, :3] @ NED, flown.state[:, 3:6] @ NED
    topics = {
        "vehicle_attitude": (flown.motion_time, quaternions(flown.state[:, 6:9])),
        "vehicle_angular_velocity": (flown.motion_time, flown.rate * FRD),
        "vehicle_local_position": (flown.motion_time, np.hstack([position, velocity])),
    }
    topics = {name: (time[::every], values[::every]) for name, (time, values) in topics.items()}
    for name, own in flown.px4_topics(torque_hz, motors_hz).items():
        time, *columns = own.values()
        topics[name] = time, np.column_stack(columns)
    numbers = {name: number for number, name in enumerate(topics)}
    sent = sorted(
        (round(1e6 * stamp), numbers[name], row)
        for name, (time, values) in topics.items()
        for stamp, row in zip(time.tolist(), values.tolist(), strict=True)
    )
    facts = {"sys_name": "PX4", "ver_sw_release": 0x010F00FF, "SYS_AUTOSTART": 4001.0} | CA | (more or {})
    path.write_bytes(ulog(sent, {name: FIELDS[name] for name in topics}, facts))
    return path
