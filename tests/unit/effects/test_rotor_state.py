"""Ground effect and vertical descent: what changes the thrust of each rotor by where and how it moves."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.catalogue.vertical_descent import (
    descent_ratio,
    descent_state,
    induced_velocity,
    thrust_basis,
)
from cpfls_cli.effects.registry import CATALOGUE


def level(flight, height, roll=0.0):
    attitude = np.full_like(flight.attitude, [roll, 0.0, 0.0])
    return replace(flight, attitude=attitude, position=np.full_like(flight.position, [0.0, 0.0, height]))


def test_ground_effect_of_a_level_vehicle_is_cheeseman_and_bennett(columns, flight):
    near = level(flight, 0.25)
    found = columns("ground_effect", near, G=1.0).direct[:, 5, 0]
    np.testing.assert_allclose(found, near.thrust * (1 / (1 - (0.2 / (4 * 0.30)) ** 2) - 1))


def test_ground_levels_a_tilted_vehicle(columns, flight):
    hovering = replace(flight, rotor_speed=np.full_like(flight.rotor_speed, 348.0))
    torque = columns("ground_effect", level(hovering, 0.3, roll=0.2), G=2.0).direct[:, :3, 0]
    assert (torque[:, 0] < -0.01).all()
    np.testing.assert_allclose(torque[:, 1:], 0.0, atol=1e-12)


@pytest.mark.parametrize("height", [0.0, -0.2])
def test_ground_effect_at_most_doubles_the_thrust(columns, flight, height):
    on_ground = level(flight, height)
    found = columns("ground_effect", on_ground, G=16.0).direct[:, 5, 0]
    np.testing.assert_allclose(found, on_ground.thrust)


def sinking(flight, speed, sideways=0.0):
    still = replace(flight, body_rate=np.zeros_like(flight.body_rate), attitude=np.zeros_like(flight.attitude))
    return replace(still, velocity=np.full_like(flight.velocity, [sideways, 0.0, -speed]))


def test_induced_velocity_of_the_six_kilogram_craft(flight):
    np.testing.assert_allclose(induced_velocity(flight), 6.9, rtol=0.01)


@pytest.mark.parametrize(("speed", "ratio"), [(6.915, 1.0), (-3.0, 0.0), (30.0, 2.5)])
def test_ratio_counts_descent_only(flight, speed, ratio):
    np.testing.assert_allclose(descent_ratio(sinking(flight, speed)), ratio, rtol=2e-3)


@pytest.mark.parametrize(
    ("ratio", "state"),
    [(0.3, "normal working state"), (1.0, "vortex ring"), (1.8, "turbulent wake"), (2.3, "windmill brake")],
)
def test_states_have_names(ratio, state):
    assert descent_state(ratio) == state


def test_a_climb_changes_nothing_and_forward_speed_ends_the_effect(columns, flight):
    assert not columns("vertical_descent", sinking(flight, -5.0)).direct.any()
    here = columns("vertical_descent", sinking(flight, 7.0)).direct
    moving = columns("vertical_descent", sinking(flight, 7.0, sideways=14.0)).direct
    assert np.abs(moving).max() < 0.02 * np.abs(here).max()


def test_basis_spans_the_powers_and_is_far_from_alike():
    ratio = np.linspace(0.0, 2.5, 101)
    basis, powers = thrust_basis(ratio), ratio[:, None] ** np.arange(1, 5)
    exact = basis @ np.linalg.lstsq(basis, powers, rcond=None)[0]
    np.testing.assert_allclose(exact, powers, atol=1e-10)
    assert np.linalg.cond(basis) < 0.1 * np.linalg.cond(powers / np.linalg.norm(powers, axis=0))


def test_bounds_hold_the_curves_of_the_sources(vehicle):
    """Thrust over ratio as measured in flight and as computed; the two disagree in sign."""
    ratio = np.array([0.0, 0.5, 1.0, 1.2, 1.4, 1.6, 2.0])
    rising = np.array([1.0, 1.04, 1.07, 1.08, 1.11, 1.20, 1.70])
    falling = np.array([1.0, 1.01, 0.92, 0.82, 0.85, 0.91, 1.36])
    bounds = np.array([c.bounds(vehicle) for c in CATALOGUE["vertical_descent"].coefficients])
    for curve in (rising, falling):
        coefficients = np.linalg.lstsq(thrust_basis(ratio), curve - 1, rcond=None)[0]
        assert (bounds[:, 0] < coefficients).all()
        assert (coefficients < bounds[:, 1]).all()
