"""Columns that are differentiated in time, against Newton's and Euler's equations with the parameters changed."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from cpfls_cli import rotations
from cpfls_cli.inertia import symmetric


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
