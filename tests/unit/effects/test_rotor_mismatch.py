"""Rotors that differ, against rotors whose factors are different."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.catalogue.rotor_mismatch import gains
from cpfls_cli.vehicle.rotors import body_wrench, gain_modes, opposite_pairs
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings


def with_gains(vehicle, thrust, drag=(0.0,) * 4):
    factors = zip(vehicle.rotors, thrust, drag, strict=True)
    rotors = (
        replace(
            rotor,
            thrust_factor_n_s2=rotor.thrust_factor_n_s2 * (1 + kappa),
            drag_factor_n_m_s2=rotor.drag_factor_n_m_s2 * (1 + delta),
        )
        for rotor, kappa, delta in factors
    )
    return replace(vehicle, rotors=tuple(rotors))


def circle(number):
    angles = 2 * np.pi * np.arange(number) / number
    return VehicleSettings(
        rotors=tuple(
            RotorSettings(position_m=(0.3 * np.cos(angle), 0.3 * np.sin(angle), 0.0), spin=1 - 2 * (index % 2))
            for index, angle in enumerate(angles)
        )
    )


def test_columns_are_what_other_factors_do(columns, flight):
    true = with_gains(flight.vehicle, [0.05, -0.03, -0.05, 0.03], [-0.05, 0.07, -0.15, 0.13])
    change = body_wrench(true, flight.rotor_speed).body_torque - flight.torque
    found = columns("rotor_mismatch", flight).direct @ [0.1, -0.06, 0.1, 0.0]
    np.testing.assert_allclose(found[:, :3], change, atol=1e-12)
    np.testing.assert_allclose(found[:, 5], body_wrench(true, flight.rotor_speed).thrust - flight.thrust, atol=1e-9)


def test_what_one_spin_lifts_more_shows_in_force_only(columns, flight):
    """In torque it is a wrong Ixx and a wrong Iyy of opposite signs, which the inertia columns hold already."""
    true = body_wrench(with_gains(flight.vehicle, [0.05, -0.05, 0.05, -0.05]), flight.rotor_speed)
    found = columns("rotor_mismatch", flight).direct[..., 3] * 0.05
    np.testing.assert_allclose(found[:, 5], true.thrust - flight.thrust, atol=1e-9)
    assert not found[:, :5].any()
    np.testing.assert_allclose(true.body_torque - flight.torque, flight.torque * [-0.05, 0.05, 0.0], atol=1e-12)


def test_pairs_face_each_other_and_spin_alike(vehicle):
    assert opposite_pairs(vehicle) == ((0, 2), (1, 3))
    assert opposite_pairs(circle(6)) == ()
    beside = (
        replace(rotor, position_m=(rotor.position_m[0] + 0.01, *rotor.position_m[1:])) for rotor in vehicle.rotors
    )
    assert opposite_pairs(replace(vehicle, rotors=tuple(beside))) == ((0, 2), (1, 3))


@pytest.mark.parametrize("number", [4, 6, 8])
def test_nothing_that_an_inertia_could_stand_in_for_is_left(number):
    modes = gain_modes(circle(number))
    spins = np.array([rotor.spin for rotor in circle(number).rotors])
    np.testing.assert_allclose(modes.T @ np.column_stack([np.ones(number), spins]), 0.0, atol=1e-12)
    assert np.linalg.matrix_rank(modes) == 2


def test_the_weaker_rotor_is_blamed(vehicle):
    np.testing.assert_allclose(gains(vehicle, np.array([0.06, -0.1])), [0.0, -0.1, -0.06, 0.0])
