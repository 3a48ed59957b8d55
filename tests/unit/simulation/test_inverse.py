"""Inverse dynamics: torques and rotor speeds of planned motions, vehicles that are held, and what a vehicle can fly."""

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from cpfls_cli import rotations
from cpfls_cli.errors import SettingError
from cpfls_cli.simulation.inverse import collective_thrust, flyability, simulate, single_axis_torque
from cpfls_cli.simulation.settings import SimulationSettings
from cpfls_cli.trajectory.planning import plan
from cpfls_cli.trajectory.settings import TrajectorySettings
from cpfls_cli.vehicle.rotors import allocation_matrix, body_wrench
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings

VEHICLE = VehicleSettings(inertia_kg_m2=(0.6, 0.7, 1.2, 0.02, -0.03, 0.01))
TENSOR = np.array([[0.6, 0.02, -0.03], [0.02, 0.7, 0.01], [-0.03, 0.01, 1.2]])
AMPLITUDE, FREQUENCY, PHASE = np.array([0.2, 0.15, 0.5]), np.array([1.1, 1.7, 0.6]), np.array([0.3, 1.0, 2.0])
STEP = 1e-3
RATE = np.array([2.0, 1.5, 0.7])
PLANNED = ("attitude", "attitude_rate", "attitude_acceleration", "acceleration")


def attitude_at(time):
    return AMPLITUDE * np.sin(np.outer(time, FREQUENCY) + PHASE)


def planned(samples=300):
    time = 0.02 * np.arange(samples)
    phase = np.outer(time, FREQUENCY) + PHASE
    attitude = attitude_at(time)
    swing = np.column_stack([np.sin(time), np.cos(2 * time), 0.5 * np.sin(time)])
    return {
        "attitude": attitude,
        "attitude_rate": AMPLITUDE * FREQUENCY * np.cos(phase),
        "attitude_acceleration": -(FREQUENCY**2) * attitude,
        "position": -swing,
        "velocity": np.gradient(-swing, time, axis=0),
        "acceleration": swing,
    }


def flown(motion=None, vehicle=VEHICLE, seed=30, **settings):
    motion = planned() if motion is None else motion
    return simulate(
        0.01 * np.arange(len(motion["attitude"])),
        motion,
        vehicle,
        SimulationSettings(**settings),
        np.random.default_rng(seed),
    )


def orientation(time):
    return Rotation.from_euler("ZYX", attitude_at(time)[:, ::-1])


def angular_momentum(time):
    """In the world frame, the body rate from rotations a little before and after."""
    turn = orientation(time - STEP).inv() * orientation(time + STEP)
    return orientation(time).apply(turn.as_rotvec() / (2 * STEP) @ TENSOR)


def test_body_torque_is_the_change_of_angular_momentum():
    time = 0.02 * np.arange(300)
    change = (angular_momentum(time + STEP) - angular_momentum(time - STEP)) / (2 * STEP)
    expected = orientation(time).inv().apply(change)
    np.testing.assert_allclose(flown().signals["body_torque"], expected, atol=1e-5 * np.abs(expected).max())


def test_work_of_the_torque_is_the_change_of_rotational_energy():
    signals, time = flown().signals, 0.02 * np.arange(300)
    power = np.sum(signals["torque"] * signals["attitude_rate"], axis=1)
    energy = 0.5 * np.einsum("ni,ij,nj->n", signals["body_rate"], TENSOR, signals["body_rate"])
    assert trapezoid(power, time) == pytest.approx(energy[-1] - energy[0], abs=1e-4 * np.ptp(energy))


def test_rotors_give_back_the_torque_and_the_weight():
    flight = flown()
    wrench = body_wrench(VEHICLE, flight.signals["rotor_speed"])
    np.testing.assert_allclose(wrench.body_torque, flight.signals["body_torque"], atol=1e-9)
    force = planned()["acceleration"] + np.array([0, 0, 9.81])
    np.testing.assert_allclose(wrench.thrust, 6.0 * np.linalg.norm(force, axis=1), rtol=1e-12)
    assert (flight.infeasible, flight.noise_std) == ((), {})


def test_planned_signals_pass_unchanged_without_noise():
    flight = flown()
    for name, values in planned().items():
        np.testing.assert_array_equal(flight.signals[name], values)


