import numpy as np
import pytest

from cpfls_cli.errors import ComputationError
from cpfls_cli.vehicle.rotors import allocation_matrix, body_wrench, rotor_demand
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings

K, B, ARM = 121.5e-6, 2.7e-6, 0.3


def ring(count, spins):
    angles = 2 * np.pi * np.arange(count) / count
    return VehicleSettings(
        rotors=tuple(
            RotorSettings(position_m=(np.cos(angle), np.sin(angle), 0.0), spin=spin)
            for angle, spin in zip(angles, spins, strict=True)
        )
    )


def test_plus_layout_follows_the_hand_formulas():
    speed = np.random.default_rng(3).uniform(100, 900, (20, 4))
    w1, w2, w3, w4 = speed.T
    thrust, torque = body_wrench(VehicleSettings(), speed)
    np.testing.assert_allclose(thrust, K * (w1**2 + w2**2 + w3**2 + w4**2))
    np.testing.assert_allclose(torque[:, 0], ARM * K * (w4**2 - w2**2))
    np.testing.assert_allclose(torque[:, 1], ARM * K * (w3**2 - w1**2))
    np.testing.assert_allclose(torque[:, 2], B * (-(w1**2) + w2**2 - w3**2 + w4**2))


def test_cross_layout_follows_the_simulator_rotorpy():
    d, k, b = 0.1202081528, 5.57e-6, 1.36e-7
    hubs = [(d, d, -1), (d, -d, 1), (-d, -d, -1), (-d, d, 1)]
    rotors = tuple(
        RotorSettings(position_m=(x, y, 0.0), spin=spin, thrust_factor_n_s2=k, drag_factor_n_m_s2=b)
        for x, y, spin in hubs
    )
    expected = [
        [k, k, k, k],
        [k * d, -k * d, -k * d, k * d],
        [-k * d, -k * d, k * d, k * d],
        [b, -b, b, -b],
    ]
    np.testing.assert_allclose(allocation_matrix(VehicleSettings(rotors=rotors)), expected)


def test_demand_of_four_rotors_is_the_speed_that_was_flown():
    speed = np.random.default_rng(4).uniform(100, 900, (50, 4))
    wrench = body_wrench(VehicleSettings(), speed)
    demand = rotor_demand(VehicleSettings(), wrench.thrust, wrench.body_torque)
    np.testing.assert_allclose(demand.speed, speed, rtol=1e-12)
    assert demand.violations == ()


def test_demand_of_six_rotors_gives_the_wrench_with_the_smallest_norm():
    vehicle = ring(6, [1, -1, 1, -1, 1, -1])
    speed = np.random.default_rng(5).uniform(400, 500, (50, 6))
    wrench = body_wrench(vehicle, speed)
    demand = rotor_demand(vehicle, wrench.thrust, wrench.body_torque)
    again = body_wrench(vehicle, demand.speed)
    np.testing.assert_allclose(again.thrust, wrench.thrust, rtol=1e-12)
    np.testing.assert_allclose(again.body_torque, wrench.body_torque, atol=1e-11)
    least = np.linalg.lstsq(allocation_matrix(vehicle), np.column_stack(wrench).T, rcond=None)[0].T
    np.testing.assert_allclose(demand.squared_speed, least, rtol=1e-9)
    assert (np.linalg.norm(demand.squared_speed, axis=1) < np.linalg.norm(speed**2, axis=1)).all()


def test_what_rotors_cannot_do_is_reported_and_not_clipped():
    hover = 6 * 9.81
    thrust = np.full(5, hover)
    torque = np.zeros((5, 3))
    torque[1, 0] = 2 * hover * ARM
    torque[3, 0] = 3 * hover * ARM
    demand = rotor_demand(VehicleSettings(rotor_speed_max_rad_s=500.0), thrust, torque)
    squared_2, squared_4 = demand.squared_speed[3, [1, 3]]
    assert squared_2 == pytest.approx(hover / K * (1 / 4 - 3 / 2))
    assert squared_4 == pytest.approx(hover / K * (1 / 4 + 3 / 2))
    kinds = [(v.rotor, v.kind, v.first, v.last, v.count) for v in demand.violations]
    assert kinds == [(1, "negative squared speed", 1, 3, 2), (3, "above the limit", 1, 3, 2)]
    assert [v.worst for v in demand.violations] == [squared_2, squared_4]
    np.testing.assert_array_equal(np.isnan(demand.speed), [[False, n, False, n] for n in (0, 1, 0, 1, 0)])


def test_standing_still_and_the_limit_itself_are_no_violations():
    limit = body_wrench(VehicleSettings(), np.array([[0.0] * 4, [1000.0] * 4]))
    demand = rotor_demand(VehicleSettings(), limit.thrust, limit.body_torque)
    assert demand.violations == ()
    np.testing.assert_allclose(demand.speed, [[0.0] * 4, [1000.0] * 4])


@pytest.mark.parametrize(
    ("hubs", "missing"),
    [
        ([(1, 0, 1), (-1, 0, 1), (2, 0, -1), (-2, 0, -1)], "roll"),
        ([(0, 1, 1), (0, -1, 1), (0, 2, -1), (0, -2, -1)], "pitch"),
        ([(1, 0, 1), (0, 1, 1), (-1, 0, 1), (0, -1, 1)], "thrust, yaw"),
        ([(1, 1, 1), (-1, -1, -1)], "roll, pitch, yaw"),
    ],
)
def test_layouts_that_cannot_produce_a_wrench_are_refused(hubs, missing):
    rotors = tuple(RotorSettings(position_m=(float(x), float(y), 0.0), spin=spin) for x, y, spin in hubs)
    with pytest.raises(ComputationError, match=f"cannot produce {missing} independently"):
        rotor_demand(VehicleSettings(rotors=rotors), np.ones(1), np.zeros((1, 3)))


def test_a_wrench_that_is_not_finite_is_refused():
    with pytest.raises(ComputationError, match="not finite at sample 1"):
        rotor_demand(VehicleSettings(), np.ones(2), np.array([[0.0] * 3, [0.0, np.nan, 0.0]]))


def test_wrong_number_of_rotors_is_refused():
    with pytest.raises(ComputationError, match=r"rotor_speed: expected shape \(time, 4\), got \(1, 6\)"):
        body_wrench(VehicleSettings(), np.zeros((1, 6)))
