"""Simulation along commands, and of a model."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from cpfls_cli import rotations
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.errors import InputError, SettingError
from cpfls_cli.inertia import symmetric
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulation.autopilot import mixer, upright
from cpfls_cli.simulation.closed_loop import Integration, actuators, clock_of, flown, flown_vehicle, settled
from cpfls_cli.simulation.model import in_the_loop, simulated_effects, with_effects
from cpfls_cli.simulation.settings import ClosedLoopSettings, SimulationSettings
from cpfls_cli.vehicle.rotors import body_wrench
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.values import Each
from tests.builders.closed_loop_flights import VEHICLE as LEVEL

VEHICLE = replace(LEVEL, inertia_kg_m2=(0.6, 0.5, 1.0, 0.02, -0.03, 0.04))
TIME = 0.05 * np.arange(17)
START = np.array([0.0, 0.0, 20.0, 3.0, -1.0, -4.0, 0.1, -0.2, 0.3, 0.5, -0.3, 0.2])
SPEED, COMMAND, LAG = np.full(4, 340.0), np.array([362.0, 330.0, 350.0, 352.0]), 0.08
PUSH = np.array([0.05, -0.04, 0.02, 0.3, -0.2, 0.5])
EFFECTS = {
    "linear_damping": {"d_x": 0.1, "d_y": 0.2, "d_z": 0.05},
    "wind": {"k_d": 1.2e-3, "W_x": 2.0, "W_y": -3.0},
    "parasitic_drag": {"c_x": 0.03, "c_y": 0.04, "c_z": 0.05, "cr_y": 0.002},
    "rotor_acceleration": {"J_r": 4e-4},
    "rotor_gyroscopic": {"J_r": 4e-4},
    "com_offset": {"c_x": 0.01, "c_y": -0.02, "c_z": 0.03},
}
LOAD = {"mass": 0.4, "mass_times_depth": 0.04, "length_m": 0.6, "damping_1_s": 0.2, "depth_m": 0.1}
USUAL = VehicleSettings()


class Given:
    """A pilot that commands the same all the time."""

    def size(self, rotors):
        return rotors

    def given(self, _number, _start):
        return tuple(COMMAND.tolist())

    def commanded(self, given, _middle):
        return Each(given), Each(given)


def simulated(rate, effects):
    settings = ClosedLoopSettings(integration_rate_hz=rate, rotor_time_constant_s=LAG)
    clock, chosen = clock_of(TIME, settings), simulated_effects(effects, VEHICLE)
    vehicle = flown_vehicle(VEHICLE, None, chosen)
    state, push = np.concatenate([START, vehicle.start]), np.tile(PUSH, (clock.steps, 1))
    chain = actuators(chosen, RotorResponse(), VEHICLE, settings, SPEED, TIME[-1])
    change = settled(vehicle, None, state, SPEED, PUSH)
    loop = Integration(Given(), chain, vehicle, None, state, change, clock, push)
    return flown(loop, lambda _sample, _state: None, lambda _done, _all: None)


def equations(load):
    """Newton and Euler about the hubs' origin as one system of linear equations, the tension among the unknowns."""
    inertia, hubs = symmetric(VEHICLE.inertia_kg_m2), np.array([one.position_m for one in VEHICLE.rotors])
    spins = np.array([one.spin for one in VEHICLE.rotors])
    thrust = np.array([one.thrust_factor_n_s2 for one in VEHICLE.rotors])
    drag = np.array([one.drag_factor_n_m_s2 for one in VEHICLE.rotors])
    mass, gravity = VEHICLE.mass_kg, np.array([0.0, 0.0, 9.81])
    damping, drags = np.array([0.1, 0.2, 0.05]), np.array([0.03, 0.04, 0.05])

    def change(time, state):
        velocity, angles, rate = state[3:6], state[6:9], state[9:12]
        turned = Rotation.from_euler("ZYX", angles[::-1]).as_matrix()
        speed = COMMAND + (SPEED - COMMAND) * np.exp(-time / LAG)
        air = turned.T @ (velocity - [2.0, -3.0, 0.0])
        at_hubs = np.outer(thrust * speed**2, [0.0, 0.0, 1.0])
        at_hubs -= (1.2e-3 * speed)[:, None] * (air + np.cross(rate, hubs)) * [1.0, 1.0, 0.0]
        blown = -np.linalg.norm(air) * air
        force = at_hubs.sum(axis=0) + drags * blown
        torque = np.cross(hubs, at_hubs).sum(axis=0) + np.cross([0.0, 0.002, 0.0], blown) - damping * rate
        torque = torque - np.cross([0.01, -0.02, 0.03], force) + PUSH[:3]
        torque[2] -= (spins * drag * speed**2).sum() + 4e-4 * (spins * (COMMAND - speed) / LAG).sum()
        torque -= np.cross(rate, inertia @ rate + [0.0, 0.0, 4e-4 * (spins * speed).sum()])
        system, right = np.zeros((7, 7)), np.zeros(7)
        system[:3, :3], system[3:6, 3:6] = mass * np.eye(3), inertia
        right[:3], right[3:6] = turned @ (force + PUSH[3:]) - mass * gravity, torque
        system[6, 6] = 1.0
        if load:
            hook, cable, swing = np.array([0.0, 0.0, -0.1]), state[12:15] / np.linalg.norm(state[12:15]), state[15:18]
            skew = np.cross(hook, np.eye(3))
            system[:3, 6], system[3:6, 6] = -cable, -np.cross(hook, turned.T @ cable)
            # t / m = L n'^2 - (a + g) n, a = v' + R (omega' x r + omega x (omega x r)) being that of the hook.
            system[6, :3], system[6, 3:6], system[6, 6] = cable, cable @ turned @ skew, 1 / 0.4
            carried = turned @ np.cross(rate, np.cross(rate, hook)) + gravity
            right[6] = 0.6 * swing @ swing - carried @ cable
        found = np.linalg.solve(system, right)
        sine, cosine, tangent = np.sin(angles[0]), np.cos(angles[0]), np.tan(angles[1])
        turn = [
            rate[0] + tangent * (sine * rate[1] + cosine * rate[2]),
            cosine * rate[1] - sine * rate[2],
            (sine * rate[1] + cosine * rate[2]) / np.cos(angles[1]),
        ]
        more = []
        if load:
            felt = found[:3] + turned @ skew @ found[3:6] + carried
            more = [*swing, *(-(felt - (felt @ cable) * cable) / 0.6 - swing @ swing * cable - 0.2 * swing)]
        return [*velocity, *found[:3], *turn, *found[3:6], *more]

    return change


