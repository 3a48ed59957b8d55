"""Effects of a flown model and of the command together."""

import pytest

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.errors import SettingError
from cpfls_cli.simulation import SimulatedModel, simulated_effects, simulated_model
from cpfls_cli.vehicle import VehicleSettings


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
