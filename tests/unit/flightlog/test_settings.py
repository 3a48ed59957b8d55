import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from cpfls_cli.errors import SettingError
from cpfls_cli.flightlog.settings import ImportSettings, SignalMap

ATTITUDE = SignalMap(columns=("a", "b", "c"), unit="deg")
TORQUE = SignalMap(columns=("l", "m", "n"), unit="N m")
ROTORS = SignalMap(columns=("r1", "r2", "r3", "r4"), unit="rpm")


def test_every_key_of_the_section_has_a_default():
    assert ImportSettings().signals == {}


@pytest.mark.parametrize(
    ("key", "settings"),
    [
        ("crop_s", {"crop_s": (2.0, 1.0)}),
        ("signals.body_rate.unit", {"signals": {"body_rate": ATTITUDE, "body_torque": TORQUE}}),
        ("signals.attitude.columns", {"signals": {"attitude": SignalMap(columns=("a",), unit="deg")}}),
        ("signals", {"signals": {"torque": TORQUE}}),
        ("signals", {"signals": {"torque": TORQUE, "body_torque": TORQUE, "attitude": ATTITUDE}}),
        ("torque_source", {"signals": {"attitude": ATTITUDE}}),
        ("torque_source", {"signals": {"rotor_speed": ROTORS}, "torque_source": "rotor-command"}),
        (
            "rotor_command_is",
            {"signals": {"rotor_command": ROTORS}, "torque_source": None, "rotor_command_is": "thrust"},
        ),
    ],
)
def test_a_contradiction_between_keys_is_refused_at_its_key(key, settings):
    with pytest.raises(SettingError) as caught:
        ImportSettings(**settings)
    assert caught.value.key == key


@pytest.mark.parametrize("sign", [(1.0, 1.0), (1.0, 1.0, 0.5)])
def test_signs_must_be_plus_or_minus_one_for_each_column(sign):
    with pytest.raises(SettingError) as caught:
        SignalMap(columns=("a", "b", "c"), unit="rad", sign=sign)
    assert caught.value.key == "sign"


@pytest.mark.parametrize(
    ("key", "name", "mixer"),
    [
        ("mixer.1", "rotor_command", ((1.0, 0.5, 0.5), (1.0, 0.5))),
        ("signals.body_rate.mixer", "body_rate", ((1.0, 0.0, 0.0),) * 3),
    ],
)
def test_a_mixer_is_for_rotors_and_has_a_factor_for_each_column(key, name, mixer):
    with pytest.raises(SettingError) as caught:
        ImportSettings(signals={name: SignalMap(columns=("a", "b", "c"), unit="1", mixer=mixer)}, torque_source=None)
    assert caught.value.key == key


def test_a_config_in_json_validates_strictly():
    text = '{"signals": {"attitude": {"columns": ["a", "b", "c"], "unit": "deg", "sign": [1, -1, 1]}},'
    text += ' "torque_source": null}'
    settings = TypeAdapter(ImportSettings).validate_json(text, strict=True)
    assert settings.signals["attitude"].sign == (1.0, -1.0, 1.0)
    assert np.isclose(settings.gap_s, 0.1)


@pytest.mark.parametrize("text", ['{"delay_s": "guess"}', '{"delay_s": -0.1}', '{"gap_s": 0}', '{"rates_hz": 5}'])
def test_a_wrong_value_in_json_is_refused(text):
    with pytest.raises(ValidationError):
        TypeAdapter(ImportSettings).validate_json(text, strict=True)
