"""Flights whose rotor commands are given, against an adaptive integrator and equations written in another way."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from cpfls_cli.inertia import symmetric
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulation.actuators import actuators
from cpfls_cli.simulation.closed_loop import Loop, clock_of, flown
from cpfls_cli.simulation.model import simulated_effects
from cpfls_cli.simulation.plant import Plant, flown_vehicle
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.vehicle.values import Each
from tests.builders.closed_loop_flights import VEHICLE as LEVEL

VEHICLE = replace(LEVEL, inertia_kg_m2=(0.6, 0.5, 1.0, 0.02, -0.03, 0.04))
TIME = 0.05 * np.arange(17)
START = np.array([0.0, 0.0, 20.0, 3.0, -1.0, -4.0, 0.1, -0.2, 0.3, 0.5, -0.3, 0.2])
SPEED, COMMAND, LAG = np.full(4, 340.0), np.array([362.0, 330.0, 350.0, 352.0]), 0.08
PUSH = np.array([0.05, -0.04, 0.02, 0.3, -0.2, 0.5])
EFFECTS = {
    "linear_damping": {"d_x": 0.1, "d_y": 0.2, "d_z": 0.05},
    "wind": {"k_d": 1.2e-3, "W_x": 2.0, "W_y": -3.0},
    "parasitic_drag": {"c_x": 0.03, "c_y": 0.04, "c_z": 0.05, "cr_y": 0.002},
    "rotor_acceleration": {"J_r": 4e-4},
    "rotor_gyroscopic": {"J_r": 4e-4},
    "com_offset": {"c_x": 0.01, "c_y": -0.02, "c_z": 0.03},
}
LOAD = {"mass": 0.4, "mass_times_depth": 0.04, "length_m": 0.6, "damping_1_s": 0.2, "depth_m": 0.1}


class Given:
    """A pilot that commands the same all the time."""

    def size(self, rotors):
        return rotors

    def given(self, _number, _start):
        return tuple(COMMAND.tolist())

    def commanded(self, given, _middle):
        return Each(given), Each(given)


def simulated(rate, effects):
    settings = ClosedLoopSettings(integration_rate_hz=rate, rotor_time_constant_s=LAG)
    clock, chosen = clock_of(TIME, settings), simulated_effects(effects, VEHICLE)
    vehicle = flown_vehicle(VEHICLE, None, chosen)
    state, push = np.concatenate([START, vehicle.start]), np.tile(PUSH, (clock.steps, 1))
    chain = actuators(chosen, RotorResponse(), VEHICLE, settings, SPEED, TIME[-1])
    change = Plant(vehicle, None).settled(state, SPEED, PUSH)
    loop = Loop(Given(), chain, vehicle, None, state, change, clock, push)
    return flown(loop, lambda _sample, _state: None, lambda _done, _all: None)


def equations(load):
    """Newton and Euler about the hubs' origin as one system of linear equations, the tension among the unknowns."""
    inertia, hubs = symmetric(VEHICLE.inertia_kg_m2), np.array([one.position_m for one in VEHICLE.rotors])
    spins = np.array([one.spin for one in VEHICLE.rotors])
    thrust = np.array([one.thrust_factor_n_s2 for one in VEHICLE.rotors])
    drag = np.array([one.drag_factor_n_m_s2 for one in VEHICLE.rotors])
    mass, gravity = VEHICLE.mass_kg, np.array([0.0, 0.0, 9.81])
    damping, drags = np.array([0.1, 0.2, 0.05]), np.array([0.03, 0.04, 0.05])

    def change(time, state):
        velocity, angles, rate = state[3:6], state[6:9], state[9:12]
        turned = Rotation.from_euler("ZYX", angles[::-1]).as_matrix()
        speed = COMMAND + (SPEED - COMMAND) * np.exp(-time / LAG)
        air = turned.T @ (velocity - [2.0, -3.0, 0.0])
        at_hubs = np.outer(thrust * speed**2, [0.0, 0.0, 1.0])
        at_hubs -= (1.2e-3 * speed)[:, None] * (air + np.cross(rate, hubs)) * [1.0, 1.0, 0.0]
        blown = -np.linalg.norm(air) * air
        force = at_hubs.sum(axis=0) + drags * blown
        torque = np.cross(hubs, at_hubs).sum(axis=0) + np.cross([0.0, 0.002, 0.0], blown) - damping * rate
        torque = torque - np.cross([0.01, -0.02, 0.03], force) + PUSH[:3]
        torque[2] -= (spins * drag * speed**2).sum() + 4e-4 * (spins * (COMMAND - speed) / LAG).sum()
        torque -= np.cross(rate, inertia @ rate + [0.0, 0.0, 4e-4 * (spins * speed).sum()])
        system, right = np.zeros((7, 7)), np.zeros(7)
        system[:3, :3], system[3:6, 3:6] = mass * np.eye(3), inertia
        right[:3], right[3:6] = turned @ (force + PUSH[3:]) - mass * gravity, torque
        system[6, 6] = 1.0
        if load:
            hook, cable, swing = np.array([0.0, 0.0, -0.1]), state[12:15] / np.linalg.norm(state[12:15]), state[15:18]
            skew = np.cross(hook, np.eye(3))
            system[:3, 6], system[3:6, 6] = -cable, -np.cross(hook, turned.T @ cable)
            # t / m = L n'^2 - (a + g) n, a = v' + R (omega' x r + omega x (omega x r)) being that of the hook.
            system[6, :3], system[6, 3:6], system[6, 6] = cable, cable @ turned @ skew, 1 / 0.4
            carried = turned @ np.cross(rate, np.cross(rate, hook)) + gravity
            right[6] = 0.6 * swing @ swing - carried @ cable
        found = np.linalg.solve(system, right)
        sine, cosine, tangent = np.sin(angles[0]), np.cos(angles[0]), np.tan(angles[1])
        turn = [
            rate[0] + tangent * (sine * rate[1] + cosine * rate[2]),
            cosine * rate[1] - sine * rate[2],
            (sine * rate[1] + cosine * rate[2]) / np.cos(angles[1]),
        ]
        more = []
        if load:
            felt = found[:3] + turned @ skew @ found[3:6] + carried
            more = [*swing, *(-(felt - (felt @ cable) * cable) / 0.6 - swing @ swing * cable - 0.2 * swing)]
        return [*velocity, *found[:3], *turn, *found[3:6], *more]

    return change


@pytest.mark.parametrize("load", [False, True], ids=["effects", "effects and a load"])
def test_a_flight_is_that_of_an_adaptive_integrator(load):
    effects = EFFECTS | ({"payload": LOAD} if load else {})
    start = np.concatenate([START, [0.0, 0.0, -1.0, 0.0, 0.0, 0.0]] if load else [START])
    exact = solve_ivp(equations(load), TIME[[0, -1]], start, "DOP853", TIME, rtol=1e-12, atol=1e-12).y.T
    coarse, fine = (simulated(rate, effects).state for rate in (1000.0, 2000.0))
    off = np.abs(fine - exact).max(axis=0)
    assert off.max() < 3e-5
    # Of second order: what is left falls to a quarter, and without it next to nothing is left.
    left = np.abs((4 * fine - coarse) / 3 - exact).max(axis=0)
    assert (left < 0.02 * off + 1e-9).all()
