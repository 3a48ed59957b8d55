"""Flights in closed loop: the balance of what is logged, effect by effect, against the formulas of the catalogue."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from cpfls_cli import rotations
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import ComputationError
from cpfls_cli.gap.balance.weak_flight import weak_flight
from cpfls_cli.simulation.measured import measure
from cpfls_cli.simulation.settings import SimulationSettings
from cpfls_cli.vehicle.settings import RotorSettings
from cpfls_cli.weak_form.windows import windows
from tests.builders.closed_loop_flights import PERIOD, VEHICLE, flown, planned, signals_of


def typical(name):
    """A twentieth of what is possible, to one side and the other in turn; of shapes, what lies in the middle."""
    values = {}
    for place, entry in enumerate(CATALOGUE[name].coefficients):
        low, high = entry.bounds(VEHICLE)
        values[entry.name] = 0.05 * (low if place % 2 and low < 0 else high)
    return values | {shape.name: shape.grid[len(shape.grid) // 2] for shape in CATALOGUE[name].shapes}


# The catalogue estimates the swing of a load from the flight; it is compared with an integrator below.
SEEN_BY_BALANCE = [name for name, effect in CATALOGUE.items() if effect.columns and name != "payload"]


def balance(signals):
    weak = weak_flight("flight", signals, windows(PERIOD, 0.4, 0.75), None, True)
    return weak, weak.averaged(weak.residual(signals))


def rms(values):
    return np.sqrt((values**2).mean(axis=0))


@pytest.fixture(scope="module")
def plain():
    return flown()


def test_without_effects_the_balance_closes_to_the_accuracy_of_the_integration(plain):
    weak, left = balance(signals_of(plain))
    size = rms(weak.averaged(weak.inertial))
    assert size[:3].min() > 0.3
    assert rms(left)[:3].max() < 2e-5
    assert rms(left)[3:].max() < 2e-4


def test_accuracy_is_of_second_order_in_the_step():
    fine, coarse, reference = (flown(1.0, integration_rate_hz=rate).signals["position"] for rate in (400, 200, 1600))
    ratio = rms(coarse - reference) / rms(fine - reference)
    assert (ratio > 3.0).all()


def test_path_is_followed_and_no_rotor_is_clipped(plain):
    assert rms(plain.position_error).max() < 0.05
    assert rms(plain.attitude_error).max() < 0.03
    assert plain.violations == ()


@pytest.mark.parametrize("name", SEEN_BY_BALANCE)
def test_effect_leaves_in_the_balance_what_the_catalogue_says(name):
    flight = flown(2.0, effects={name: typical(name)})
    (one,) = flight.effects.listed
    signals = signals_of(flight)
    weak, left = balance(signals)
    if one.effect.kind == "actuator":
        corrected = one.effect.apply(signals, one.shape)
        expected = left - weak.averaged(weak.residual(corrected))
    else:
        expected = weak.averaged(one.effect.columns(signals, one.shape)) @ one.linear
    assert rms(expected).max() > 2e-3
    # The log shows what is late only at its samples, with a straight line between them; a filter of samples is exact
    # at its own frequency.
    between = {"notch_filter": 50, "low_pass_filter": 50, "flexible_mount": 3}.get(
        name, 20 if one.effect.kind == "actuator" else 1
    )
    np.testing.assert_array_less(rms(left - expected), between * np.array([2e-5] * 3 + [2e-4] * 3))


def pendulum_wrench(signals, values):
    """Wrench of a load whose hook moves as the flight says, by an adaptive integrator."""
    time, gravity, hook = signals.time, np.array([0.0, 0.0, 9.81]), np.array([0.0, 0.0, -values.get("depth_m", 0.0)])
    offset = np.einsum("tij,j->ti", signals.rotation, hook)
    felt = CubicSpline(time, signals.acceleration + CubicSpline(time, offset)(time, 2) + gravity)

    def motion(moment, state):
        n, rate = state[:3], state[3:]
        across = felt(moment) - (felt(moment) @ n) * n
        return [*rate, *(-across / values["length_m"] - (rate @ rate) * n - values["damping_1_s"] * rate)]

    states = solve_ivp(motion, time[[0, -1]], [0, 0, -1, 0, 0, 0], t_eval=time, rtol=1e-9, atol=1e-9).y.T
    n, rate = states[:, :3], states[:, 3:]
    tension = values["length_m"] * (rate**2).sum(axis=1) - (felt(time) * n).sum(axis=1)
    pull = np.einsum("tji,tj->ti", signals.rotation, n * tension[:, None])
    lever = -np.array([values[f"mass_times_{place}"] for place in ("behind", "right", "depth")])
    return np.concatenate([np.cross(lever, pull), values["mass"] * pull], axis=1)


def test_load_pulls_as_a_pendulum_under_the_hook_does():
    values = {"mass": 0.5, "mass_times_depth": 0.05, "mass_times_right": 0.02, "mass_times_behind": -0.01}
    values |= {shape.name: shape.grid[1] for shape in CATALOGUE["payload"].shapes}
    flight = flown(effects={"payload": values})
    signals = signals_of(flight)
    weak, left = balance(signals)
    expected = weak.windows.average(pendulum_wrench(signals, values))
    assert rms(expected).min() > 0.02
    np.testing.assert_array_less(rms(left - expected), [2e-4] * 3 + [2e-3] * 3)


def test_momentum_of_every_effect_is_linear_in_rates_and_rotor_speeds():
    rng = np.random.default_rng(3)

    def momentum(effect, rate, speed):
        still = {name: np.zeros((1, 3)) for name in ("attitude", "velocity", "position")}
        signals = Signals(time=np.zeros(1), vehicle=VEHICLE, body_rate=rate, rotor_speed=speed, **still)
        return effect.columns(signals, {}).momentum

    for effect in CATALOGUE.values():
        if effect.columns is None or effect.shapes or effect.name == "payload":
            continue
        (rate, other), (speed, faster) = rng.normal(size=(2, 1, 3)), rng.uniform(200, 500, size=(2, 1, 4))
        first = momentum(effect, rate, speed)
        if first is not None:
            both = momentum(effect, rate + 2 * other, speed + 2 * faster)
            np.testing.assert_allclose(both, first + 2 * momentum(effect, other, faster), atol=1e-9)


@pytest.mark.parametrize(
    ("name", "reading"),
    [
        ("gyro_bias", lambda rate, value: rate + value),
        ("gyro_scale", lambda rate, value: rate * (1 + value)),
        ("imu_misalignment", lambda rate, value: rate - np.cross(value, rate)),
    ],
)
def test_faulty_gyro_reads_what_the_catalogue_says_and_the_flight_is_the_same(name, reading, plain):
    faulty = flown(effects={name: typical(name)})
    expected = reading(plain.signals["body_rate"], np.array(list(typical(name).values())))
    np.testing.assert_allclose(faulty.signals["body_rate"], expected, atol=1e-12)
    np.testing.assert_array_equal(faulty.signals["attitude"], plain.signals["attitude"])


def test_logged_rates_and_accelerations_are_derivatives_of_the_attitude(plain):
    signals = plain.signals
    for name, derivative in (("attitude", "attitude_rate"), ("attitude_rate", "attitude_acceleration")):
        slope = np.gradient(signals[name], PERIOD, axis=0)[5:-5]
        assert np.abs(slope - signals[derivative][5:-5]).max() < 0.01 * np.abs(slope).max()
    speed = np.gradient(signals["velocity"], PERIOD, axis=0)[5:-5]
    np.testing.assert_allclose(signals["acceleration"][5:-5], speed, atol=0.02)


def test_torque_is_that_of_the_logged_rotor_speeds(plain):
    signals = plain.signals
    first, second, third, fourth = signals["rotor_speed"].T ** 2
    k, b, arm = 121.5e-6, 2.7e-6, 0.3
    torque = np.column_stack([arm * k * (fourth - second), arm * k * (third - first), -b * (first + third)])
    torque[:, 2] += b * (second + fourth)
    np.testing.assert_allclose(signals["body_torque"], torque, atol=1e-9)
    W = rotations.euler_rate_matrix(signals["attitude"])
    np.testing.assert_allclose(signals["torque"], np.einsum("nji,nj->ni", W, torque), atol=1e-9)


def test_rotors_lag_behind_the_command(plain):
    command, speed = plain.signals["rotor_command"], plain.signals["rotor_speed"]
    slope = np.gradient(speed, PERIOD, axis=0)[20:-5]
    lag = 0.05 * slope
    np.testing.assert_allclose((command - speed)[20:-5], lag, atol=0.02 * np.abs(lag).max())


@pytest.mark.parametrize("name", ["motor_lag", "command_delay", "battery_sag"])
def test_actuator_effects_hide_the_rotor_speed(name):
    logged = flown(0.5, effects={name: typical(name)}).signals
    assert "rotor_speed" not in logged
    assert ("voltage" in logged) == (name == "battery_sag")


def test_battery_empties_by_the_share_that_was_asked_for():
    voltage = flown(effects={"battery_sag": [1.0]}, battery_use=0.3, battery_load=0.0).signals["voltage"]
    np.testing.assert_allclose(voltage, np.linspace(1.0, 0.7, len(voltage)), atol=1e-12)


def test_effects_add_up():
    names = ("com_offset", "rotor_drag", "products_of_inertia", "rotor_acceleration")
    flight = flown(effects={name: typical(name) for name in names})
    signals = signals_of(flight)
    weak, left = balance(signals)
    expected = sum(weak.averaged(one.effect.columns(signals, {})) @ one.linear for one in flight.effects.listed)
    np.testing.assert_array_less(rms(left - expected), [3e-5] * 3 + [2e-4] * 3)


def test_noise_lies_on_the_log_and_not_in_the_loop(plain):
    noisy = flown(noise={"body_rate": 0.01, "rotor_speed": 1.0}, relative_noise={"position": 0.1})
    assert set(noisy.noise_std) == {"body_rate", "rotor_speed", "position"}
    assert (noisy.signals["body_rate"] - plain.signals["body_rate"]).std() == pytest.approx(0.01, rel=0.1)
    np.testing.assert_array_equal(noisy.signals["velocity"], plain.signals["velocity"])
    again, other = (flown(0.3, seed, noise={"body_rate": 0.01}).signals["body_rate"] for seed in (1, 2))
    np.testing.assert_array_equal(flown(0.3, 1, noise={"body_rate": 0.01}).signals["body_rate"], again)
    assert np.abs(again - other).max() > 1e-3


def test_more_than_four_rotors_fly_too():
    angles = np.pi / 3 * np.arange(6)
    hubs = [(0.4 * np.cos(angle), 0.4 * np.sin(angle), 0.0) for angle in angles]
    spun = tuple(RotorSettings(position_m=hub, spin=1 if n % 2 else -1) for n, hub in enumerate(hubs))
    flight = flown(1.0, vehicle=replace(VEHICLE, rotors=spun))
    assert flight.signals["rotor_speed"].shape == (101, 6)
    assert rms(flight.position_error).max() < 0.05


def test_vehicle_that_cannot_stay_on_its_path_is_given_up():
    with pytest.raises(ComputationError, match=r"m away from the path at t = .* fly more gently"):
        flown(deviation_max_m=0.2, effects={"parameter_error": {"thrust_scale": -0.5}})
    with pytest.raises(ComputationError, match=r"tilts beyond 90 degrees|out of control"):
        flown(attitude_frequency_hz=8.0, effects={"command_delay": [0.12]})


def test_trajectory_of_changing_rate_is_refused():
    time, plan = planned(0.5)
    settings = SimulationSettings(mode="closed-loop")
    with pytest.raises(ComputationError, match="at one rate"):
        measure(time**2, plan, VEHICLE, settings, np.random.default_rng(1))
