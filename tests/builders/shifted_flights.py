"""Flights made from the equations of motion alone: sums of sines for rates and thrust, rotor speeds that give them."""

import numpy as np
from scipy.spatial.transform import Rotation

INERTIA = np.array([0.6, 0.6, 1.2])
ARM, THRUST, DRAG = 0.3, 121.5e-6, 2.7e-6
OFFSET = (0.008, -0.005)
HEADER = "t,wx,wy,wz,om1,om2,om3,om4"

CONFIG = """
import:
  signals:
    attitude: {columns: [phi, theta, psi], unit: rad, required: false}
    body_rate: {columns: [wx, wy, wz], unit: rad/s}
    rotor_speed: {columns: [om1, om2, om3, om4], unit: rad/s, required: false}
  torque_source: null
# No log here holds a velocity, without which a wind could not be ruled out.
gap: {shifts: 39, horizon_s: 0.1, ignore: [wind]}
"""

# Squared speeds to thrust, roll, pitch and yaw of the '+' layout, written out.
ALLOCATION = np.array(
    [[THRUST] * 4, [0, -ARM * THRUST, 0, ARM * THRUST], [-ARM * THRUST, 0, ARM * THRUST, 0], [-DRAG, DRAG, -DRAG, DRAG]]
)


def motion(time, rng):
    """Give body rates and their derivatives, and the thrust."""
    rate, slope = np.zeros((2, len(time), 3))
    for axis, size in enumerate((0.4, 0.4, 0.08)):
        for frequency in rng.uniform(0.2, 1.2, 4):
            turn = 2 * np.pi * frequency
            phase = rng.uniform(0, 2 * np.pi)
            rate[:, axis] += size * np.sin(turn * time + phase) / 2
            slope[:, axis] += size * turn * np.cos(turn * time + phase) / 2
    thrust = 6 * 9.81 * (1 + 0.2 * np.sin(2 * np.pi * rng.uniform(0.1, 0.3) * time + rng.uniform(0, 6)))
    return rate, slope, thrust


def flight_table(seed, offset=(0.0, 0.0), duration=24.0, rate_hz=100.0):
    """Give a log, shape (time, 8); the offset of the centre of mass is what the rotors have to balance."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(duration * rate_hz)) / rate_hz
    rate, slope, thrust = motion(time, rng)
    torque = INERTIA * slope + np.cross(rate, INERTIA * rate)
    tilting = np.column_stack([-offset[1] * thrust, offset[0] * thrust, np.zeros_like(thrust)])
    squared = np.linalg.solve(ALLOCATION, np.column_stack([thrust, torque - tilting]).T).T
    assert squared.min() > 0
    return np.column_stack([time, rate + rng.normal(0, 0.002, rate.shape), np.sqrt(squared)])


def attitude_of(rate, step=0.01):
    """Integrate body rates to roll, pitch and yaw, from level."""
    turns, angles = Rotation.identity(), np.zeros_like(rate)
    for place in range(1, len(rate)):
        turns = turns * Rotation.from_rotvec(0.5 * step * (rate[place - 1] + rate[place]))
        angles[place] = turns.as_euler("ZYX")[::-1]
    return np.unwrap(angles, axis=0)


def save(path, table, header=HEADER):
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.9g")
    return path
