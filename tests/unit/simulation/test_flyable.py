"""What a path asks of a vehicle, against the vehicle's own numbers."""

import numpy as np
import pytest

from cpfls_cli.simulation import flyability
from cpfls_cli.simulation.inverse import single_axis_torque
from cpfls_cli.trajectory import TrajectorySettings, plan
from cpfls_cli.vehicle import VehicleSettings

PLANNED = ("attitude", "attitude_rate", "attitude_acceleration", "acceleration")


def asked(vehicle, tilt_max=None, **settings):
    straight = {"path": "straight", "direction": (0.0, 0.0, 1.0), "legs": 1, "duration_s": 16.0, "yaw_turn_rad": 0.0}
    trajectory = plan(TrajectorySettings(**(straight | settings)), vehicle.gravity_m_s2)
    return flyability({name: getattr(trajectory, name) for name in PLANNED}, vehicle, tilt_max), trajectory


def test_thrust_carries_and_accelerates_the_mass():
    found, trajectory = asked(VehicleSettings())
    np.testing.assert_allclose(found.thrust, 6.0 * (9.81 + trajectory.acceleration[:, 2]), rtol=1e-12)
    assert found.too_much == ()
    assert found.rotors == ()
    assert found.tilt.max() == 0.0


def test_too_much_thrust_is_told_with_its_time():
    # Climbs with 2 m/s^2 at 4 s; four rotors of 121.5e-6 N s^2 give 6 kg * (9.81 + 1) m/s^2 at 365.2 rad/s.
    vehicle = VehicleSettings(rotor_speed_max_rad_s=np.sqrt(6 * 10.81 / (4 * 121.5e-6)))
    found, trajectory = asked(vehicle)
    (thrust,) = found.too_much
    assert thrust.limit == pytest.approx(6 * 10.81)
    assert thrust.worst == pytest.approx(6 * 11.81, rel=1e-9)
    assert trajectory.time[thrust.at] == pytest.approx(4.0)
    beyond = np.flatnonzero(trajectory.acceleration[:, 2] > 1.0)
    assert (thrust.first, thrust.count) == (beyond[0], len(beyond))
    assert {violation.kind for violation in found.rotors} == {"above the limit"}
    assert len(found.rotors) == 4


def test_tilt_is_that_of_the_thrust():
    found, trajectory = asked(VehicleSettings(), tilt_max=0.1, direction=(1.0, 0.0, 0.0))
    np.testing.assert_allclose(found.tilt, np.arctan(np.abs(trajectory.acceleration[:, 0]) / 9.81), atol=1e-9)
    (tilt,) = found.too_much
    assert tilt.what == "tilt, rad"
    assert tilt.worst == pytest.approx(np.arctan(2 / 9.81), rel=1e-9)


def test_a_held_vehicle_has_its_thrust_free():
    time = np.linspace(0, 3, 50)
    zero = np.zeros((50, 3))
    motion = {"attitude": np.outer(time, [2.0, 0, 0]), "attitude_rate": zero + np.array([2.0, 0, 0])}
    found = flyability({**motion, "attitude_acceleration": zero}, VehicleSettings(), None)
    np.testing.assert_array_equal(found.thrust, 0.0)
    assert found.tilt.max() > 3.0


def test_torque_about_one_axis_is_what_half_the_rotors_give_at_full_speed():
    full = 121.5e-6 * 1000.0**2
    expected = [0.3 * full, 0.3 * full, 2 * 2.7e-6 * 1000.0**2]
    np.testing.assert_allclose(single_axis_torque(VehicleSettings()), expected, rtol=1e-12)
