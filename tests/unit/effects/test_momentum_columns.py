"""Columns that are differentiated in time, against Newton's and Euler's equations with the parameters changed."""

import numpy as np
import pytest

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
        ("parameter_error", [0.1, -0.2, 0.3, 0.0], [0.06, -0.12, 0.36, 0, 0, 0]),
    ],
)
def test_wrong_inertia_leaves_what_the_true_body_does_not_need(columns, flight, name, coefficients, change):
    nominal = symmetric(flight.vehicle.inertia_kg_m2)
    residual = torque(flight, nominal) - torque(flight, nominal + symmetric(change))
    found = total(columns(name, flight), np.array(coefficients), flight.time)
    np.testing.assert_allclose(found[:, :3], residual, atol=1e-10)
    assert not found[:, 3:].any()


def test_thrust_scale_shows_in_force_only(columns, flight):
    found = total(columns("parameter_error", flight), np.array([0, 0, 0, 0.1]), flight.time)
    np.testing.assert_allclose(found[:, 5], 0.1 * flight.thrust)
    assert not found[:, :5].any()


def test_rotors_that_speed_up_push_the_body_the_other_way(columns, flight):
    spins = [rotor.spin for rotor in flight.vehicle.rotors]
    reaction = -np.gradient(flight.rotor_speed, flight.time, axis=0, edge_order=2) @ spins
    found = total(columns("rotor_acceleration", flight), np.ones(1), flight.time)
    np.testing.assert_allclose(found[:, 2], reaction, atol=1e-8)
    assert not found[:, [0, 1, 3, 4, 5]].any()