def test_noise_has_the_standard_deviation_that_was_asked_for():
    clean, noisy = flown(planned(4000)), flown(planned(4000), noise={"torque": 0.3, "attitude": 0.01})
    assert set(noisy.noise_std) == {"torque", "attitude"}
    np.testing.assert_array_equal(noisy.noise_std["torque"].std, [0.3] * 3)
    for name, std in (("torque", 0.3), ("attitude", 0.01)):
        noise = noisy.signals[name] - clean.signals[name]
        # The standard deviation of 4000 samples scatters by 1.1 %.
        np.testing.assert_allclose(noise.std(axis=0), std, rtol=0.05)
        np.testing.assert_allclose(noise.mean(axis=0), 0.0, atol=5 * std / np.sqrt(4000))
        np.testing.assert_allclose(np.corrcoef(noise.T), np.eye(3), atol=0.08)
    for name in ("attitude_rate", "attitude_acceleration", "position", "rotor_speed"):
        np.testing.assert_array_equal(noisy.signals[name], clean.signals[name])


def test_relative_noise_is_a_share_of_each_channel():
    clean = flown(planned(4000))
    noisy = flown(planned(4000), relative_noise={"torque": 0.05})
    own = clean.signals["torque"].std(axis=0)
    assert own.max() > 1.5 * own.min()
    np.testing.assert_allclose(noisy.noise_std["torque"].std, 0.05 * own, rtol=1e-12)
    noise = noisy.signals["torque"] - clean.signals["torque"]
    np.testing.assert_allclose(noise.std(axis=0), 0.05 * own, rtol=0.05)


def test_absolute_and_relative_noise_add_as_independent_ones():
    own = flown().signals["torque"].std(axis=0)
    both = flown(noise={"torque": 0.3}, relative_noise={"torque": 0.4})
    np.testing.assert_allclose(both.noise_std["torque"].std, np.sqrt(0.09 + (0.4 * own) ** 2), rtol=1e-12)


def test_body_signals_follow_from_the_noisy_ones():
    noisy = flown(noise={"torque": 0.3, "attitude": 0.05, "attitude_rate": 0.1}).signals
    W = rotations.euler_rate_matrix(noisy["attitude"])
    expected = np.linalg.solve(W.swapaxes(1, 2), noisy["torque"][:, :, None])[:, :, 0]
    np.testing.assert_allclose(noisy["body_torque"], expected, atol=1e-11)
    np.testing.assert_allclose(noisy["body_rate"], rotations.multiply(W, noisy["attitude_rate"]), atol=1e-13)


def test_noise_comes_from_the_given_generator():
    first, same, other = (flown(seed=seed, noise={"torque": 0.1}).signals["torque"] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, same)
    assert not np.array_equal(first, other)


def test_what_no_rotor_can_do_is_reported_and_left_out():
    flight = flown(vehicle=VehicleSettings(rotor_speed_max_rad_s=348.5))
    speed = flight.signals["rotor_speed"]
    assert {one.kind for one in flight.infeasible} == {"above the limit"}
    for one in flight.infeasible:
        gaps = np.flatnonzero(np.isnan(speed[:, one.rotor - 1]))
        assert (one.first_s, one.last_s, one.samples) == (*flight.time[gaps[[0, -1]]], len(gaps))
    assert np.nanmax(speed) <= 348.5
    assert np.isfinite(flight.signals["torque"]).all()


def test_relative_noise_on_a_rotor_that_can_never_turn_so_fast():
    """No sample is left to take a standard deviation from; that must not raise a warning."""
    flight = flown(vehicle=VehicleSettings(rotor_speed_max_rad_s=10.0), relative_noise={"rotor_speed": 0.1})
    assert np.isnan(flight.signals["rotor_speed"]).all()


def turning(samples=500):
    """Three constant Euler rates; the second sample has a pitch of exactly 90 degrees."""
    attitude = np.outer(0.02 * np.arange(samples), RATE)
    attitude[1, 1] = 0.5 * np.pi
    zero = np.zeros((samples, 3))
    return {"attitude": attitude, "attitude_rate": zero + RATE, "attitude_acceleration": zero}


def held(vehicle=None, **settings):
    vehicle = vehicle or VehicleSettings()
    return simulate(0.02 * np.arange(500), turning(), vehicle, SimulationSettings(**settings), np.random.default_rng(3))


