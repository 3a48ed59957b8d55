"""Effects as polynomials: equal to their columns wherever they are one, and refused where they are not."""

import numpy as np
import pytest

from cpfls_cli.effects.polynomial import STATE_TERMS, Probe, polynomial, rotor_terms, state_terms
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals
from cpfls_cli.vehicle.settings import VehicleSettings

VEHICLE = VehicleSettings()
POLYNOMIAL = {
    "linear_damping",
    "quadratic_damping",
    "rotor_plane_damping",
    "rotor_drag",
    "flapping_moment",
    "rolling_moment",
    "inflow",
    "translational_lift",
    "parasitic_drag",
    "rotor_gyroscopic",
    "rotor_acceleration",
    "com_offset",
    "rotor_mismatch",
    "torque_bias",
}


def signals(seed):
    rng = np.random.default_rng(seed)
    return Signals(
        time=np.arange(40.0),
        body_rate=rng.normal(size=(40, 3)),
        vehicle=VEHICLE,
        attitude=rng.uniform(-1.0, 1.0, (40, 3)),
        velocity=3.0 * rng.normal(size=(40, 3)),
        position=rng.normal(size=(40, 3)),
        rotor_speed=rng.uniform(200.0, 600.0, (40, 4)),
    )


def test_the_catalogue_falls_into_polynomials_and_others():
    probe = Probe.of(VEHICLE)
    shapeless = {name: known for name, known in CATALOGUE.items() if not known.shapes}
    assert {name for name, known in shapeless.items() if polynomial(known, probe, {}) is not None} == POLYNOMIAL


@pytest.mark.parametrize("name", sorted(POLYNOMIAL - {"rotor_acceleration"}))
def test_a_polynomial_equals_the_columns_at_motions_that_it_was_not_found_from(name):
    flight = signals(7)
    weights = polynomial(CATALOGUE[name], Probe.of(VEHICLE), {})
    rotor = rotor_terms(flight.speed, np.zeros_like(flight.speed))
    found = np.einsum("ckau,ta,tu->tkc", weights, state_terms(flight.air_velocity, flight.body_rate), rotor)
    columns = CATALOGUE[name].columns(flight, {}).direct
    assert found == pytest.approx(columns, rel=1e-9, abs=1e-9 * np.abs(columns).max())


def test_a_momentum_of_the_rotors_becomes_a_torque_of_their_acceleration():
    weights = polynomial(CATALOGUE["rotor_acceleration"], Probe.of(VEHICLE), {})
    spins = [rotor.spin for rotor in VEHICLE.rotors]
    expected = np.zeros_like(weights)
    expected[0, 2, STATE_TERMS.index("1"), 9:] = -np.array(spins)
    assert weights == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("name", ["products_of_inertia", "euler_axis_torque", "parameter_error", "gyro_bias"])
def test_what_is_no_wrench_of_rotors_and_motion_is_none(name):
    assert polynomial(CATALOGUE[name], Probe.of(VEHICLE), {}) is None
