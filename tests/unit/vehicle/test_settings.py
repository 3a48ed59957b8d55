import pytest
from pydantic import TypeAdapter, ValidationError

from cpfls_cli.errors import SettingError
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings


@pytest.mark.parametrize(
    ("inertia", "message"),
    [
        ((0.6, 0.0, 1.2), "greater than 0"),
        ((0.6, 0.6, -1.2), "greater than 0"),
        ((1.0, 1.0, 1.0, 0.0, 0.0, 2.0), r"not positive definite \(smallest principal moment -1\)"),
        ((1.0, 1.0, 1.0, 1.0, 0.0, 0.0), "not positive definite"),
        ((float("nan"), 1.0, 1.0), "greater than 0"),
        ((1.0, 1.0, 1.0, 0.1), "3 moments"),
    ],
)
def test_inertia_that_no_body_has_is_refused(inertia, message):
    with pytest.raises(SettingError, match=message) as refusal:
        VehicleSettings(inertia_kg_m2=inertia)
    assert refusal.value.key == "inertia_kg_m2"


def test_the_radius_of_a_propeller_is_positive_or_not_known():
    read = TypeAdapter(RotorSettings).validate_json
    texts = ("{}", '{"radius_m": null}', '{"radius_m": 0.2}')
    assert [read(text).radius_m for text in texts] == [None, None, 0.2]
    with pytest.raises(ValidationError):
        read('{"radius_m": 0.0}')
