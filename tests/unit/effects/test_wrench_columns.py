"""Columns of wrench and momentum of each effect against formulas written sample by sample."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from cpfls_cli import rotations
from cpfls_cli.inertia import symmetric
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
        np.testing.assert_allclose(found[k, :3], np.array(BODIES[name](at)).T, atol=1e-12)
    assert not found[:, 3:].any()


def test_a_thrust_that_is_half_a_line_turns_with_the_factors_of_each_rotor(columns, flight):
    """In hover thrust and drag torque are as they were; their sum is ``(1 - a) w^2 + a w_h w``, times the factors."""
    found = columns("thrust_slope", flight).direct[..., 0]
    vehicle = flight.vehicle
    hover = np.sqrt(vehicle.mass_kg * 9.81 / sum(rotor.thrust_factor_n_s2 for rotor in vehicle.rotors))
    for k in (0, 211, 599):
        half = np.sqrt(0.5 * flight.rotor_speed[k] ** 2 + 0.5 * hover * flight.rotor_speed[k])
        square, mixed = (
            np.concatenate([given.body_torque[0], [0.0, 0.0, given.thrust[0]]])
            for given in (body_wrench(vehicle, speed[None]) for speed in (flight.rotor_speed[k], half))
        )
        np.testing.assert_allclose(square + 0.5 * found[k], mixed, atol=1e-9)


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


def total(found, coefficients, time):
    """Differentiate what the search integrates by parts."""
    return found.direct @ coefficients + np.gradient(found.momentum @ coefficients, time, axis=0, edge_order=2)


def torque(flight, inertia):
    acceleration = np.gradient(flight.body_rate, flight.time, axis=0, edge_order=2)
    return acceleration @ inertia + np.cross(flight.body_rate, flight.body_rate @ inertia)


@pytest.mark.parametrize(
    ("name", "coefficients", "change"),
    [
        ("products_of_inertia", [0.03, -0.02, 0.01], [0, 0, 0, 0.03, -0.02, 0.01]),
        ("parameter_error", [0.1, -0.2, 0.3, *[0.0] * 7], [0.06, -0.12, 0.36, 0, 0, 0]),
    ],
)
def test_wrong_inertia_leaves_what_the_true_body_does_not_need(columns, flight, name, coefficients, change):
    nominal = symmetric(flight.vehicle.inertia_kg_m2)
    residual = torque(flight, nominal) - torque(flight, nominal + symmetric(change))
    found = total(columns(name, flight), np.array(coefficients), flight.time)
    np.testing.assert_allclose(found[:, :3], residual, atol=1e-10)
    assert not found[:, 3:].any()


def test_coupling_is_the_product_of_the_other_two_rates(columns, flight):
    found = columns("parameter_error", flight)
    for k in (0, 211, 599):
        p, q, r = flight.body_rate[k]
        expected = -np.diag([0.9 * q * r, 0.9 * r * p, 0.6 * p * q])
        np.testing.assert_allclose(found.direct[k, :3, 3:6], expected, atol=1e-12)
    assert not found.direct[:, 3:, 3:6].any()
    assert not found.momentum[:, :, 3:6].any()


def test_a_wrong_scale_of_the_rotor_torque_is_a_wrong_inertia_with_its_coupling(columns, flight):
    """Rotors that pull k_j less on axis j leave k_j of the torque that the body needs."""
    weak, inertia = np.array([0.1, -0.2, 0.05]), np.diag([0.6, 0.7, 1.2])
    craft = replace(flight, vehicle=replace(flight.vehicle, inertia_kg_m2=(0.6, 0.7, 1.2)))
    coupling = weak * [1.2 - 0.7, 0.6 - 1.2, 0.7 - 0.6]
    own = -weak * [0.6, 0.7, 1.2]
    left_by_inertia = np.array([own[2] - own[1], own[0] - own[2], own[1] - own[0]])
    # Columns give -(dI terms) - g mean q r, and the scale leaves +k (I omegad + coupling).
    mean = 0.5 * np.array([0.7 + 1.2, 1.2 + 0.6, 0.6 + 0.7])
    coefficients = [*-weak, *(-(coupling + left_by_inertia) / mean), 0, 0, 0, 0]
    found = total(columns("parameter_error", craft), np.array(coefficients), craft.time)
    np.testing.assert_allclose(found[:, :3], weak * torque(craft, inertia), atol=1e-10)


def test_thrust_scale_shows_in_force_only(columns, flight):
    found = total(columns("parameter_error", flight), np.eye(10)[6] * 0.1, flight.time)
    np.testing.assert_allclose(found[:, 5], 0.1 * flight.thrust)
    assert not found[:, :5].any()


def test_a_reference_point_feels_the_acceleration_of_a_point_of_the_body(columns, flight):
    """Where the point is, differentiated twice in the world, and turned into the body."""
    lever = np.array([0.05, -0.03, 0.08])
    along = CubicSpline(flight.time, flight.attitude)
    turning = replace(flight, body_rate=rotations.body_rate(flight.attitude, along(flight.time, 1)))
    rotation = Rotation.from_euler("ZYX", flight.attitude[:, ::-1])
    acceleration = CubicSpline(flight.time, rotation.apply(lever))(flight.time, 2)
    expected = flight.vehicle.mass_kg * rotation.inv().apply(acceleration)
    found = total(columns("parameter_error", turning), np.array([*[0.0] * 7, *lever]), flight.time)
    inside = slice(20, -20)
    np.testing.assert_allclose(found[inside, 3:], expected[inside], atol=2e-3 * np.abs(expected).max())
    assert not found[:, :3].any()


def test_rotors_that_speed_up_push_the_body_the_other_way(columns, flight):
    spins = [rotor.spin for rotor in flight.vehicle.rotors]
    reaction = -np.gradient(flight.rotor_speed, flight.time, axis=0, edge_order=2) @ spins
    found = total(columns("rotor_acceleration", flight), np.ones(1), flight.time)
    np.testing.assert_allclose(found[:, 2], reaction, atol=1e-8)
    assert not found[:, [0, 1, 3, 4, 5]].any()
