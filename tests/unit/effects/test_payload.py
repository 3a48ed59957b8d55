"""The load on a cable against Lagrange's equations in angles, and against forces in balance."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from cpfls_cli import rotations
from cpfls_cli.effects.catalogue.payload import _Balance, _Way, integrate, settled_swing, swing
from cpfls_cli.effects.signals import Signals

GRAVITY = np.array([0.0, 0.0, 9.81])
HANGING = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])
TIME = np.arange(0.0, 8.0, 0.01)
LEVEL = {"length_m": 1.0, "damping_1_s": 0.2, "depth_m": 0.0}


def lagrange(felt, length, damping):
    def rate(t, state):
        a, b, da, db = state
        along_a = np.array([np.cos(a), -np.sin(a) * np.sin(b), np.sin(a) * np.cos(b)])
        along_b = np.array([0.0, np.cos(a) * np.cos(b), np.cos(a) * np.sin(b)])
        dda = -np.sin(a) * np.cos(a) * db**2 - felt(t) @ along_a / length - damping * da
        ddb = 2 * np.tan(a) * da * db - felt(t) @ along_b / (length * np.cos(a) ** 2) - damping * db
        return [da, db, dda, ddb]

    return rate


def hanging(felt, time, length, damping, start=(0.0, 0.0, 0.0, 0.0)):
    solved = solve_ivp(lagrange(felt, length, damping), time[[0, -1]], start, t_eval=time, rtol=1e-9, atol=1e-10)
    # Cable from an elevation about the world's x and a turn about it: regular where the cable hangs.
    a, b = solved.y[:2]
    return np.array([np.sin(a), np.cos(a) * np.sin(b), -np.cos(a) * np.cos(b)]).T


def push(t):
    """Acceleration of the hook plus gravity: large enough for swings of half a radian in both directions."""
    t = np.asarray(t)
    return np.stack([2.5 * np.sin(2.1 * t), 2.0 * np.sin(1.4 * t + 1.0), 9.81 + 1.5 * np.sin(3.0 * t)], axis=-1)


def test_integration_agrees_with_lagrange_and_keeps_the_energy():
    step, length, damping = 0.02, 1.5, 0.1
    at = np.arange(0.0, 8.0, step)
    found = integrate(push(at), push(at[:-1] + step / 2), step, length, damping, HANGING)
    expected = hanging(push, at, length, damping)
    np.testing.assert_allclose(found[:, :3], expected, atol=1e-5)
    np.testing.assert_allclose(found[:, 3:], CubicSpline(at, expected)(at, 1), atol=5e-3)
    assert np.abs(expected[:, :2]).max(axis=0).min() > 0.4
    step, length, steps = 0.02, 1.0, 600
    pulse = np.array([[6.0, -4.0, 9.81]] * 20 + [GRAVITY.tolist()] * (steps - 20))
    found = integrate(pulse, pulse[:-1], step, length, 0.0, HANGING)[25:]
    energy = 0.5 * length * (found[:, 3:] ** 2).sum(axis=1) + 9.81 * found[:, 2]
    np.testing.assert_allclose(energy, energy[0], rtol=2e-5)
    np.testing.assert_allclose((found[:, :3] ** 2).sum(axis=1), 1.0, atol=1e-12)
    assert np.abs((found[:, :3] * found[:, 3:]).sum(axis=1)).max() < 1e-12


def tumbling(vehicle, time=TIME):
    """A flight of which position, attitude, rates and the way of any of its points are known by formula."""
    position = np.column_stack([0.6 * np.sin(2.0 * time), 0.5 * np.sin(1.3 * time + 1), 0.2 * np.cos(2.5 * time)])
    attitude = np.column_stack([0.3 * np.sin(2.2 * time), 0.25 * np.sin(1.7 * time + 2), 0.5 * np.sin(0.6 * time)])
    move, turn = CubicSpline(time, position), CubicSpline(time, attitude)
    return Signals(
        time=time,
        vehicle=vehicle,
        attitude=attitude,
        body_rate=rotations.body_rate(attitude, turn(time, 1)),
        position=position,
        velocity=move(time, 1),
        acceleration=move(time, 2),
    )


def hook_way(signals, depth):
    rotation = Rotation.from_euler("ZYX", signals.attitude[:, ::-1])
    return CubicSpline(TIME, signals.position + rotation.apply([0.0, 0.0, -depth]))


def test_a_start_further_out_than_the_cable_is_long_is_at_rest(flight):
    found = _Way.of(flight, 1.5, 0.2, 0.0).swing(np.array([0.9, 0.9, 0.1, 0.0]))
    np.testing.assert_array_equal(found, np.broadcast_to(HANGING, found.shape))


@pytest.mark.parametrize("depth", [0.0, 0.2])
@pytest.mark.parametrize("accelerometer", [True, False])
def test_swing_under_a_hook_that_tumbles_with_the_vehicle(flight, depth, accelerometer):
    signals = tumbling(flight.vehicle)
    signals = signals if accelerometer else replace(signals, acceleration=None)
    way = hook_way(signals, depth)
    expected = hanging(lambda t: way(t, 2) + GRAVITY, TIME, 1.5, 0.2)
    np.testing.assert_allclose(swing(signals, 1.5, 0.2, depth)[:, :3], expected, atol=0.01)
    assert np.abs(expected[:, :2]).max() > 0.3


def test_noise_of_the_accelerometer_moves_the_swing_no_more_than_without_its_steps(flight):
    """Next to an integration that takes each sample, at a hundredth of a second, in its turn."""
    signals, step = tumbling(flight.vehicle), 0.01
    coarse, fine = [], []
    for seed in range(8):
        noise = 2.0 * np.random.default_rng(seed).standard_normal(signals.acceleration.shape)
        noisy = replace(signals, acceleration=signals.acceleration + noise)
        coarse.append(swing(noisy, 1.5, 0.2)[:, :2] - swing(signals, 1.5, 0.2)[:, :2])
        whole = [
            integrate(felt, 0.5 * (felt[:-1] + felt[1:]), step, 1.5, 0.2, HANGING)[:, :2]
            for felt in (noisy.acceleration + GRAVITY, signals.acceleration + GRAVITY)
        ]
        fine.append(whole[0] - whole[1])
    size = [np.sqrt(np.mean(np.square(apart))) for apart in (coarse, fine)]
    assert size[0] < 1.1 * size[1]
    assert size[1] > 0.03


@pytest.mark.parametrize("size", [300, 30000])
def test_a_jump_of_the_velocity_leaves_the_swing_before_it(columns, flight, size):
    """As at the end of a crash: beyond what steps can follow it hangs at rest, and what was before stays."""
    jump = size * (np.arange(len(flight)) >= len(flight) - 12)[:, None] * np.cumsum(np.ones((len(flight), 3)), axis=0)
    thrown = replace(flight, velocity=flight.velocity + jump, acceleration=None, specific_force=None)
    calm = replace(thrown, velocity=flight.velocity)
    swung, before = (swing(each, 0.05, 0.1) for each in (thrown, calm))
    assert np.isfinite(swung).all()
    half = len(flight) // 2
    np.testing.assert_allclose(swung[:half], before[:half], atol=0.01)
    for length in (0.05, 0.3, 4.0):
        assert np.isfinite(columns("payload", thrown, length_m=length, damping_1_s=0.1, depth_m=0.0).direct).all()


def test_force_is_what_the_load_needs_besides_its_weight(columns, flight):
    """Newton's law of the load itself, which the cable alone accelerates."""
    length, depth = 1.5, 0.1
    signals = tumbling(flight.vehicle)
    way = hook_way(signals, depth)
    load = CubicSpline(TIME, way(TIME) + length * hanging(lambda t: way(t, 2) + GRAVITY, TIME, length, 0.0))
    pull = Rotation.from_euler("ZYX", signals.attitude[:, ::-1]).inv().apply(-(load(TIME, 2) + GRAVITY))
    found = columns("payload", signals, length_m=length, damping_1_s=0.0, depth_m=depth).direct
    inside = slice(30, -30)
    np.testing.assert_allclose(found[inside, 3:, 3], pull[inside], atol=0.15)
    for column, hook in enumerate(np.array([[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]])):
        np.testing.assert_allclose(found[inside, :3, column], np.cross(hook, pull)[inside], atol=0.15)
        assert not found[:, 3:, column].any()


