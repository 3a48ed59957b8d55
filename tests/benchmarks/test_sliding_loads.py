"""The torque of a vehicle with sliding loads is that of its energy, by formulas that share nothing with it."""

import numpy as np
import pytest

from benchmarks.shared.full_circle import INERTIA, torque_data
from benchmarks.shared.sliding_loads import SlidingLoads
from cpfls_cli import rotations
from cpfls_cli.dynamics.equations_of_motion import coriolis_matrix
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.regressor.regressor import InertiaValues

ANGLES = np.eye(3)
STEP = 1e-4


def motion_at(seed, samples=200):
    rng = np.random.default_rng(seed)
    return Motion(*(rng.uniform(-1, 1, (samples, 3)) * limit for limit in (np.pi, 3.0, 6.0)))


def place(loads, attitude):
    """The place on the rail, written out again for a stroke of 0.3 m."""
    roll, pitch, _ = attitude.T
    cosine = np.cos(roll) * (np.cos(pitch) if loads.by == "tilt" else 1.0)
    return 0.1 + 0.3 * (0.5 + 0.5 * np.tanh(2 * cosine) / np.tanh(2))


def world_positions(loads, attitude):
    """Both loads in the world, shape (2, samples, 3)."""
    along = rotations.rotation_matrix(attitude)[:, :, 0] * place(loads, attitude)[:, None]
    return np.stack([along, -along])


def central(function, attitude, step=STEP):
    """Derivatives by the angles, of fourth order, shape (..., angle)."""
    sides = {k: [function(attitude + k * step * axis) for axis in ANGLES] for k in (-2, -1, 1, 2)}
    return np.stack(
        [(sides[-2][a] - 8 * sides[-1][a] + 8 * sides[1][a] - sides[2][a]) / (12 * step) for a in range(3)], axis=-1
    )


def inertia_of(loads, attitude):
    """D(q) from the energy: a rigid body, and two point masses by how they move in the world."""
    W = rotations.euler_rate_matrix(attitude)
    moves = central(lambda q: world_positions(loads, q), attitude)
    return W.swapaxes(1, 2) @ INERTIA @ W + loads.mass * np.einsum("lnxi,lnxj->nij", moves, moves)


def lagrangian_torque(inertia, motion):
    gradient = np.moveaxis(central(inertia, motion.attitude, 1e-3), -1, 1)
    values = InertiaValues(inertia(motion.attitude), gradient)
    turning = np.einsum("nij,nj->ni", values.value, motion.acceleration)
    return turning + np.einsum("nij,nj->ni", coriolis_matrix(values, motion.rate), motion.rate)


@pytest.mark.parametrize("by", ["roll", "tilt"])
def test_torque_on_a_cam_is_the_lagrangian_one(by):
    loads, motion = SlidingLoads(0.3, 0.3, by), motion_at(1)
    lagrangian = lagrangian_torque(lambda q: inertia_of(loads, q), motion)
    torque = loads.on(torque_data(motion, INERTIA)).torque
    assert np.abs(torque - lagrangian).max() < 1e-7 * np.abs(torque).max()
    assert np.abs(loads.torque(motion)).max() > 0.05 * np.abs(torque).max()


@pytest.mark.parametrize("by", ["roll", "tilt"])
def test_part_of_the_loads_own_motion_is_that_of_their_speed_on_the_rail(by):
    loads, motion = SlidingLoads(0.3, 0.3, by), motion_at(3)

    def along_the_rail(attitude):
        slope = central(lambda q: place(loads, q), attitude)
        return 2 * loads.mass * slope[:, :, None] * slope[:, None]

    part, lagrangian = loads.own_motion(motion), lagrangian_torque(along_the_rail, motion)
    assert np.abs(part - lagrangian).max() < 1e-6 * np.abs(part).max()


def energy(loads, attitude, rate):
    return 0.5 * np.einsum("ni,nij,nj->n", rate, inertia_of(loads, attitude), rate)


@pytest.mark.parametrize("held_by", ["cam", "servo"])
def test_power_is_the_change_of_the_energy(held_by):
    """Along ``q + t qd + t^2/2 qdd``; servos work on the loads besides: 2 m (s'' - s (omega_y^2 + omega_z^2)) ds/dt."""
    loads, motion = SlidingLoads(0.3, 0.3, "tilt", held_by), motion_at(2)
    q, qd, qdd = motion.attitude, motion.rate, motion.acceleration
    at = [energy(loads, q + t * qd + 0.5 * t**2 * qdd, qd + t * qdd) for t in (-2e-4, -1e-4, 1e-4, 2e-4)]
    change = (at[0] - 8 * at[1] + 8 * at[2] - at[3]) / 12e-4
    power = np.sum(loads.on(torque_data(motion, INERTIA)).torque * qd, axis=1)
    if held_by == "servo":
        place, _, speed, acceleration = loads.place(motion)
        across = rotations.body_rate(q, qd)[:, 1:]
        power += 2 * loads.mass * (acceleration - place * np.sum(across**2, axis=1)) * speed
    assert np.abs(power - change).max() < 1e-6 * np.abs(change).max()


def test_loads_stand_outermost_upright_and_one_stroke_nearer_upside_down():
    upright = Motion(np.array([[0.0, 0.0, 1.0], [np.pi, 0.0, 1.0]]), np.zeros((2, 3)), np.zeros((2, 3)))
    place, gradient, *_ = SlidingLoads(0.1, 0.3, "tilt").place(upright)
    assert place == pytest.approx([0.4, 0.1])
    assert np.abs(gradient).max() < 1e-15
