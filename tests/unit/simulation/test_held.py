"""A vehicle held at its centre of mass, through attitudes that no multirotor flies."""

import numpy as np
import pytest
from scipy.optimize import linprog

from cpfls_cli import rotations
from cpfls_cli.errors import SettingError
from cpfls_cli.simulation import SimulationSettings, simulate
from cpfls_cli.simulation.inverse import collective_thrust
from cpfls_cli.vehicle import RotorSettings, VehicleSettings, allocation_matrix, body_wrench

RATE = np.array([2.0, 1.5, 0.7])


def turning(samples=500):
    """Three constant Euler rates; the second sample has a pitch of exactly 90 degrees."""
    time = 0.02 * np.arange(samples)
    attitude = np.outer(time, RATE)
    attitude[1, 1] = 0.5 * np.pi
    zero = np.zeros((samples, 3))
    return {"attitude": attitude, "attitude_rate": zero + RATE, "attitude_acceleration": zero}


def held(vehicle=None, **settings):
    vehicle = vehicle or VehicleSettings()
    return simulate(turning(), vehicle, SimulationSettings(**settings), np.random.default_rng(3))


def test_flight_of_a_held_vehicle_has_no_translation():
    assert set(held().signals) == {
        *("attitude", "attitude_rate", "attitude_acceleration", "torque", "body_torque", "body_rate", "rotor_speed")
    }


def test_torques_are_finite_and_agree_through_a_vertical_pitch():
    signals = held().signals
    assert np.isfinite(signals["body_torque"]).all()
    generalised = rotations.generalised_torque(signals["attitude"], signals["body_torque"])
    np.testing.assert_allclose(signals["torque"], generalised, atol=1e-12)


def test_noise_of_the_body_torque_goes_into_the_generalised_one():
    signals = held(noise={"body_torque": 0.2}).signals
    clean = held().signals
    assert (signals["body_torque"] - clean["body_torque"]).std() == pytest.approx(0.2, rel=0.1)
    generalised = rotations.generalised_torque(signals["attitude"], signals["body_torque"])
    np.testing.assert_allclose(signals["torque"], generalised, atol=1e-12)


@pytest.mark.parametrize("mode", ["inverse", "closed-loop"])
def test_noise_of_both_torques_is_refused(mode):
    with pytest.raises(SettingError, match="one follows from the other"):
        SimulationSettings(mode=mode, noise={"torque": 0.1}, relative_noise={"body_torque": 0.1})


def test_closed_loop_has_no_noise_of_the_body_torque():
    with pytest.raises(SettingError, match="in mode closed-loop it follows from torque"):
        SimulationSettings(mode="closed-loop", noise={"body_torque": 0.1})


HEXAROTOR = VehicleSettings(
    rotors=tuple(
        RotorSettings(position_m=(np.cos(angle), np.sin(angle), 0.0), spin=1 if index % 2 else -1)
        for index, angle in enumerate(np.arange(6) * np.pi / 3)
    )
)


@pytest.mark.parametrize("vehicle", [VehicleSettings(), HEXAROTOR], ids=["quadrotor", "hexarotor"])
def test_collective_thrust_is_the_least_that_turns_every_rotor_forwards(vehicle):
    torque = np.random.default_rng(4).normal(size=(20, 3)) * [2.0, 2.0, 0.3]
    thrust = collective_thrust(vehicle, torque, None)
    inverse = np.linalg.pinv(allocation_matrix(vehicle))
    for wanted, found in zip(torque, thrust, strict=True):
        # Least T with inverse @ (T, torque) >= 0, by linear programming.
        least = linprog([1.0], A_ub=-inverse[:, :1], b_ub=inverse[:, 1:] @ wanted, bounds=[(0, None)])
        assert found == pytest.approx(least.x[0], rel=1e-9)


def test_a_held_vehicle_that_does_not_turn_needs_no_thrust():
    assert collective_thrust(VehicleSettings(), np.zeros((3, 3)), None).max() == 0.0


def test_rotors_of_a_held_vehicle_give_its_torque():
    vehicle = VehicleSettings(inertia_kg_m2=(0.06, 0.05, 0.08))
    signals = held(vehicle).signals
    given = body_wrench(vehicle, signals["rotor_speed"]).body_torque
    np.testing.assert_allclose(given, signals["body_torque"], atol=1e-9)
