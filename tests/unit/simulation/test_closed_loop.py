"""Closed-loop simulation: autopilots, room that is left, and effects."""

from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from cpfls_cli import rotations
from cpfls_cli.consistency import check as audit_module
from cpfls_cli.effects.effect import Coefficient, Effect, Shape
from cpfls_cli.effects.hooks import Actuation, FaultFit, ReadingError, SensorLog, SensorTest
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.gap.balance.weak_flight import weak_flight
from cpfls_cli.simulation import model
from cpfls_cli.simulation.closed_loop import ClosedLoop, Setpoints, fly_setpoints
from cpfls_cli.simulation.inverse import (
    ROTOR_SHARE,
    hover_squared,
    measure,
    room_left,
    rotor_load,
    squared_speeds,
    tilt_of,
)
from cpfls_cli.simulation.model import SimulatedEffects, simulated_effects
from cpfls_cli.simulation.settings import ClosedLoopSettings, SimulationSettings
from cpfls_cli.trajectory.excited import added_motion
from cpfls_cli.trajectory.planning import plan
from cpfls_cli.trajectory.settings import ExciteSettings, TrajectorySettings
from cpfls_cli.vehicle.motion import Wrench
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings
from cpfls_cli.weak_form.windows import windows
from tests.builders.autopilots import CROSS
from tests.builders.closed_loop_flights import PERIOD, VEHICLE, by_columns, flown, planned, signals_of

USUAL = VehicleSettings()


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
    weak = weak_flight(signals, windows(PERIOD, 0.4, 0.75), None, True)
    return weak, weak.averaged(weak.residual(signals))


def rms(values):
    return np.sqrt((values**2).mean(axis=0))


@pytest.fixture(scope="module")
def plain():
    return flown()


def test_without_effects_the_balance_closes_to_the_accuracy_of_the_integration(plain):
    weak, left = balance(signals_of(plain))
    assert rms(weak.averaged(weak.inertial))[:3].min() > 0.3
    assert rms(left)[:3].max() < 2e-5
    assert rms(left)[3:].max() < 2e-4


def test_accuracy_is_of_second_order_in_the_step():
    fine, coarse, reference = (flown(1.0, integration_rate_hz=rate).signals["position"] for rate in (400, 200, 1600))
    assert (rms(coarse - reference) / rms(fine - reference) > 3.0).all()


def test_path_is_followed_and_no_rotor_is_clipped(plain):
    assert plain.tracking.position_rms_m < 0.05
    assert plain.tracking.attitude_rms_rad.max() < 0.03
    assert plain.infeasible == ()


@pytest.mark.parametrize("name", SEEN_BY_BALANCE)
def test_effect_leaves_in_the_balance_what_the_catalogue_says(name):
    flight = flown(2.0, effects={name: typical(name)})
    (one,) = simulated_effects({name: typical(name)}, VEHICLE).listed
    signals, (shape, linear) = signals_of(flight), by_columns(one)
    weak, left = balance(signals)
    if one.effect.kind == "actuator":
        expected = left - weak.averaged(weak.residual(one.effect.apply(signals, shape)))
    else:
        expected = weak.averaged(one.effect.columns(signals, shape)) @ linear
    assert rms(expected).max() > 2e-3
    # The log shows what is late only at its samples, with a straight line between them; a filter of samples is exact
    # at its own frequency.
    between = {"notch_filter": 50, "low_pass_filter": 50, "flexible_mount": 3}.get(
        name, 20 if one.effect.kind == "actuator" else 1
    )
    np.testing.assert_array_less(rms(left - expected), between * np.array([2e-5] * 3 + [2e-4] * 3))


