"""Values of effects: read by order or name, refused where they are impossible."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli import rotations
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.errors import InputError, SettingError
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulation.actuators import mixer
from cpfls_cli.simulation.autopilot import upright
from cpfls_cli.simulation.model import in_the_loop, simulated_effects, with_effects
from cpfls_cli.simulation.settings import ClosedLoopSettings, SimulationSettings
from cpfls_cli.vehicle.rotors import body_wrench
from cpfls_cli.vehicle.settings import VehicleSettings

VEHICLE = VehicleSettings()


def test_values_are_taken_in_the_order_of_the_catalogue_or_by_name():
    payload = CATALOGUE["payload"]
    values = {entry.name: 0.2 + 0.01 * place for place, entry in enumerate(payload.coefficients)}
    shapes = {shape.name: shape.grid[1] for shape in payload.shapes}
    by_order = simulated_effects({"payload": [*values.values(), *shapes.values()]}, VEHICLE)
    by_name = simulated_effects({"payload": {**dict(reversed(values.items())), **shapes}}, VEHICLE)
    assert by_order.values("payload") == by_name.values("payload") == {**values, **shapes}
    assert by_order.listed[0].shape == shapes
    assert by_order.values("wind") is None


def test_coefficients_without_a_value_are_zero():
    assert simulated_effects({"torque_bias": {"M_y": 0.1}}, VEHICLE).values("torque_bias") == {
        "M_x": 0.0,
        "M_y": 0.1,
        "M_z": 0.0,
    }


def test_wind_is_air_that_moves():
    (one,) = simulated_effects({"wind": [1e-3, 3.0, -2.0]}, VEHICLE).listed
    np.testing.assert_allclose(one.linear, [1e-3])
    assert one.shape == {"W_x": 3.0, "W_y": -2.0}


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"linear_damping": [0.1, 0.1]}, r"takes 3 values: d_x \(N m s/rad\), d_y .*; 2 given"),
        ({"linear_damping": [-0.1, 0.1, 0.1]}, r"d_x = -0.1 is not possible on this vehicle: 0 to 1.8 N m s/rad"),
        ({"linear_damping": {"d_q": 0.1}}, r"has no d_q; takes 3 values"),
        ({"payload": {"mass": 0.5}}, r"needs length_m, damping_1_s"),
        ({"motor_lag": [0.5]}, r"time_constant_s = 0.5 is not possible on this vehicle: 0.005 to 0.15 s"),
        ({"euler_axis_torque": [1.0]}, r"takes no values; 1 given"),
        ({"ground_effect": [4.0]}, r"needs vehicle.rotors.radius_m of every rotor"),
        ({"motor_lag": [0.05], "channel_delay": [0.02]}, r"shifts measured rotor speeds"),
    ],
)
def test_impossible_values_are_refused(asked, message):
    with pytest.raises(SettingError, match=message) as refused:
        simulated_effects(asked, VEHICLE)
    assert refused.value.key.split(".")[:2] == ["closed_loop", "effects"]


def test_unknown_effect_names_the_nearest():
    with pytest.raises(InputError, match="did you mean rotor_drag"):
        simulated_effects({"rotr_drag": [1.0]}, VEHICLE)


def test_inverse_dynamics_has_no_effects_and_no_gyro():
    with pytest.raises(SettingError, match="closed loop only"):
        SimulationSettings(closed_loop=ClosedLoopSettings(effects={"wind": (1e-3, 1.0, 1.0)}))
    with pytest.raises(SettingError, match="body_rate"):
        SimulationSettings(noise={"body_rate": 0.1})
    SimulationSettings(mode="closed-loop", noise={"body_rate": 0.1})


def mixed(wrench):
    speed, demand = mixer(VEHICLE).mixed(tuple(np.asarray(wrench).tolist()))
    return np.array([*speed]), np.array([*demand])


def test_mixer_gives_the_wrench_that_was_asked_for():
    wrench = np.array([58.0, 1.0, -2.0, 0.4])
    speed, demand = mixed(wrench)
    given = body_wrench(VEHICLE, speed[None])
    np.testing.assert_allclose([given.thrust[0], *given.body_torque[0]], wrench, rtol=1e-12)
    np.testing.assert_allclose(demand, speed**2, rtol=1e-12)


@pytest.mark.parametrize("yaw", [5.0, -5.0])
def test_yaw_gives_way_before_roll_and_pitch(yaw):
    given = body_wrench(VEHICLE, mixed([58.0, 1.0, -2.0, yaw])[0][None])
    np.testing.assert_allclose([given.thrust[0], *given.body_torque[0, :2]], [58.0, 1.0, -2.0], rtol=1e-12)
    assert 0 < given.body_torque[0, 2] / yaw < 0.5


def test_commands_stay_within_what_a_rotor_can_do():
    for wrench in np.random.default_rng(1).normal(size=(50, 4)) * [2000.0, 200.0, 200.0, 20.0]:
        speed, _ = mixed(wrench)
        assert (speed >= 0).all()
        assert (speed <= VEHICLE.rotor_speed_max_rad_s).all()


def test_upright_body_has_the_yaw_and_the_thrust_of_the_plan():
    attitude = np.array([[0.3, -0.2, 2.5], [-0.5, 0.1, -1.0]])
    for planned, rotation in zip(attitude, rotations.rotation_matrix(attitude), strict=True):
        axes = upright(tuple((7.0 * rotation[:, 2]).tolist()), float(planned[2]))
        np.testing.assert_allclose(np.array(axes).T, rotation, atol=1e-12)


def test_errors_of_the_numbers_add_up_and_other_effects_are_flown_once():
    vehicle = VehicleSettings()
    numbers = np.zeros(10)
    numbers[6] = 0.1
    effects = (ModelEffect("parameter_error", {}, numbers), ModelEffect("torque_bias", {}, np.array([0.0, 0.0, 0.1])))
    model = VehicleModel(vehicle=vehicle, effects=effects)
    held, more = with_effects(model, simulated_effects({"parameter_error": {"thrust_scale": -0.05}}, vehicle))
    assert (held.effects, more.values("parameter_error")["thrust_scale"]) == (effects, -0.05)
    with pytest.raises(SettingError, match="the model has it already"):
        with_effects(model, simulated_effects({"torque_bias": {"M_z": 0.1}}, vehicle))


def test_what_no_table_holds_is_simulated_by_itself_and_a_lag_behind_commands_stands_before_the_speeds():
    vehicle = VehicleSettings()
    sag, bias = ModelEffect("battery_sag", {"exponent": 1.5}, np.zeros(0)), ModelEffect("torque_bias", {}, np.ones(3))
    model = VehicleModel(vehicle=vehicle, effects=(sag, bias), response=RotorResponse(lag_s=0.05), wind=(3.0, 0.0, 0.0))
    held, own = in_the_loop(model)
    assert ([one.name for one in held.effects], held.response.lag_s, held.wind) == (["torque_bias"], 0.05, (0, 0, 0))
    assert [(one.effect.name, dict(one.values)) for one in own.listed] == [("battery_sag", {"exponent": 1.5})]
    held, own = in_the_loop(replace(model, commanded=True))
    assert (held.response.lag_s, own.values("motor_lag")) == (0.0, {"time_constant_s": 0.05})


def test_effects_that_hide_the_speeds_are_refused_beside_a_shift_of_them():
    vehicle = VehicleSettings()
    name = CATALOGUE["channel_delay"].shapes[0].name
    late = VehicleModel(vehicle=vehicle, response=RotorResponse(lag_s=0.05), commanded=True)
    with pytest.raises(SettingError, match="shifts measured rotor speeds"):
        with_effects(late, simulated_effects({"channel_delay": {name: 0.01}}, vehicle))
