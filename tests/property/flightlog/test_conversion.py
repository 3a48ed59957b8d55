import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cpfls_cli.flightlog.conversion import attitude_from_quaternion, attitude_to_enu_flu, body_to_flu, world_to_enu
from cpfls_cli.rotations import rotation_matrix

ANGLE = st.floats(-3.1, 3.1)
ATTITUDE = st.tuples(ANGLE, st.floats(-1.5, 1.5), ANGLE).map(lambda angles: np.array([angles]))
VECTOR = st.tuples(*[st.floats(-10, 10)] * 3).map(lambda entries: np.array([entries]))


@pytest.mark.parametrize("body", ["FLU", "FRD"])
@pytest.mark.parametrize("world", ["ENU", "NED"])
@given(attitude=ATTITUDE)
def test_converting_twice_gives_the_attitude_back(attitude, body, world):
    """Both changes of axes are their own inverses."""
    there_and_back = attitude_to_enu_flu(attitude_to_enu_flu(attitude, body, world), body, world)
    np.testing.assert_allclose(rotation_matrix(there_and_back), rotation_matrix(attitude), atol=1e-7)


@pytest.mark.parametrize("body", ["FLU", "FRD"])
@pytest.mark.parametrize("world", ["ENU", "NED"])
@given(attitude=ATTITUDE, vector=VECTOR)
def test_rotating_then_converting_is_converting_then_rotating(attitude, vector, body, world):
    by_scipy = Rotation.from_euler("ZYX", attitude[:, ::-1]).apply(vector)
    converted = rotation_matrix(attitude_to_enu_flu(attitude, body, world))[0] @ body_to_flu(vector, body)[0]
    np.testing.assert_allclose(converted, world_to_enu(by_scipy, world)[0], atol=1e-6)


@given(attitude=ATTITUDE, length=st.floats(0.1, 10), sign=st.sampled_from([-1, 1]))
def test_a_quaternion_of_any_length_and_sign_gives_its_attitude(attitude, length, sign):
    quaternion = sign * length * Rotation.from_euler("ZYX", attitude[:, ::-1]).as_quat()
    for order, entries in (("xyzw", quaternion), ("wxyz", quaternion[:, [3, 0, 1, 2]])):
        np.testing.assert_allclose(attitude_from_quaternion(entries, order), attitude, atol=1e-6)