@pytest.mark.parametrize("given", [[0.4], {"linear": 0.4}, {"linear": 0.4, "thrust_scale": 0.0}])
def test_a_thrust_curve_needs_its_share_alone(given):
    (curve,) = simulated_effects({"thrust_slope": given}, VEHICLE).listed
    assert curve.values == {"linear": 0.4, "thrust_scale": 0.0}
    assert SimulatedEffects((curve,)).hides_rotor_speed, "measured speeds have the square of their blades"
    wrong = {"thrust_scale": 0.2}
    both = simulated_effects({"thrust_slope": [0.4], "parameter_error": wrong}, VEHICLE)
    assert both.values("thrust_slope") == {"linear": 0.4, "thrust_scale": 0.2}


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
    signals = signals_of(flown(effects={"payload": values}))
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
    lag = 0.05 * np.gradient(speed, PERIOD, axis=0)[20:-5]
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
    chosen = {name: typical(name) for name in names}
    signals = signals_of(flown(effects=chosen))
    weak, left = balance(signals)
    listed = simulated_effects(chosen, VEHICLE).listed
    expected = sum(weak.averaged(one.effect.columns(signals, {})) @ by_columns(one)[1] for one in listed)
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
    hubs = [(0.4 * np.cos(angle), 0.4 * np.sin(angle), 0.0) for angle in np.pi / 3 * np.arange(6)]
    spun = tuple(RotorSettings(position_m=hub, spin=1 if n % 2 else -1) for n, hub in enumerate(hubs))
    flight = flown(1.0, vehicle=replace(VEHICLE, rotors=spun))
    assert flight.signals["rotor_speed"].shape == (101, 6)
    assert flight.tracking.position_rms_m < 0.05


def test_a_vehicle_off_its_path_and_a_path_of_changing_rate_are_given_up():
    with pytest.raises(ComputationError, match=r"m away from the path at t = .* fly more gently"):
        flown(deviation_max_m=0.2, effects={"parameter_error": {"thrust_scale": -0.5}})
    with pytest.raises(ComputationError, match=r"tilts beyond 90 degrees|out of control"):
        flown(attitude_frequency_hz=8.0, effects={"command_delay": [0.12]})
    time, plan = planned(0.5)
    settings = SimulationSettings(mode="closed-loop")
    with pytest.raises(ComputationError, match="at one rate"):
        measure(time**2, plan, VEHICLE, settings, np.random.default_rng(1))


def flown_by(autopilot, seed=1, **parameters):
    time, plan = planned(1.5)
    loop = ClosedLoopSettings(autopilot=autopilot, autopilot_parameters=parameters, integration_rate_hz=400.0)
    settings = SimulationSettings(mode="closed-loop", noise={"body_rate": 0.01}, closed_loop=loop)
    return measure(time, plan, CROSS, settings, np.random.default_rng(seed))


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot", "crazyflie"])
def test_an_autopilot_flies_a_path_with_its_own_law(autopilot):
    flight = flown_by(autopilot)
    assert flight.tracking.position_max_m < 0.3
    behind = flight.signals["setpoint_attitude"] - flight.signals["attitude"]
    # It follows the attitude that it is asked for late, and follows it.
    assert 0.01 < np.sqrt(np.mean(behind[:, :2] ** 2)) < 0.12


def test_noise_of_the_gyroscope_is_in_its_loop_and_drawn_again():
    one, other, again = flown_by("px4"), flown_by("px4", seed=2), flown_by("px4")
    np.testing.assert_array_equal(one.signals["rotor_speed"], again.signals["rotor_speed"])
    assert np.abs(one.signals["rotor_speed"] - other.signals["rotor_speed"]).max() > 0.1


def test_along_setpoints_the_law_reaches_what_it_is_asked_for():
    time = 0.01 * np.arange(101)
    loop = ClosedLoop(CROSS, ClosedLoopSettings(autopilot="px4", rotor_time_constant_s=0.02))
    thrust = np.full(len(time), 0.6)
    step = np.where(time >= 0.2, 0.2, 0.0)[:, None] * [1.0, 0.0, 0.0]
    start = np.zeros(12)
    tilted = fly_setpoints(loop, time, Setpoints(step, None, thrust), start)
    assert tilted.state[-1, 6:9] == pytest.approx([0.2, 0.0, 0.0], abs=0.02)
    assert np.abs(tilted.state[:20, 6:12]).max() < 1e-9
    turned = fly_setpoints(loop, time, Setpoints(None, step, thrust), start)
    assert turned.state[-1, 9:12] == pytest.approx([0.2, 0.0, 0.0], abs=0.03)


def test_parameters_of_no_autopilot_are_refused():
    with pytest.raises(SettingError, match="name one as"):
        ClosedLoopSettings(autopilot_parameters={"MC_ROLLRATE_P": 0.1})
    with pytest.raises(SettingError, match="did you mean MC_ROLLRATE_P"):
        ClosedLoopSettings(autopilot="px4", autopilot_parameters={"MC_ROLRATE_P": 0.1})