@pytest.mark.parametrize("load", [False, True], ids=["effects", "effects and a load"])
def test_a_flight_is_that_of_an_adaptive_integrator(load):
    effects = EFFECTS | ({"payload": LOAD} if load else {})
    start = np.concatenate([START, [0.0, 0.0, -1.0, 0.0, 0.0, 0.0]] if load else [START])
    exact = solve_ivp(equations(load), TIME[[0, -1]], start, "DOP853", TIME, rtol=1e-12, atol=1e-12).y.T
    coarse, fine = (simulated(rate, effects).state for rate in (1000.0, 2000.0))
    off = np.abs(fine - exact).max(axis=0)
    assert off.max() < 3e-5
    # Of second order: what is left falls to a quarter, and without it next to nothing is left.
    assert (np.abs((4 * fine - coarse) / 3 - exact).max(axis=0) < 0.02 * off + 1e-9).all()


def test_values_are_taken_in_the_order_of_the_catalogue_or_by_name():
    payload = CATALOGUE["payload"]
    values = {entry.name: 0.2 + 0.01 * place for place, entry in enumerate(payload.coefficients)}
    shapes = {shape.name: shape.grid[1] for shape in payload.shapes}
    by_order = simulated_effects({"payload": [*values.values(), *shapes.values()]}, USUAL)
    by_name = simulated_effects({"payload": {**dict(reversed(values.items())), **shapes}}, USUAL)
    assert by_order.values("payload") == by_name.values("payload") == {**values, **shapes}
    assert by_order.values("wind") is None


