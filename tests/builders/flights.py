"""Flights whose torque is known: of a rigid body and of one that bends, at random attitudes or on full rotations."""

import numpy as np
from scipy.signal import lfilter

from cpfls_cli.dynamics import newton_euler_torque
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.trajectory.rotation import full_rotation
from cpfls_cli.trajectory.settings import RotationSettings

INERTIA = np.diag([0.6, 0.7, 1.2])


def random_motion(rng, samples, limit=np.pi):
    """Draw attitudes within a limit, and rates and accelerations of unit deviation; neighbours have no relation."""
    return Motion(rng.uniform(-limit, limit, (samples, 3)), *rng.standard_normal((2, samples, 3)))


def rotating_motion(seed, samples, duration):
    """Time and motion of a random path of full rotations."""
    path = full_rotation(RotationSettings(), duration, np.random.default_rng(seed))
    time = path.times(samples)
    return time, Motion(*vars(path.sample(time)).values())


def rigid_torque(inertia=INERTIA):
    """Torque of a rigid body, as a function of the motion."""

    def torque_of(motion):
        return newton_euler_torque(motion.attitude, motion.rate, motion.acceleration, inertia)

    return torque_of


def bent_torque(inertia=INERTIA, size=0.3):
    """Torque with size * cos(roll) on top of D22, which no rigid body has, worked from its Lagrangian by hand.

    L = 1/2 f(roll) pitch_rate^2 gives -1/2 f' pitch_rate^2 about roll and f pitch_acc + f' roll_rate pitch_rate
    about pitch.
    """
    rigid = rigid_torque(inertia)

    def torque_of(motion):
        roll = motion.attitude[:, 0]
        f, slope = size * np.cos(roll), -size * np.sin(roll)
        torque = rigid(motion)
        torque[:, 0] -= 0.5 * slope * motion.rate[:, 1] ** 2
        torque[:, 1] += f * motion.acceleration[:, 1] + slope * motion.rate[:, 0] * motion.rate[:, 1]
        return torque

    return torque_of


def random_flight(torque_of, seed, samples, *, noise=0.0, limit=np.pi, start=0.0):
    """A torque with white noise along a random motion, a hundred samples in a second."""
    rng = np.random.default_rng(seed)
    motion = random_motion(rng, samples, limit)
    torque = torque_of(motion)
    if noise:
        torque = torque + noise * rng.standard_normal(torque.shape)
    return TorqueData(start + 0.01 * np.arange(samples), motion, torque)


def still_flight(torque, attitude=None, step=0.01):
    """A torque on a vehicle that does not turn, level unless an attitude is given."""
    torque = np.asarray(torque, dtype=float)
    still = np.zeros_like(torque)
    return TorqueData(
        step * np.arange(len(torque)), Motion(still if attitude is None else attitude, still, still), torque
    )


def coloured_noise(rng, samples, time_constant):
    """Noise of unit variance, shape (samples, 3), that is remembered for a number of samples, or white for 0."""
    keep = np.exp(-1 / time_constant) if time_constant else 0.0
    return lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal((300 + samples, 3)), axis=0)[300:]