def of(vehicle=USUAL, *, tilt_max=None, **asked):
    excite = ExciteSettings(**{"axes": ("roll", "pitch"), "band_hz": (0.5, 2.0), **asked})
    settings = TrajectorySettings(path="hover", duration_s=20.0, tilt_max_rad=tilt_max, excite=excite)
    path = plan(settings, vehicle.gravity_m_s2)
    added = added_motion(excite, path, vehicle.gravity_m_s2)
    return path, added, settings, room_left(path, added, settings, vehicle)


def flown_along(path, added, factor=1.0):
    return added.of_sizes(factor * added.sizes).onto(path, USUAL.gravity_m_s2)


def test_limits_of_tilt_and_velocity_are_kept_and_reached():
    _, added, _, room = of(size_rad=0.03)
    np.testing.assert_array_equal(room.added.sizes, added.sizes)
    assert room.limits == ("", "")
    path, _, _, room = of(size_rad=0.4, tilt_max=0.1, band_hz=(0.5, 1.0))
    assert room.limits == ("tilt (trajectory.tilt_max_rad = 0.1)",) * 2
    assert 0.0995 < tilt_of(flown_along(path, room.added).attitude).max() <= 0.1
    _, _, _, room = of(size_rad=0.4, velocity_max_m_s=0.2, band_hz=(0.5, 1.0))
    assert all("trajectory.excite.velocity_max_m_s = 0.2" in limit for limit in room.limits)
    assert 0.199 < np.linalg.norm(room.added.motion[1], axis=1).max() <= 0.2


def test_rotors_keep_what_control_takes():
    path, _, _, room = of(size_rad=0.3)
    assert all("rotor speed" in limit for limit in room.limits)
    squared, hover = squared_speeds(vars(flown_along(path, room.added)), USUAL), hover_squared(USUAL)
    assert squared.max() <= ROTOR_SHARE * USUAL.rotor_speed_max_rad_s**2
    assert (squared >= (1 - ROTOR_SHARE) * hover * (1 - 1e-9)).all()
    load = rotor_load(vars(flown_along(path, room.added, 1.01)), USUAL)
    assert max(load.fast, load.slow) > 1


def test_the_largest_speed_is_named():
    hover = float(np.sqrt(hover_squared(USUAL).max()))
    _, _, _, room = of(replace(USUAL, rotor_speed_max_rad_s=1.15 * hover), size_rad=0.1)
    largest = f"rotor speed (85 % of the square of vehicle.rotor_speed_max_rad_s = {1.15 * hover:g})"
    assert room.limits == (largest, largest)


def test_an_axis_that_can_little_leaves_the_others_their_size():
    alone = of(axes=("roll",), size_rad=0.02)[3]
    path, _, _, room = of(axes=("roll", "yaw"), size_rad=0.02)
    roll, yaw = room.added.sizes
    assert alone.added.sizes[0] == 0.02
    assert yaw < 0.6 * roll
    assert roll > 0.9 * 0.02
    load = rotor_load(vars(flown_along(path, room.added)), USUAL)
    assert 0.99 < max(load.fast, load.slow) <= 1


def test_next_to_no_room_is_refused():
    with pytest.raises(SettingError, match=r"room for only .* degrees of roll: rotor speed") as caught:
        of(size_rad=0.5, band_hz=(0.5, 10.0))
    assert caught.value.key == "excite.size_rad"


def new_effect(**fields):
    words = dict.fromkeys(("title", "formula", "sentence", "excitation", "source"), "made up")
    known = {"needs": frozenset(), "rivals": {}, "columns": None, "coefficients": (), **words}
    return Effect(**{**known, **fields})


def leaning_log(signals, _motion, values):
    return {"acceleration": signals["acceleration"] + np.array(list(values.values()))}