def test_coefficients_without_a_value_are_zero():
    assert simulated_effects({"torque_bias": {"M_y": 0.1}}, USUAL).values("torque_bias") == {
        "M_x": 0.0,
        "M_y": 0.1,
        "M_z": 0.0,
    }


def test_wind_is_air_that_moves():
    (one,) = simulated_effects({"wind": [1e-3, 3.0, -2.0]}, USUAL).listed
    assert [*one.values.values()] == [1e-3, 3.0, -2.0]
    assert (one.values["W_x"], one.values["W_y"]) == (3.0, -2.0)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"linear_damping": [-0.1, 0.1, 0.1]}, r"d_x = -0.1 is not possible on this vehicle: 0 to 1.8 N m s/rad"),
        ({"payload": {"mass": 0.5}}, r"needs length_m, damping_1_s"),
        ({"motor_lag": [0.5]}, r"time_constant_s = 0.5 is not possible on this vehicle: 0.005 to 0.15 s"),
        ({"euler_axis_torque": [1.0]}, r"takes no values; 1 given"),
        ({"motor_lag": [0.05], "channel_delay": [0.02]}, r"shifts measured rotor speeds"),
    ],
)
def test_impossible_values_are_refused(asked, message):
    with pytest.raises(SettingError, match=message) as refused:
        simulated_effects(asked, USUAL)
    assert refused.value.key.split(".")[:2] == ["closed_loop", "effects"]


def test_unknown_effect_names_the_nearest():
    with pytest.raises(InputError, match="did you mean rotor_drag"):
        simulated_effects({"rotr_drag": [1.0]}, USUAL)


def test_inverse_dynamics_has_no_effects_and_no_gyro():
    with pytest.raises(SettingError, match="closed loop only"):
        SimulationSettings(closed_loop=ClosedLoopSettings(effects={"wind": (1e-3, 1.0, 1.0)}))
    with pytest.raises(SettingError, match="body_rate"):
        SimulationSettings(noise={"body_rate": 0.1})
    SimulationSettings(mode="closed-loop", noise={"body_rate": 0.1})


def mixed(wrench):
    speed, demand = mixer(USUAL).mixed(tuple(np.asarray(wrench).tolist()))
    return np.array([*speed]), np.array([*demand])


def test_mixer_gives_the_wrench_that_was_asked_for():
    wrench = np.array([58.0, 1.0, -2.0, 0.4])
    speed, demand = mixed(wrench)
    given = body_wrench(USUAL, speed[None])
    np.testing.assert_allclose([given.thrust[0], *given.body_torque[0]], wrench, rtol=1e-12)
    np.testing.assert_allclose(demand, speed**2, rtol=1e-12)


@pytest.mark.parametrize("yaw", [5.0, -5.0])
def test_yaw_gives_way_before_roll_and_pitch(yaw):
    given = body_wrench(USUAL, mixed([58.0, 1.0, -2.0, yaw])[0][None])
    np.testing.assert_allclose([given.thrust[0], *given.body_torque[0, :2]], [58.0, 1.0, -2.0], rtol=1e-12)
    assert 0 < given.body_torque[0, 2] / yaw < 0.5


def test_commands_stay_within_what_a_rotor_can_do():
    for wrench in np.random.default_rng(1).normal(size=(50, 4)) * [2000.0, 200.0, 200.0, 20.0]:
        speed, _ = mixed(wrench)
        assert (speed >= 0).all()
        assert (speed <= USUAL.rotor_speed_max_rad_s).all()


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


def test_effects_that_hide_the_speeds_are_refused_next_to_a_shift_of_them():
    vehicle = VehicleSettings()
    name = CATALOGUE["channel_delay"].shapes[0].name
    late = VehicleModel(vehicle=vehicle, response=RotorResponse(lag_s=0.05), commanded=True)
    with pytest.raises(SettingError, match="shifts measured rotor speeds"):
        with_effects(late, simulated_effects({"channel_delay": {name: 0.01}}, vehicle))
