"""Columns of forces and moments against the formulas, sample by sample and rotor by rotor."""

from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli import rotations
from cpfls_cli.vehicle.rotors import body_wrench

Z = np.array([0.0, 0.0, 1.0])


def in_plane(vector):
    return np.array([vector[0], vector[1], 0.0])


# At a hub, from the rotor speed w, its spin s and the velocity u there: force and moment.
ROTORS = {
    "rotor_drag": lambda at: (-at.w * in_plane(at.u), np.zeros(3)),
    "flapping_moment": lambda at: (np.zeros(3), -at.w * np.array([at.u[1], -at.u[0], 0.0])),
    "rolling_moment": lambda at: (np.zeros(3), -at.s * at.w * in_plane(at.u)),
    "inflow": lambda at: (-at.w * at.u[2] * Z, np.zeros(3)),
    "translational_lift": lambda at: ((at.u[0] ** 2 + at.u[1] ** 2) * Z, np.zeros(3)),
}

# On the body, from its rate and all rotors: the torque for one unit of each coefficient.
BODIES = {
    "linear_damping": lambda at: [-at.rate[j] * np.eye(3)[j] for j in range(3)],
    "quadratic_damping": lambda at: [-abs(at.rate[j]) * at.rate[j] * np.eye(3)[j] for j in range(3)],
    "rotor_gyroscopic": lambda at: [-np.cross(at.rate, sum(at.s * at.w) * Z)],
    "torque_bias": lambda _: list(np.eye(3)),
}


def rotation(attitude):
    return rotations.rotation_matrix(attitude[None])[0]


def at_sample(signals, k, law):
    force, torque = np.zeros(3), np.zeros(3)
    velocity = rotation(signals.attitude[k]).T @ signals.velocity[k]
    for rotor, w in zip(signals.vehicle.rotors, signals.rotor_speed[k], strict=True):
        hub = np.array(rotor.position_m)
        u = velocity + np.cross(signals.body_rate[k], hub)
        there, moment = law(SimpleNamespace(w=w, s=rotor.spin, u=u))
        force += there
        torque += moment + np.cross(hub, there)
    return np.concatenate([torque, force])


@pytest.mark.parametrize("name", ROTORS)
def test_what_acts_at_the_hubs(columns, flight, name):
    found = columns(name, flight)
    assert found.momentum is None
    for k in (0, 211, 599):
        np.testing.assert_allclose(found.direct[k, :, 0], at_sample(flight, k, ROTORS[name]), atol=1e-9)


@pytest.mark.parametrize("name", BODIES)
def test_what_acts_on_the_body(columns, flight, name):
    found = columns(name, flight).direct
    spins = np.array([rotor.spin for rotor in flight.vehicle.rotors])
    for k in (0, 211, 599):
        at = SimpleNamespace(rate=flight.body_rate[k], w=flight.rotor_speed[k], s=spins)
        torque = np.array(BODIES[name](at)).T
        np.testing.assert_allclose(found[k, :3], torque, atol=1e-12)
    assert not found[:, 3:].any()


def test_discs_that_lag_brake_the_body_and_lean_the_thrust(columns, flight):
    """Thrust at hub i turns by -(p, q) about x and y against the body; its roll and pitch lever is in k_w."""
    found = columns("rotor_plane_damping", flight).direct
    for k in (0, 211, 599):
        rate, total = flight.body_rate[k], np.zeros(6)
        for rotor, w in zip(flight.vehicle.rotors, flight.rotor_speed[k], strict=True):
            force = w * np.cross(-in_plane(rate), Z)
            total += np.concatenate([np.cross(rotor.position_m, force) * Z, force])
        np.testing.assert_allclose(found[k, :, 1], total, atol=1e-9)
        damping = -flight.rotor_speed[k].sum() * in_plane(rate)
        np.testing.assert_allclose(found[k, :, 0], [*damping, 0.0, 0.0, 0.0], atol=1e-9)


def test_wind_is_rotor_drag_through_moving_air(columns, flight, with_velocity):
    drag, wind = 1.3e-3, np.array([3.0, -2.0, 0.0])
    expected = drag * columns("rotor_drag", with_velocity(flight, flight.velocity - wind)).direct[..., 0]
    found = columns("wind", flight).direct @ [drag, drag * wind[0], drag * wind[1]]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_parasitic_drag_acts_at_the_centre_of_pressure(columns, flight):
    drag, centre, k = 0.035, np.array([0.02, -0.01, -0.05]), 321
    velocity = rotation(flight.attitude[k]).T @ flight.velocity[k]
    force = -drag * np.linalg.norm(velocity) * velocity
    found = columns("parasitic_drag", flight).direct[k] @ [drag, drag, drag, *(drag * centre)]
    np.testing.assert_allclose(found, [*np.cross(centre, force), *force], atol=1e-12)


def test_an_offset_moves_the_centre_of_mass_away_from_the_thrust(columns, flight):
    offset = np.array([0.01, -0.02, 0.0])
    thrust = body_wrench(flight.vehicle, flight.rotor_speed).thrust
    found = columns("com_offset", flight).direct @ offset[:2]
    np.testing.assert_allclose(found[:, :3], np.cross(-offset, thrust[:, None] * Z), atol=1e-12)
    assert not found[:, 3:].any()


def test_torque_about_the_euler_axes_is_what_the_log_meant(columns, flight):
    rotor = body_wrench(flight.vehicle, flight.rotor_speed).body_torque
    true = rotor + columns("euler_axis_torque", flight).direct[:, :3, 0]
    np.testing.assert_allclose(rotations.generalised_torque(flight.attitude, true), rotor, atol=1e-12)
