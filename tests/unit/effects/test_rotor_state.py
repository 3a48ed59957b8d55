"""Ground effect and vertical descent: what changes the thrust of each rotor by where and how it moves."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import interp1d

from cpfls_cli.effects.catalogue.vertical_descent import (
    descent_state,
    induced_velocity,
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
    np.testing.assert_allclose(induced_velocity(flight.instants), 6.9, rtol=0.01)


@pytest.mark.parametrize(("speed", "knot"), [(6.915, 1), (-3.0, None), (30.0, 5)])
def test_ratio_counts_descent_only_up_to_the_last_knot(columns, flight, speed, knot):
    falling = sinking(flight, speed)
    share = columns("vertical_descent", falling, sideways=1.0).direct[:, 5] / falling.thrust[:, None]
    np.testing.assert_allclose(share, np.tile(np.eye(6)[knot] if knot else np.zeros(6), (len(falling), 1)), atol=5e-3)


@pytest.mark.parametrize(
    ("ratio", "state"),
    [(0.3, "normal working state"), (1.0, "vortex ring"), (1.8, "turbulent wake"), (2.3, "windmill brake")],
)
def test_states_have_names(ratio, state):
    assert descent_state(ratio) == state


def test_a_climb_changes_nothing_and_forward_speed_ends_the_effect(columns, flight):
    assert not columns("vertical_descent", sinking(flight, -5.0), sideways=1.0).direct.any()
    here = columns("vertical_descent", sinking(flight, 7.0), sideways=1.0).direct
    induced = induced_velocity(flight.instants).mean()
    moving = columns("vertical_descent", sinking(flight, 7.0, 0.7 * induced), sideways=0.7).direct
    np.testing.assert_allclose(moving, here / np.e, atol=1e-12)
    gone = columns("vertical_descent", sinking(flight, 7.0, 2.1 * induced), sideways=0.7).direct
    assert np.abs(gone).max() < 2e-4 * np.abs(here).max()


def test_thrust_follows_a_table_of_any_curve_between_its_knots(columns, flight):
    """What six coefficients say is what an interpolator makes of the curve at the knots, rotor by rotor."""
    knots, curve = [0.0, 0.5, 1.0, 1.25, 1.6, 2.0, 2.5], [0.0, 0.02, -0.1, -0.2, -0.1, 0.3, 0.6]
    fast = replace(flight, velocity=flight.velocity * [0.2, 0.2, 3.0] - [0.0, 0.0, 3.0])
    induced = induced_velocity(fast.instants)[:, 0]
    sideways = np.linalg.norm(fast.hub_velocity[..., :2], axis=2) / induced
    share = interp1d(knots, curve)(np.clip(-fast.hub_velocity[..., 2] / induced, 0.0, 2.5))
    thrust = fast.rotor_thrust * share * np.exp(-(sideways**2))
    found = columns("vertical_descent", fast, sideways=1.0).direct @ curve[1:]
    np.testing.assert_allclose(found[:, 5], thrust.sum(axis=1), atol=1e-10)
    np.testing.assert_allclose(found[:, 0], thrust @ fast.hubs[:, 1], atol=1e-10)
    np.testing.assert_allclose(found[:, 1], -thrust @ fast.hubs[:, 0], atol=1e-10)


def test_scatter_is_the_variance_of_thrusts_that_shake_by_themselves(flight):
    size, draws = 0.07, 20000
    for k, speed in ((0, 7.0), (300, 9.0)):
        falling = sinking(flight, speed)
        found = CATALOGUE["vertical_descent"].scatter(falling, {"sideways": 1.0})[k]
        shaking = size * np.random.default_rng(k).standard_normal((draws, 4)) * falling.rotor_thrust[k]
        force = np.zeros((draws, 4, 3))
        force[..., 2] = shaking
        torque = np.cross(falling.hubs, force).sum(axis=1)
        np.testing.assert_allclose(size**2 * found[:3], torque.var(axis=0), rtol=0.05)
        np.testing.assert_allclose(size**2 * found[3:], force.sum(axis=1).var(axis=0), rtol=0.05)


@pytest.mark.parametrize("speed", [-3.0, 2.0, 14.0])
def test_rotors_do_not_shake_outside_the_vortex_ring(flight, speed):
    assert not CATALOGUE["vertical_descent"].scatter(sinking(flight, speed), {"sideways": 1.0}).any()


def test_bounds_hold_the_curves_of_the_sources(vehicle):
    """Thrust over ratio as measured in flight and as computed; the two disagree in sign."""
    knots = [0.0, 0.5, 1.0, 1.25, 1.6, 2.0, 2.5]
    ratio = np.array([0.0, 0.5, 1.0, 1.2, 1.4, 1.6, 2.0])
    rising = np.array([1.0, 1.04, 1.07, 1.08, 1.11, 1.20, 1.70])
    falling = np.array([1.0, 1.01, 0.92, 0.82, 0.85, 0.91, 1.36])
    bounds = np.array([c.bounds(vehicle) for c in CATALOGUE["vertical_descent"].coefficients])
    for curve in (rising, falling):
        hats = np.array([np.interp(ratio, knots, unit) for unit in np.eye(len(knots))[1:]]).T
        coefficients = np.linalg.lstsq(hats, curve - 1, rcond=None)[0]
        assert (bounds[:, 0] < coefficients).all()
        assert (coefficients < bounds[:, 1]).all()
