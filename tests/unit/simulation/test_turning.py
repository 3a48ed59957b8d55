"""A model in Euler coordinates turns a body as the same body does in its own axes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli import rotations
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.errors import SettingError
from cpfls_cli.regressor.regressor import InertiaValues
from cpfls_cli.simulation import SimulatedModel, simulated_effects, simulated_model
from cpfls_cli.simulation.turning import identified_turning, rigid_turning
from cpfls_cli.vehicle import VehicleSettings
from cpfls_cli.vehicle.rigid_body import inertia_matrix, inertia_matrix_gradient

INERTIA = np.array([[0.6, 0.02, -0.01], [0.02, 0.7, 0.03], [-0.01, 0.03, 1.2]])
angles = st.lists(st.floats(-1.2, 1.2), min_size=3, max_size=3).map(np.array)


class Rigid:
    def inertia(self, attitude):
        return InertiaValues(inertia_matrix(attitude, INERTIA), inertia_matrix_gradient(attitude, INERTIA))


class Warped:
    """An inertia that no rigid body has: it grows with the pitch."""

    def inertia(self, attitude):
        grown = (1 + attitude[:, 1] ** 2)[:, None, None] * np.eye(3)
        gradient = np.zeros((len(attitude), 3, 3, 3))
        gradient[:, 1] = 2 * attitude[:, 1, None, None] * np.eye(3)
        return InertiaValues(grown, gradient)


@given(angles, angles)
def test_rigid_body_in_both_coordinates(attitude, body_rate):
    own, other = rigid_turning(INERTIA)(attitude, body_rate), identified_turning(Rigid())(attitude, body_rate)
    np.testing.assert_allclose(other.inertia, own.inertia, atol=1e-12)
    np.testing.assert_allclose(other.direct, own.direct, atol=1e-12)


@given(angles, angles)
def test_kinetic_energy_grows_by_the_work_of_the_torque(attitude, body_rate):
    """Without a torque the energy ``1/2 qd^T J qd`` stays, by central differences along the motion."""
    own = identified_turning(Warped())(attitude, body_rate)
    turning = np.linalg.solve(own.inertia, -own.direct)
    rate = rotations.attitude_rate(attitude[None], body_rate[None])[0]

    def energy(step):
        q = (attitude + step * rate)[None]
        qd = rotations.attitude_rate(q, (body_rate + step * turning)[None])[0]
        return 0.5 * qd @ Warped().inertia(q).value[0] @ qd

    assert (energy(1e-5) - energy(-1e-5)) / 2e-5 == pytest.approx(0.0, abs=1e-5)


def test_errors_of_the_numbers_add_up_and_other_effects_are_flown_once():
    vehicle = VehicleSettings()
    model = simulated_model(None, {"parameter_error": {"inertia_x": 0.1}, "torque_bias": {"M_z": 0.1}}, vehicle)
    more = model.with_effects(
        simulated_effects({"parameter_error": {"inertia_x": 0.05, "thrust_scale": -0.1}}, vehicle)
    )
    values = more.effects.values("parameter_error")
    assert values["inertia_x"] == pytest.approx(0.15)
    assert values["thrust_scale"] == -0.1
    with pytest.raises(SettingError, match=r"has it already: M_x = 0, M_y = 0, M_z = 0\.1"):
        model.with_effects(simulated_effects({"torque_bias": {"M_z": 0.1}}, vehicle))


def test_effects_that_hide_the_speeds_are_refused_beside_a_shift_of_them():
    vehicle = VehicleSettings()
    shifted = simulated_model(None, {"channel_delay": {CATALOGUE["channel_delay"].shapes[0].name: 0.01}}, vehicle)
    with pytest.raises(SettingError, match="shifts measured rotor speeds"):
        shifted.with_effects(simulated_effects({"motor_lag": [0.05]}, vehicle))
    assert SimulatedModel().with_effects(shifted.effects) == shifted