def balanced(signals, start, length=1.5, damping=0.1, load=0.6):
    """A level flight whose thrust and attitude are such that vehicle and load obey Newton's law, and its cable."""
    time = signals.time
    way = CubicSpline(time, 0.5 * signals.position)
    cable = hanging(lambda t: way(t, 2) + GRAVITY, time, length, damping, start)
    felt = way(time, 2) + GRAVITY
    tension = length * (CubicSpline(time, cable)(time, 1) ** 2).sum(axis=1) - (felt * cable).sum(axis=1)
    thrust = signals.vehicle.mass_kg * felt - load * tension[:, None] * cable
    size = np.linalg.norm(thrust, axis=1)
    roll, pitch = -np.arcsin(thrust[:, 1] / size), np.arctan2(thrust[:, 0], thrust[:, 2])
    return replace(
        signals,
        attitude=np.column_stack([roll, pitch, np.zeros_like(roll)]),
        velocity=way(time, 1),
        acceleration=way(time, 2),
        stated_thrust=size,
    ), cable[:, :2]


def off(found, cable):
    return np.sqrt(np.mean((found - cable) ** 2))


def test_a_load_that_swings_from_the_start_is_followed_all_flight_long(flight):
    level, cable = balanced(tumbling(flight.vehicle), (0.12, -0.15, 0.3, 0.2))
    assert off(swing(level, 1.5, 0.1)[:, :2], cable) > 0.09
    assert off(settled_swing(level, 1.5, 0.1)[:, :2], cable) < 0.02
    # Slower than a small one, so that it is not the driven swing and a free one next to it.
    long = tumbling(flight.vehicle, np.arange(0.0, 25.0, 0.01))
    level, cable = balanced(long, (0.4, -0.35, 0.8, 0.7), damping=0.02)
    assert off(settled_swing(level, 1.5, 0.02)[:, :2], cable) < 0.02