def test_flight_of_a_held_vehicle_has_no_translation():
    assert set(held().signals) == {
        *("time", "attitude", "attitude_rate", "attitude_acceleration"),
        *("torque", "body_torque", "body_rate", "rotor_speed"),
    }


def test_torques_are_finite_and_agree_through_a_vertical_pitch():
    signals = held().signals
    assert np.isfinite(signals["body_torque"]).all()
    generalised = rotations.generalised_torque(signals["attitude"], signals["body_torque"])
    np.testing.assert_allclose(signals["torque"], generalised, atol=1e-12)


def test_noise_of_the_body_torque_goes_into_the_generalised_one():
    signals = held(noise={"body_torque": 0.2}).signals
    assert (signals["body_torque"] - held().signals["body_torque"]).std() == pytest.approx(0.2, rel=0.1)
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


def test_a_held_vehicle_needs_no_thrust_and_its_rotors_give_its_torque():
    assert collective_thrust(VehicleSettings(), np.zeros((3, 3)), None).max() == 0.0
    vehicle = VehicleSettings(inertia_kg_m2=(0.06, 0.05, 0.08))
    signals = held(vehicle).signals
    given = body_wrench(vehicle, signals["rotor_speed"]).body_torque
    np.testing.assert_allclose(given, signals["body_torque"], atol=1e-9)


def asked(vehicle, tilt_max=None, **settings):
    straight = {"path": "straight", "direction": (0.0, 0.0, 1.0), "legs": 1, "duration_s": 16.0, "yaw_turn_rad": 0.0}
    trajectory = plan(TrajectorySettings(**(straight | settings)), vehicle.gravity_m_s2)
    return flyability({name: getattr(trajectory, name) for name in ("time", *PLANNED)}, vehicle, tilt_max), trajectory


def test_thrust_carries_and_accelerates_the_mass():
    found, trajectory = asked(VehicleSettings())
    np.testing.assert_allclose(found.thrust, 6.0 * (9.81 + trajectory.acceleration[:, 2]), rtol=1e-12)
    assert (found.too_much, found.rotors, found.tilt.max()) == ((), (), 0.0)


def test_too_much_thrust_is_said_with_its_time():
    # Climbs with 2 m/s^2 at 4 s; four rotors of 121.5e-6 N s^2 give 6 kg * (9.81 + 1) m/s^2 at 365.2 rad/s.
    found, trajectory = asked(VehicleSettings(rotor_speed_max_rad_s=np.sqrt(6 * 10.81 / (4 * 121.5e-6))))
    (thrust,) = found.too_much
    assert (thrust.limit, thrust.worst) == (pytest.approx(6 * 10.81), pytest.approx(6 * 11.81, rel=1e-9))
    assert trajectory.time[thrust.at] == pytest.approx(4.0)
    beyond = np.flatnonzero(trajectory.acceleration[:, 2] > 1.0)
    assert (thrust.first, thrust.count) == (beyond[0], len(beyond))
    assert {violation.kind for violation in found.rotors} == {"above the limit"}
    assert len(found.rotors) == 4


def test_tilt_is_that_of_the_thrust():
    found, trajectory = asked(VehicleSettings(), tilt_max=0.1, direction=(1.0, 0.0, 0.0))
    np.testing.assert_allclose(found.tilt, np.arctan(np.abs(trajectory.acceleration[:, 0]) / 9.81), atol=1e-9)
    (tilt,) = found.too_much
    assert (tilt.what, tilt.worst) == ("tilt, rad", pytest.approx(np.arctan(2 / 9.81), rel=1e-9))


def test_a_held_vehicle_has_its_thrust_free():
    time = np.linspace(0, 3, 50)
    zero = np.zeros((50, 3))
    motion = {"attitude": np.outer(time, [2.0, 0, 0]), "attitude_rate": zero + np.array([2.0, 0, 0])}
    found = flyability({"time": time, **motion, "attitude_acceleration": zero}, VehicleSettings(), None)
    np.testing.assert_array_equal(found.thrust, 0.0)
    assert found.tilt.max() > 3.0


def test_torque_about_one_axis_is_what_half_the_rotors_give_at_full_speed():
    full = 121.5e-6 * 1000.0**2
    expected = [0.3 * full, 0.3 * full, 2 * 2.7e-6 * 1000.0**2]
    np.testing.assert_allclose(single_axis_torque(VehicleSettings()), expected, rtol=1e-12)
