"""Effects on what rotors do: their state, mismatch, and the way from command to speed."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import interp1d

from cpfls_cli.effects.catalogue.rotor_mismatch import gains
from cpfls_cli.effects.catalogue.vertical_descent import descent_state, induced_velocity
from cpfls_cli.effects.hooks import second_order
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.lag import delayed, lagged
from cpfls_cli.vehicle.rotors import body_wrench, gain_modes, opposite_pairs
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings
from cpfls_cli.vehicle.stepping import Machine, RotorMotion
from cpfls_cli.vehicle.values import Each
from tests.builders.vehicles import alike


def level(flight, height, roll=0.0):
    attitude = np.full_like(flight.attitude, [roll, 0.0, 0.0])
    return replace(flight, attitude=attitude, position=np.full_like(flight.position, [0.0, 0.0, height]))


def test_ground_effect_is_cheeseman_and_bennett_and_levels_a_tilted_vehicle(columns, flight):
    near = level(flight, 0.25)
    found = columns("ground_effect", near, G=1.0).direct[:, 5, 0]
    np.testing.assert_allclose(found, near.thrust * (1 / (1 - (0.2 / (4 * 0.30)) ** 2) - 1))
    hovering = replace(flight, rotor_speed=np.full_like(flight.rotor_speed, 348.0))
    torque = columns("ground_effect", level(hovering, 0.3, roll=0.2), G=2.0).direct[:, :3, 0]
    assert (torque[:, 0] < -0.01).all()
    np.testing.assert_allclose(torque[:, 1:], 0.0, atol=1e-12)


@pytest.mark.parametrize("height", [0.0, -0.2])
def test_ground_effect_at_most_doubles_the_thrust(columns, flight, height):
    on_ground = level(flight, height)
    np.testing.assert_allclose(columns("ground_effect", on_ground, G=16.0).direct[:, 5, 0], on_ground.thrust)


def sinking(flight, speed, sideways=0.0):
    still = replace(flight, body_rate=np.zeros_like(flight.body_rate), attitude=np.zeros_like(flight.attitude))
    return replace(still, velocity=np.full_like(flight.velocity, [sideways, 0.0, -speed]))


def test_induced_velocity_of_the_six_kilogram_craft(flight):
    np.testing.assert_allclose(induced_velocity(flight.instants), 6.9, rtol=0.01)


@pytest.mark.parametrize(("speed", "knot"), [(6.915, 1), (-3.0, None), (30.0, 5)])
def test_ratio_counts_descent_only_up_to_the_last_knot(columns, flight, speed, knot):
    falling = sinking(flight, speed)
    share = columns("vertical_descent", falling, sideways=1.0).direct[:, 5] / falling.thrust[:, None]
    np.testing.assert_allclose(share, np.tile(np.eye(6)[knot] if knot else np.zeros(6), (len(falling), 1)), atol=5e-3)


@pytest.mark.parametrize(
    ("ratio", "state"),
    [(0.3, "normal working state"), (1.0, "vortex ring"), (1.8, "turbulent wake"), (2.3, "windmill brake")],
)
def test_states_have_names(ratio, state):
    assert descent_state(ratio) == state


def test_a_climb_changes_nothing_and_forward_speed_ends_the_effect(columns, flight):
    assert not columns("vertical_descent", sinking(flight, -5.0), sideways=1.0).direct.any()
    here = columns("vertical_descent", sinking(flight, 7.0), sideways=1.0).direct
    induced = induced_velocity(flight.instants).mean()
    moving = columns("vertical_descent", sinking(flight, 7.0, 0.7 * induced), sideways=0.7).direct
    np.testing.assert_allclose(moving, here / np.e, atol=1e-12)
    gone = columns("vertical_descent", sinking(flight, 7.0, 2.1 * induced), sideways=0.7).direct
    assert np.abs(gone).max() < 2e-4 * np.abs(here).max()


def test_thrust_follows_a_table_of_any_curve_between_its_knots(columns, flight):
    """What six coefficients say is what an interpolator makes of the curve at the knots, rotor by rotor."""
    knots, curve = [0.0, 0.5, 1.0, 1.25, 1.6, 2.0, 2.5], [0.0, 0.02, -0.1, -0.2, -0.1, 0.3, 0.6]
    fast = replace(flight, velocity=flight.velocity * [0.2, 0.2, 3.0] - [0.0, 0.0, 3.0])
    induced = induced_velocity(fast.instants)[:, 0]
    sideways = np.linalg.norm(fast.hub_velocity[..., :2], axis=2) / induced
    share = interp1d(knots, curve)(np.clip(-fast.hub_velocity[..., 2] / induced, 0.0, 2.5))
    thrust = fast.rotor_thrust * share * np.exp(-(sideways**2))
    found = columns("vertical_descent", fast, sideways=1.0).direct @ curve[1:]
    np.testing.assert_allclose(found[:, 5], thrust.sum(axis=1), atol=1e-10)
    np.testing.assert_allclose(found[:, 0], thrust @ fast.hubs[:, 1], atol=1e-10)
    np.testing.assert_allclose(found[:, 1], -thrust @ fast.hubs[:, 0], atol=1e-10)


def test_scatter_is_the_variance_of_thrusts_that_shake_by_themselves(flight):
    size, draws = 0.07, 20000
    for k, speed in ((0, 7.0), (300, 9.0)):
        falling = sinking(flight, speed)
        found = CATALOGUE["vertical_descent"].scatter(falling, {"sideways": 1.0})[k]
        shaking = size * np.random.default_rng(k).standard_normal((draws, 4)) * falling.rotor_thrust[k]
        force = np.zeros((draws, 4, 3))
        force[..., 2] = shaking
        torque = np.cross(falling.hubs, force).sum(axis=1)
        np.testing.assert_allclose(size**2 * found[:3], torque.var(axis=0), rtol=0.05)
        np.testing.assert_allclose(size**2 * found[3:], force.sum(axis=1).var(axis=0), rtol=0.05)


@pytest.mark.parametrize("speed", [-3.0, 2.0, 14.0])
def test_rotors_do_not_shake_outside_the_vortex_ring(flight, speed):
    assert not CATALOGUE["vertical_descent"].scatter(sinking(flight, speed), {"sideways": 1.0}).any()


def test_bounds_hold_the_curves_of_the_sources(vehicle):
    """Thrust over ratio as measured in flight and as computed; the two disagree in sign."""
    knots = [0.0, 0.5, 1.0, 1.25, 1.6, 2.0, 2.5]
    ratio = np.array([0.0, 0.5, 1.0, 1.2, 1.4, 1.6, 2.0])
    falling = np.array([1.0, 1.01, 0.92, 0.82, 0.85, 0.91, 1.36])
    bounds = np.array([c.bounds(vehicle) for c in CATALOGUE["vertical_descent"].coefficients])
    for curve in (np.array([1.0, 1.04, 1.07, 1.08, 1.11, 1.20, 1.70]), falling):
        hats = np.array([np.interp(ratio, knots, unit) for unit in np.eye(len(knots))[1:]]).T
        coefficients = np.linalg.lstsq(hats, curve - 1, rcond=None)[0]
        assert (bounds[:, 0] < coefficients).all()
        assert (coefficients < bounds[:, 1]).all()


def with_gains(vehicle, thrust, drag=(0.0,) * 4):
    rotors = (
        replace(
            rotor,
            thrust_factor_n_s2=rotor.thrust_factor_n_s2 * (1 + kappa),
            drag_factor_n_m_s2=rotor.drag_factor_n_m_s2 * (1 + delta),
        )
        for rotor, kappa, delta in zip(vehicle.rotors, thrust, drag, strict=True)
    )
    return replace(vehicle, rotors=tuple(rotors))


def circle(number):
    angles = 2 * np.pi * np.arange(number) / number
    places = zip(np.cos(angles), np.sin(angles), ([1, -1] * number)[:number], strict=True)
    return VehicleSettings(rotors=alike(places, arm=0.3))


def test_columns_are_what_other_factors_do(columns, flight):
    true = with_gains(flight.vehicle, [0.05, -0.03, -0.05, 0.03], [-0.05, 0.07, -0.15, 0.13])
    change = body_wrench(true, flight.rotor_speed).body_torque - flight.torque
    found = columns("rotor_mismatch", flight).direct @ [0.1, -0.06, 0.1, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(found[:, :3], change, atol=1e-12)
    np.testing.assert_allclose(found[:, 5], body_wrench(true, flight.rotor_speed).thrust - flight.thrust, atol=1e-9)


def test_four_numbers_are_those_of_a_quadrotor(flight):
    """Of files and lists that know no others."""
    own = CATALOGUE["rotor_mismatch"]
    four = own.form(4, ())
    assert four.coefficients == own.coefficients[:4]
    np.testing.assert_array_equal(four.columns(flight, {}).direct, own.columns(flight, {}).direct[..., :4])
    assert own.form(6, ()) is own
    assert own.form(3, ()) is own


def test_what_one_spin_lifts_more_shows_in_force_only(columns, flight):
    """In torque it is a wrong Ixx and a wrong Iyy of opposite signs, which the inertia columns hold already."""
    true = body_wrench(with_gains(flight.vehicle, [0.05, -0.05, 0.05, -0.05]), flight.rotor_speed)
    found = columns("rotor_mismatch", flight).direct[..., 3] * 0.05
    np.testing.assert_allclose(found[:, 5], true.thrust - flight.thrust, atol=1e-9)
    assert not found[:, :5].any()
    np.testing.assert_allclose(true.body_torque - flight.torque, flight.torque * [-0.05, 0.05, 0.0], atol=1e-12)


def test_tilted_rotors_push_along_their_shafts_and_turn_the_vehicle_against_them(columns, flight):
    """Each rotor by itself, whose shaft is turned by a small angle, with its lever and its reaction."""
    tilt = {"twist_all": 0.002, "twist_1": 0.02, "bend_1": -0.01, "twist_2": 0.004, "bend_2": 0.03}
    found = columns("rotor_tilt", flight).direct @ [tilt.get(c.name, 0.0) for c in CATALOGUE["rotor_tilt"].coefficients]
    twist, bend = [0.012, 0.004, -0.008, 0.0], [-0.005, 0.015, 0.005, -0.015]
    wanted = np.zeros_like(found)
    for rotor, speed, about_arm, outwards in zip(flight.vehicle.rotors, flight.rotor_speed.T, twist, bend, strict=True):
        hub = np.array(rotor.position_m)
        arm = hub / np.hypot(*hub[:2]) * [1.0, 1.0, 0.0]
        lean = about_arm * np.cross([0.0, 0.0, 1.0], arm) + outwards * arm
        force = rotor.thrust_factor_n_s2 * speed[:, None] ** 2 * lean
        wanted[:, 3:] += force
        wanted[:, :3] += np.cross(hub, force) - rotor.spin * rotor.drag_factor_n_m_s2 * speed[:, None] ** 2 * lean
    np.testing.assert_allclose(found, wanted, atol=1e-12)


def test_tilted_rotors_are_told_apart_by_pairs(flight):
    says = CATALOGUE["rotor_tilt"].describe(flight.vehicle, {"twist_all": -0.01, "bend_2": 0.02})
    assert says == "All rotors lean 0.6 deg clockwise; M2 leans 1.1 deg outwards more than M4."


def crossed(number):
    """Rotors between the axes, in turn on both sides of them and of both spins."""
    places = circle(number).rotors
    turn = np.pi / number
    cos, sin = np.cos(turn), np.sin(turn)
    hubs = [(cos * x - sin * y, sin * x + cos * y, z) for x, y, z in (each.position_m for each in places)]
    return VehicleSettings(rotors=tuple(replace(each, position_m=at) for each, at in zip(places, hubs, strict=True)))


def long_cross():
    """An X whose arms are longer along x than along y."""
    hubs = [(0.25, -0.15, 0.0), (-0.25, -0.15, 0.0), (-0.25, 0.15, 0.0), (0.25, 0.15, 0.0)]
    return VehicleSettings(
        rotors=tuple(RotorSettings(position_m=hub, spin=spin) for hub, spin in zip(hubs, (1, -1, 1, -1), strict=True))
    )


@pytest.mark.parametrize("craft", [crossed(4), long_cross()], ids=["X", "long X"])
def test_what_one_spin_of_an_x_lifts_more_turns_roll_into_pitch(flight, craft):
    """Which products of inertia would explain."""
    efforts = 0.2 * flight.body_rate / np.abs(flight.body_rate).max(axis=0)
    hubs, spins = np.array([each.position_m for each in craft.rotors]).T, [each.spin for each in craft.rotors]
    squared = (
        350.0**2
        * np.column_stack([np.ones(len(flight)), efforts])
        @ np.stack([np.ones(4), hubs[1] / 0.3, -hubs[0] / 0.3, spins])
    )
    flown = replace(flight, vehicle=craft, rotor_speed=np.sqrt(squared))
    gains = 0.04 * np.array(spins)
    true = body_wrench(with_gains(craft, gains), flown.rotor_speed)
    found = CATALOGUE["rotor_mismatch"].columns(flown, {}).direct[..., 3] * 0.04
    np.testing.assert_allclose(found[:, :2], (true.body_torque - flown.torque)[:, :2], atol=1e-12)
    assert np.abs(found[:, :2]).max() > 0.01 * np.abs(flown.torque).max()
    np.testing.assert_allclose(found[:, 5], true.thrust - flown.thrust, atol=1e-9)


def test_pairs_face_each_other_and_spin_alike(vehicle):
    assert (opposite_pairs(vehicle), opposite_pairs(circle(6))) == (((0, 2), (1, 3)), ())
    beside = (
        replace(rotor, position_m=(rotor.position_m[0] + 0.01, *rotor.position_m[1:])) for rotor in vehicle.rotors
    )
    assert opposite_pairs(replace(vehicle, rotors=tuple(beside))) == ((0, 2), (1, 3))


@pytest.mark.parametrize("number", [4, 6, 8])
def test_nothing_that_an_inertia_could_stand_in_for_is_left(number):
    modes = gain_modes(circle(number))
    spins = np.array([rotor.spin for rotor in circle(number).rotors])
    np.testing.assert_allclose(modes.T @ np.column_stack([np.ones(number), spins]), 0.0, atol=1e-12)
    assert np.linalg.matrix_rank(modes) == modes.shape[1] == min(number - 2, 4)


def stacked():
    """Two rotors on each of four arms, which turn against each other."""
    hubs = [(0.2 * x, 0.2 * y, z) for z in (0.05, -0.02) for x, y in ((1, -1), (-1, -1), (-1, 1), (1, 1))]
    spins = (1, -1, 1, -1, -1, 1, -1, 1)
    return VehicleSettings(
        rotors=tuple(RotorSettings(position_m=hub, spin=spin) for hub, spin in zip(hubs, spins, strict=True))
    )


@pytest.mark.parametrize("craft", [circle(6), circle(8), stacked()], ids=["six", "eight", "stacked"])
def test_torque_of_one_weak_rotor_is_held_but_for_what_an_inertia_does(flight, craft):
    """Growth along x and y alone leaves a tenth of it and more."""
    hubs, spins = np.array([each.position_m for each in craft.rotors]).T, [each.spin for each in craft.rotors]
    efforts = 0.2 * flight.body_rate / np.abs(flight.body_rate).max(axis=0)
    efforts = np.column_stack([np.ones(len(flight)) + efforts[:, 0] ** 2, efforts])
    squared = 350.0**2 * efforts @ np.stack([np.ones(len(spins)), hubs[1] / 0.3, -hubs[0] / 0.3, spins])
    flown = replace(flight, vehicle=craft, rotor_speed=np.sqrt(squared))
    loss = np.zeros(len(spins))
    loss[2] = -0.04
    change = body_wrench(with_gains(craft, loss, loss), flown.rotor_speed).body_torque - flown.torque
    turned = np.stack([flown.torque @ np.diag(axis) for axis in np.eye(3)], axis=2)
    crossed = flown.torque[:, [1, 0, 2]] * [1.0, 1.0, 0.0]
    own = CATALOGUE["rotor_mismatch"].columns(flown, {}).direct[:, :3]

    def left(places):
        held = np.concatenate([own[..., places], turned, crossed[..., None]], axis=2).reshape(change.size, -1)
        fitted = held @ np.linalg.lstsq(held, change.ravel(), rcond=None)[0]
        return np.linalg.norm(change.ravel() - fitted) / np.linalg.norm(change)

    assert left([0, 1, 2, 4, 5]) < 1e-6
    assert left([0, 1, 2]) > 0.1


@pytest.mark.parametrize(("number", "weak"), [(6, 2), (8, 5)])
def test_one_weak_rotor_of_many_is_found(number, weak):
    """What a growth along x and y alone cannot show: the torque of one rotor."""
    craft, loss = circle(number), np.zeros(number)
    loss[weak] = -0.04
    found = gains(craft, np.linalg.pinv(gain_modes(craft)) @ loss)
    # In eight on a circle a strong one opposite looks the same.
    assert np.argmin(found) == weak
    assert found[weak] == pytest.approx(-0.04)
    assert np.count_nonzero(found) == 1


def test_the_weaker_rotor_is_blamed(vehicle):
    np.testing.assert_allclose(gains(vehicle, np.array([0.06, -0.1])), [0.0, -0.1, -0.06, 0.0])


def step_by_step(link, speed, period):
    """Speeds and accelerations of rotors behind a link, for speeds that are given step by step."""
    rotors = speed.shape[1]

    def build(memory, given):
        passed = link(RotorMotion(Each(given), Each([0.0] * rotors)), memory)
        return *passed.speed, *passed.acceleration

    machine = Machine.of(build, rotors, period)
    return np.split(np.array([machine.advance(tuple(row)) for row in speed.tolist()]), 2, axis=1)


@pytest.mark.parametrize(
    ("name", "shape"), [("motor_lag", {"time_constant_s": 0.05}), ("command_delay", {"delay_s": 0.03})]
)
def test_column_is_true_minus_commanded_wrench(columns, commanded, name, shape):
    true = CATALOGUE[name].apply(commanded, shape)
    assert true.commanded
    change = body_wrench(commanded.vehicle, true.rotor_speed).body_torque - commanded.torque
    found = columns(name, commanded, **shape).direct
    np.testing.assert_allclose(found[:, :3, 0], change, atol=1e-12)
    assert np.abs(found[:, :3]).max() > 0.1


def test_stated_torque_lags_where_rotor_speeds_are_not_logged(columns, flight):
    stated = np.sin(np.outer(flight.time, [3.0, 4.0, 5.0]))
    known = replace(flight, rotor_speed=None, stated_torque=stated, commanded=True)
    found = columns("motor_lag", known, time_constant_s=0.05).direct[..., 0]
    np.testing.assert_allclose(found[:, :3], lagged(stated, 10.0).start - stated, atol=1e-12)
    assert not found[:, 3:].any()


@pytest.mark.parametrize("upper", [(1.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.5, 2.0)])
@pytest.mark.parametrize("frequency", [0.0, 1.0, 3.0, 9.0])
def test_filter_answers_a_wave_as_its_formula_says(upper, frequency):
    natural, damping, period = 3.0, 0.2, 0.002
    time = period * np.arange(5000)
    s = 1j * frequency / natural
    gain = np.polyval(upper, s) / np.polyval((1.0, 2 * damping, 1.0), s)
    wave = np.exp(2j * np.pi * frequency * time)
    found = second_order(natural, damping, period, upper).along(wave)
    np.testing.assert_allclose(found[-500:], gain * wave[-500:], atol=2e-3)


@pytest.mark.parametrize(("name", "breadth"), [("notch_filter", "width"), ("low_pass_filter", "damping")])
def test_a_filter_passes_rotors_step_by_step_as_along_a_flight(commanded, name, breadth):
    known, shape = CATALOGUE[name], {"frequency_hz": 4.0, breadth: 0.7}
    link = known.actuation.link
    speed, acceleration = step_by_step(lambda one, memory: link(one, shape, memory), commanded.speed, commanded.period)
    np.testing.assert_allclose(speed, known.apply(commanded, shape).speed, rtol=1e-12)
    assert not acceleration.any()


def test_battery_takes_the_same_share_of_thrust_and_torque(columns, commanded):
    found = columns("battery_sag", commanded, exponent=1.5).direct[..., 0]
    np.testing.assert_allclose(found, (commanded.voltage**1.5 - 1)[:, None] * commanded.wrench, atol=1e-9)


def test_only_measured_rotors_can_be_late_and_only_commands_can_lag(flight, commanded):
    assert CATALOGUE["channel_delay"].missing(commanded) == ("measured_rotor_speed",)
    assert not CATALOGUE["channel_delay"].missing(flight)
    for name in ("motor_lag", "command_delay", "notch_filter", "low_pass_filter"):
        assert CATALOGUE[name].missing(flight) == ("command",)
        assert not CATALOGUE[name].missing(commanded)


def test_sag_is_looked_for_in_any_rotor_speeds_with_a_voltage(flight, commanded):
    sag = CATALOGUE["battery_sag"]
    assert not sag.missing(flight)
    assert not sag.missing(commanded)
    assert sag.missing(replace(flight, voltage=None)) == ("voltage",)


def test_what_is_applied_before_other_columns_is_what_its_column_says(columns, flight, commanded):
    """The search exchanges the actuation instead of subtracting a column; both must mean the same."""
    actuators = [entry for entry in CATALOGUE.values() if entry.kind == "actuator"]
    others = {"motor_lag", "notch_filter", "low_pass_filter", "command_delay", "battery_sag", "channel_delay"}
    assert {entry.name for entry in actuators} == {*others, "drag_factor_error"}
    for entry in actuators:
        known = flight if entry.name == "channel_delay" else commanded
        shape = {one.name: one.grid[-1] for one in entry.shapes}
        change = entry.apply(known, shape).wrench - known.wrench
        np.testing.assert_allclose(columns(entry.name, known, **shape).direct[..., 0], change, atol=1e-12)


@pytest.mark.parametrize("steps", [0.0, 0.4, 1.0, 2.0, 2.3])
def test_a_delay_taken_step_by_step_is_that_along_a_flight(commanded, steps):
    speed, _ = step_by_step(lambda one, memory: memory.delayed(one, steps), commanded.speed, 1.0)
    np.testing.assert_allclose(speed, delayed(commanded.speed, steps, "linear"), rtol=1e-12)


@pytest.mark.parametrize("ratio", [0.0, 0.3, 3.0])
def test_a_lag_taken_step_by_step_is_that_of_what_stays_the_same_during_each_step(commanded, ratio):
    speed = commanded.speed
    middle, _ = step_by_step(
        lambda one, memory: one._replace(speed=memory.lagged(one.speed, ratio, speed[0])), speed, 1.0
    )
    expected = speed + (lagged(speed, ratio, "previous").start - speed) * (np.exp(-0.5 / ratio) if ratio else 0.0)
    np.testing.assert_allclose(middle, expected, rtol=1e-12)
