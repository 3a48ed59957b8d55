import pytest

from tests.builders import gap_artifacts as made


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"alone": [("torque_bias", 0.9)]}, True),
        ({"alone": [("com_offset", 0.9)]}, False),
        ({"alone": [("torque_bias", 0.9)], "force": False}, False),
        ({"alone": [("torque_bias", 0.9)], "named": ({"name": "gyro_bias", "kind": "sensor"},)}, False),
        ({}, False),
    ],
)
def test_two_names_are_explained_only_where_the_forces_decided(given, said):
    assert made.diagnosis(**given).forces_decide is said
