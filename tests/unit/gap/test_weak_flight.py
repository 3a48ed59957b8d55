"""A flight as rows of the balance, and its inertial torque and force in momentum form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cpfls_cli import rotations
from cpfls_cli.effects.effect import Columns
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.weak_flight import (
    Candidate,
    actuated,
    columns_of,
    rotation_balance,
    translation_balance,
    weak_flight,
)
from cpfls_cli.gap.naming.open_questions import bends_of
from cpfls_cli.regressor.regressor import InertiaValues
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings
from cpfls_cli.weak_form.windows import windows
from tests.builders.gap_flights import THROUGH, VEHICLE, candidate, effect_wrench, fly, sines, weak

EFFECTS = [
    (candidate("products_of_inertia"), [0.03, -0.02, 0.01]),
    (candidate("rotor_drag"), [1.3e-3]),
    (candidate("rotor_acceleration"), [5e-5]),
]
TENSOR = np.array([[0.6, 0.03, -0.02], [0.03, 0.7, 0.04], [-0.02, 0.04, 1.2]])
COUPLED = VehicleSettings(inertia_kg_m2=(0.6, 0.7, 1.2, 0.03, -0.02, 0.04))
TIME = 0.005 * np.arange(1600)
ATTITUDE, RATE, SECOND = sines(TIME, [0.4, 0.3, 0.8], 0.2, 1.0, np.random.default_rng(0))
VELOCITY, ACCELERATION, _ = sines(TIME, [3.0, 2.0, 1.0], 0.1, 0.6, np.random.default_rng(1))
FLIGHT = Signals(
    time=TIME,
    vehicle=COUPLED,
    attitude=ATTITUDE,
    body_rate=rotations.body_rate(ATTITUDE, RATE),
    velocity=VELOCITY,
    stated_thrust=np.full(len(TIME), 58.86),
)
AVERAGED = windows(0.005, 0.4, 0.5)


def test_nothing_is_left_of_a_flight_without_an_effect():
    flight = weak(fly(0), force=True)
    np.testing.assert_allclose(flight.averaged(flight.residual(flight.signals)), 0.0, atol=2e-5)
    assert np.abs(flight.averaged(flight.inertial)).max() > 1


def test_what_is_left_is_the_wrench_of_the_effects_and_their_rows():
    signals = fly(1, EFFECTS)
    flight = weak(signals, force=True)
    left = flight.averaged(flight.residual(signals))
    rows = sum(flight.rows(chosen, signals) @ np.array(values) for chosen, values in EFFECTS)
    np.testing.assert_allclose(left, rows, atol=2e-4)
    whole = replace(flight, offset_share=np.zeros(6)).averaged(flight.residual(signals))
    np.testing.assert_allclose(whole, THROUGH.average(effect_wrench(signals, EFFECTS)), atol=2e-4)
    assert np.abs(left).max(axis=0).min() > 0.01 or np.abs(left[:, 5]).max() < 1e-3


def test_what_is_kept_of_a_flight_is_that_of_the_formula_that_was_asked_for():
    """A bend over speed takes the usual one of all flights, and a flight may be judged next to some and then others."""
    signals = fly(1, EFFECTS)
    flight, faster = weak(signals, force=True), weak(replace(signals, velocity=3 * signals.velocity), force=True)
    assert weak(signals, force=True) is flight
    (alone, _), (faster_too, _) = (bends_of([candidate("rotor_drag")], each) for each in ([flight], [flight, faster]))
    for bend in (alone, faster_too):
        fresh = weak(replace(signals), force=True)
        rows = [each.rows(Candidate(bend, {}), each.signals) for each in (flight, fresh)]
        np.testing.assert_array_equal(*rows)
        assert rows[0].any()


def test_unknown_channels_are_zero():
    flight = weak(fly(1, EFFECTS), force=False)
    assert flight.known.tolist() == [True] * 3 + [False] * 3
    everything = Columns(np.ones((len(flight.signals), 6, 2)))
    assert flight.averaged(everything)[:, 3:].any() == False  # noqa: E712
    np.testing.assert_allclose(flight.averaged(everything)[:, :3], 1.0)
    assert weak(replace(fly(1), specific_force=None, velocity=None), force=True).known[3:].tolist() == [False] * 3


def test_rows_with_a_random_offset_of_the_accelerometer_and_noise_are_independent():
    floor = np.full(6, 5.0)
    flight = weak_flight(replace(FLIGHT, specific_force=ACCELERATION), AVERAGED, None, force=True, floor=floor)
    every = np.eye(len(flight))
    taken = np.moveaxis(flight.of_channels(np.repeat(every[:, None], 6, axis=1)), 1, 0)
    offset = 0.1 * COUPLED.mass_kg
    np.testing.assert_allclose(
        taken[3:] @ (25 * every + offset**2) @ taken[3:].swapaxes(1, 2), [25 * every] * 3, atol=1e-9
    )
    assert 0.01 < 1 - taken[5].sum() / len(flight) < 0.5
    np.testing.assert_allclose(flight.motion[:, 3:], COUPLED.mass_kg * AVERAGED.average(ACCELERATION), atol=1e-9)


def test_rows_are_computed_once_on_the_logged_signals_only():
    signals = fly(2)
    flight, drag = weak(signals), candidate("rotor_drag")
    assert flight.rows(drag, signals) is flight.rows(candidate("rotor_drag"), signals)
    slower = signals.with_rotor_speed(0.5 * signals.speed)
    np.testing.assert_allclose(flight.rows(drag, slower), 0.5 * flight.rows(drag, signals))
    assert len(flight.seen) == 1


def test_actuators_that_lack_their_signals_leave_a_flight_alone():
    signals = fly(3)
    lag, delay = candidate("motor_lag", time_constant_s=0.05), candidate("channel_delay", delay_s=0.02)
    assert actuated(signals, [lag, candidate("battery_sag", exponent=2.0)]) is signals
    assert actuated(signals, [candidate("rotor_drag")]) is signals
    np.testing.assert_allclose(actuated(signals, [delay, lag]).speed[2:], signals.speed[:-2])
    commanded = replace(signals, commanded=True)
    assert actuated(commanded, [lag]) is not commanded


def test_flights_stand_one_after_another_and_lacking_signals_are_zeros():
    long, short = fly(4), fly(5, seconds=12.0)
    blind = replace(short, velocity=None)
    both = system([weak(long), weak(blind)])
    drag = both.columns(candidate("rotor_drag"))
    first = len(weak(long))
    assert both.flight_index.tolist() == [0] * first + [1] * len(weak(short))
    np.testing.assert_array_equal(drag[:first], weak(long).rows(candidate("rotor_drag"), long))
    assert not drag[first:].any()
    assert both.can(candidate("rotor_drag"))
    assert not both.can(candidate("motor_lag"))


def test_an_effect_of_unit_coefficient_is_subtracted_and_a_free_one_becomes_columns():
    signals = replace(fly(6), ground_height_m=29.0)
    ground, drag = candidate("ground_effect", G=1.0), candidate("rotor_drag")
    plain, with_both = system([weak(signals)]), system([weak(signals)], [ground, drag])
    expected = plain.residual - THROUGH.average(columns_of(ground, signals).direct)[..., 0] * weak(signals).known
    np.testing.assert_allclose(with_both.residual, expected, atol=1e-12)
    assert with_both.base.shape[2] == plain.base.shape[2] + 1
    assert [free.effect.name for free in with_both.free] == ["parameter_error", "rotor_drag"]
    assert VEHICLE.mass_kg == 6


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_momentum_is_never_differentiated(noise):
    """Noise of a gyroscope of white samples would give 0.6 * 0.01 / 0.01 = 0.6 N m if it were."""
    flight = weak(fly(7, gyro=noise))
    assert flight.averaged(flight.residual(flight.signals))[:, :3].std() < 0.05


def averaged(balance):
    momentum = np.zeros_like(balance.direct) if balance.momentum is None else balance.momentum
    return AVERAGED.average(balance.direct) + AVERAGED.derivative(momentum)


def test_rigid_body_is_newton_and_euler():
    turning = rotations.body_acceleration(ATTITUDE, RATE, SECOND)
    expected = turning @ TENSOR + np.cross(FLIGHT.body_rate, FLIGHT.body_rate @ TENSOR)
    np.testing.assert_allclose(averaged(rotation_balance(FLIGHT)), AVERAGED.average(expected), atol=2e-6)
    assert np.abs(expected).max() > 1


class Patterned:
    """A positive definite J(q) that belongs to no body: constants plus waves along each angle."""

    def __init__(self):
        self.waves = [0.05 * (wave + wave.T) for wave in np.random.default_rng(2).standard_normal((3, 3, 3))]

    def inertia(self, attitude):
        value = np.tile(TENSOR, (len(attitude), 1, 1))
        gradient = np.zeros((len(attitude), 3, 3, 3))
        for angle, wave in enumerate(self.waves):
            value += np.sin(2 * attitude[:, angle])[:, None, None] * wave
            gradient[:, angle] = 2 * np.cos(2 * attitude[:, angle])[:, None, None] * wave
        return InertiaValues(value, gradient)


def lagrange_torque(model):
    """J qdd + C qd with the symbols of Christoffel, entry by entry."""
    found = model.inertia(ATTITUDE)
    D = found.gradient
    torque = np.einsum("nij,nj->ni", found.value, SECOND)
    for i in range(3):
        for j in range(3):
            for k in range(3):
                symbol = 0.5 * (D[:, k, i, j] + D[:, j, i, k] - D[:, i, j, k])
                torque[:, i] += symbol * RATE[:, j] * RATE[:, k]
    return torque


def test_a_model_in_euler_coordinates_is_lagrange_turned_to_the_body_and_needs_the_attitude():
    model = Patterned()
    expected = rotations.body_torque(ATTITUDE, lagrange_torque(model))
    np.testing.assert_allclose(averaged(rotation_balance(FLIGHT, model)), AVERAGED.average(expected), atol=2e-5)
    assert np.abs(expected - rotations.body_torque(ATTITUDE, SECOND @ TENSOR)).max() > 0.1
    blind = replace(FLIGHT, attitude=None)
    np.testing.assert_array_equal(rotation_balance(blind).momentum, rotation_balance(FLIGHT).momentum)
    with pytest.raises(InputError, match="needs the attitude"):
        rotation_balance(blind, Patterned())


@pytest.mark.parametrize(
    "known",
    [{}, {"acceleration": ACCELERATION}, {"acceleration": 99 * ACCELERATION, "specific_force": "felt"}],
    ids=["velocity", "acceleration", "accelerometer first"],
)
def test_force_is_what_an_accelerometer_feels_times_the_mass(known):
    felt = Rotation.from_euler("ZYX", ATTITUDE[:, ::-1]).inv().apply(ACCELERATION + np.array([0.0, 0.0, 9.81]))
    given = {name: felt if isinstance(value, str) else value for name, value in known.items()}
    found = averaged(translation_balance(replace(FLIGHT, **given)))
    np.testing.assert_allclose(found, 6.0 * AVERAGED.average(felt), atol=2e-5)


def test_a_number_that_force_identifies_has_no_torque_without_an_accelerometer():
    """What one spin of an X lifts more turns roll into pitch, by a torque that other errors look like."""
    angles = np.pi / 4 + np.pi / 2 * np.arange(4)
    hubs = [(0.25 * float(np.cos(a)), 0.25 * float(np.sin(a)), 0.0) for a in angles]
    rotors = tuple(RotorSettings(position_m=hub, spin=(-1) ** place) for place, hub in enumerate(hubs))
    without = replace(fly(1), vehicle=VehicleSettings(rotors=rotors), specific_force=None)
    felt = replace(without, specific_force=np.zeros((len(without), 3)))
    lift, less = (columns_of(candidate("rotor_mismatch"), each).direct[..., 3] for each in (felt, without))
    assert np.abs(lift[:, :2]).max() > 0
    assert not less[:, :3].any()
    np.testing.assert_array_equal(less[:, 3:], lift[:, 3:])
