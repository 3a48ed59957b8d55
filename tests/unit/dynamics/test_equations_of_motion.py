"""A model in Euler coordinates turns a body as the same body does in its own axes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli import rotations
from cpfls_cli.dynamics import inertia_matrix, inertia_matrix_gradient, turning_law
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.regressor import InertiaValues

PARAMETERS = np.array([0.6, 0.7, 1.2, 0.02, -0.01, 0.03])
INERTIA = symmetric(PARAMETERS)
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
    own, other = (turning_law(each)(attitude[None], body_rate[None]) for each in (PARAMETERS, Rigid()))
    np.testing.assert_allclose(other.inertia, own.inertia, atol=1e-12)
    np.testing.assert_allclose(other.direct, own.direct, atol=1e-12)


@given(angles, angles)
def test_kinetic_energy_grows_by_the_work_of_the_torque(attitude, body_rate):
    """Without a torque the energy ``1/2 qd^T J qd`` stays, by central differences along the motion."""
    (turning,) = turning_law(Warped())(attitude[None], body_rate[None]).acceleration(np.zeros((1, 3)))
    rate = rotations.attitude_rate(attitude[None], body_rate[None])[0]

    def energy(step):
        q = (attitude + step * rate)[None]
        qd = rotations.attitude_rate(q, (body_rate + step * turning)[None])[0]
        return 0.5 * qd @ Warped().inertia(q).value[0] @ qd

    assert (energy(1e-5) - energy(-1e-5)) / 2e-5 == pytest.approx(0.0, abs=1e-5)