def leaning_fit(flights):
    """Mean acceleration of each tenth of a flight, less the change of the velocity over it."""
    [flight] = flights
    parts = [slice(first, first + 30) for first in range(0, len(flight) - 30, 30)]
    apart = [
        flight.acceleration[p].mean(axis=0)
        - (flight.velocity[p][-1] - flight.velocity[p][0]) / (PERIOD * (len(flight.time[p]) - 1))
        for p in parts
    ]
    error = np.std(apart, axis=0, ddof=1) / np.sqrt(len(apart))
    return FaultFit(np.mean(apart, axis=0), error, np.zeros(3), np.ones(3, dtype=bool), len(apart))


ACCELEROMETER = new_effect(
    name="accelerometer_offset",
    kind="sensor",
    coefficients=tuple(Coefficient(f"a_{axis}", "m/s^2", -2.0, 2.0, f"offset along {axis}") for axis in "xyz"),
    log=SensorLog(change=leaning_log),
    test=SensorTest(
        estimate=leaning_fit,
        labels=("x", "y", "z"),
        smallest=0.05,
        number=lambda axis, value: f"{value:+.2f} m/s^2 along {axis}",
        found="The accelerometer is off by {}.",
        nothing="The accelerometer is right.",
        error=lambda values: ReadingError(offset=values),
        signal="acceleration",
    ),
)


def slowest(rotors, values, memory):
    return rotors._replace(speed=memory.functions.smallest(rotors.speed, values["limit"]))


LIMITED = new_effect(
    name="limited_rotors",
    kind="actuator",
    shapes=(Shape("limit", "rad/s", (100.0, 900.0), "fastest that a rotor turns"),),
    actuation=Actuation(link=slowest),
)


PULLED_UP = new_effect(
    name="pulled_up",
    kind="wrench",
    coefficients=(Coefficient("f", "N", 0.0, 10.0, "force along body z, where the vehicle is above a metre"),),
    acts=lambda see, p: Wrench(force=(0, 0, see.functions.where(see.height > 1.0, p["f"], 0.0))),
)


def flown_with(monkeypatch, **effects):
    entries = {effect.name: effect for effect in (ACCELEROMETER, LIMITED, PULLED_UP)}
    monkeypatch.setattr(model, "find", entries.__getitem__)
    return flown(effects=effects)


def test_a_new_sensor_effect_is_flown_found_and_repaired(monkeypatch):
    flight = signals_of(flown_with(monkeypatch, accelerometer_offset=(0.5, 0.0, -0.3)))
    grown = MappingProxyType({**CATALOGUE, ACCELEROMETER.name: ACCELEROMETER})
    monkeypatch.setattr(audit_module, "CATALOGUE", grown)
    found = audit_module.audit([flight], windows(PERIOD, 0.4, 0.5))
    [finding] = [each for each in found.named if each.name == ACCELEROMETER.name]
    assert finding.sentence == "The accelerometer is off by +0.50 m/s^2 along x, -0.30 m/s^2 along z."
    np.testing.assert_allclose([number.value for number in finding.coefficients], [0.5, 0.0, -0.3], atol=0.01)
    repaired = replace(found, findings=(finding,)).repaired(flight)
    np.testing.assert_allclose(repaired.acceleration, flight.acceleration - [0.5, 0.0, -0.3], atol=0.01)
    np.testing.assert_array_equal(repaired.body_rate, flight.body_rate)


def test_a_new_actuator_effect_is_a_link_of_the_chain(monkeypatch):
    free = flown_with(monkeypatch)
    flight = flown_with(monkeypatch, limited_rotors=(500.0,))
    assert free.signals["rotor_speed"].min() < 345 < free.signals["rotor_speed"].max() < 500
    assert flight.rotor_speed is None
    np.testing.assert_array_equal(flight.signals["position"], free.signals["position"])
    assert flown_with(monkeypatch, limited_rotors=(345.0,)).position[-1, 2] < free.position[-1, 2] - 0.01


def test_a_new_effect_on_the_vehicle_is_one_function(monkeypatch):
    free, pulled = flown_with(monkeypatch), flown_with(monkeypatch, pulled_up=(3.0,))
    thrust = [121.5e-6 * (each.signals["rotor_speed"][-1] ** 2).sum() for each in (free, pulled)]
    assert thrust[0] - thrust[1] == pytest.approx(3.0, rel=0.3)
    high = flown_with(monkeypatch, pulled_up=(0.0,))
    np.testing.assert_array_equal(high.signals["position"], free.signals["position"])
