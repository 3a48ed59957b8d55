"""The load on a cable against an integrator and against forces in balance."""

from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp

from cpfls_cli.effects.catalogue.payload import swing


def test_swing_is_the_solution_of_the_driven_pendulum(flight):
    length, damping = 1.5, 0.2
    acceleration = np.diff(flight.velocity[:, 0]) / 0.005

    def rate(t, state):
        push = acceleration[min(int(t / 0.005), len(acceleration) - 1)]
        return [state[1], -push / length - damping * state[1] - 9.81 / length * state[0]]

    span = (0.0, flight.time[-1])
    solved = solve_ivp(rate, span, [0.0, 0.0], t_eval=flight.time, max_step=0.005, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(swing(flight, length, damping)[:, 0], solved.y[0], atol=2e-4)
    assert np.abs(solved.y[0]).max() > 0.3


def test_cable_pulls_along_gravity_where_the_velocity_is_constant(columns, flight, with_velocity):
    level = replace(with_velocity(flight, [5.0, -2.0, 0.0]), attitude=np.zeros_like(flight.attitude))
    found = columns("payload", level, length_m=1.0, damping_1_s=0.2).direct
    np.testing.assert_allclose(found @ [0.06, 0.6], [[0, 0, 0, 0, 0, -0.6 * 9.81]] * len(level), atol=1e-8)


def test_cable_rights_a_tilted_vehicle(columns, flight, with_velocity):
    tilted = replace(with_velocity(flight, [0.0, 0.0, 0.0]), attitude=np.full_like(flight.attitude, [0.2, 0.0, 0.0]))
    torque = columns("payload", tilted, length_m=1.0, damping_1_s=0.2).direct[:, :3, 0]
    np.testing.assert_allclose(torque, [[-9.81 * np.sin(0.2), 0.0, 0.0]] * len(tilted), atol=1e-9)


def test_climbing_harder_pulls_harder(columns, flight, with_velocity):
    rising = replace(with_velocity(flight, [0.0, 0.0, 0.0]), acceleration=np.tile([0.0, 0.0, 2.0], (len(flight), 1)))
    force = columns("payload", rising, length_m=1.0, damping_1_s=0.2).direct[:, 3:, 1]
    np.testing.assert_allclose(np.linalg.norm(force, axis=1), 11.81)