def test_in_gusts_all_of_a_flight_shows_the_start(flight):
    """In gusts of a hundredth of the weight that last a second: two swings alone leave twice as much."""
    level, cable = balanced(tumbling(flight.vehicle, np.arange(0.0, 25.0, 0.01)), (0.12, -0.15, 0.3, 0.2))
    found = []
    for seed in range(6):
        gust = lfilter([1.0], [1.0, -0.99], np.random.default_rng(seed).standard_normal((len(cable), 2)), axis=0)
        tilted = level.attitude + np.pad(0.01 * gust * np.sqrt(1 - 0.99**2), ((0, 0), (0, 1)))
        found.append(off(settled_swing(replace(level, attitude=tilted), 1.5, 0.1)[:, :2], cable))
    assert np.mean(found) < 0.02


def test_a_gust_in_the_first_swings_does_not_hide_the_later_ones(flight):
    """Over two periods it pushes against the load, which seems to weigh less than nothing."""
    long = tumbling(flight.vehicle, np.arange(0.0, 40.0, 0.01))
    start = (0.12, -0.15, 0.3, 0.2)
    (level, cable), (bare, _) = (balanced(long, start, damping=0.05, load=load) for load in (0.6, 0.0))
    early = (np.sqrt(9.81 / 1.5) * long.time < 2 * 2 * np.pi)[:, None]
    blown = replace(level, attitude=level.attitude + early * 1.5 * (bare.attitude - level.attitude))
    assert off(swing(level, 1.5, 0.05)[:, :2], cable) > 0.07
    assert off(settled_swing(blown, 1.5, 0.05)[:, :2], cable) < 0.03


@pytest.mark.parametrize("load", [1e-1, 1e-3, 1e-6, 1e-9])
def test_a_start_that_would_throw_the_load_about_is_none(flight, load):
    """Of forces that a load all but massless would have to be started beyond all numbers for."""
    way = _Way.of(tumbling(flight.vehicle), 1.5, 0.1, 0.0)
    rest, spun = way.pull(np.zeros(4)), way.pull(np.array([0.0, 0.0, 1e-4, 0.0]))
    assert _Balance(way, load * rest + (spun - rest) / 1e-4, np.zeros_like(rest)).start(np.zeros(4), 2) is None


def test_what_rings_late_in_a_flight_is_no_swing_at_its_start(flight):
    """A gust at the frequency of the load, from the third period on, of which the swing knows nothing."""
    level, cable = balanced(tumbling(flight.vehicle), (0.0, 0.0, 0.0, 0.0))
    natural = np.sqrt(9.81 / 1.5)
    gust = np.where(natural * TIME > 2.1 * 2 * np.pi, 0.02 * np.sin(natural * TIME), 0.0)
    blown = replace(level, attitude=level.attitude + gust[:, None] * [1.0, 1.0, 0.0])
    assert off(settled_swing(blown, 1.5, 0.1)[:, :2], cable) < 0.01


def test_cable_pulls_along_gravity_where_the_velocity_is_constant(columns, flight, with_velocity):
    level = replace(with_velocity(flight, [5.0, -2.0, 0.0]), attitude=np.zeros_like(flight.attitude))
    found = columns("payload", level, **LEVEL).direct
    expected = [-0.01 * 9.81, 0.02 * 9.81, 0, 0, 0, -0.6 * 9.81]
    # Hook behind and to the left: its load raises the nose and drops the left side.
    np.testing.assert_allclose(found @ [0.06, -0.01, -0.02, 0.6], [expected] * len(level), atol=1e-8)


def test_a_cable_rights_a_tilted_vehicle_and_pulls_harder_in_a_climb(columns, flight, with_velocity):
    tilted = replace(with_velocity(flight, [0.0, 0.0, 0.0]), attitude=np.full_like(flight.attitude, [0.2, 0.0, 0.0]))
    torque = columns("payload", tilted, **LEVEL).direct[:, :3, 0]
    np.testing.assert_allclose(torque, [[-9.81 * np.sin(0.2), 0.0, 0.0]] * len(tilted), atol=1e-9)
    rising = replace(with_velocity(flight, [0.0, 0.0, 0.0]), acceleration=np.tile([0.0, 0.0, 2.0], (len(flight), 1)))
    force = columns("payload", replace(rising, rotor_speed=None), **LEVEL).direct[:, 3:, 3]
    np.testing.assert_allclose(np.linalg.norm(force, axis=1), 11.81)
