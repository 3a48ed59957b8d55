import numpy as np

from cpfls_cli.vehicle.rotors import allocation_matrix, rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings

# Table 3 of the paper, the vehicle that every default study flies.
GRAVITY, MASS, ARM, K, B = 9.81, 6.0, 0.3, 121.5e-6, 2.7e-6


def test_default_vehicle_is_table_3():
    vehicle = VehicleSettings()
    assert (vehicle.gravity_m_s2, vehicle.mass_kg) == (GRAVITY, MASS)
    assert vehicle.inertia_kg_m2 == (0.6, 0.6, 1.2)
    expected = [
        [K, K, K, K],
        [0, -ARM * K, 0, ARM * K],
        [-ARM * K, 0, ARM * K, 0],
        [-B, B, -B, B],
    ]
    np.testing.assert_allclose(allocation_matrix(vehicle), expected, atol=1e-20)


def test_hover_speed():
    # sqrt(m g / (4 k)), worked by hand.
    demand = rotor_demand(VehicleSettings(), np.array([MASS * GRAVITY]), np.zeros((1, 3)))
    np.testing.assert_allclose(demand.speed, 348.0102, rtol=1e-6)
