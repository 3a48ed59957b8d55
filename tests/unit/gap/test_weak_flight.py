"""Rows of the balance: nothing is left of a flight without an effect, and the effect of one with it."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.effect import Columns
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.weak_flight import actuated, columns_of
from tests.builders.gap_flights import THROUGH, VEHICLE, candidate, effect_wrench, fly, weak

EFFECTS = [
    (candidate("products_of_inertia"), [0.03, -0.02, 0.01]),
    (candidate("rotor_drag"), [1.3e-3]),
    (candidate("rotor_acceleration"), [5e-5]),
]


def test_nothing_is_left_of_a_flight_without_an_effect():
    flight = weak(fly(0), force=True)
    left = flight.averaged(flight.residual(flight.signals))
    np.testing.assert_allclose(left, 0.0, atol=2e-5)
    assert np.abs(flight.averaged(flight.inertial)).max() > 1


def test_what_is_left_is_the_wrench_of_the_effects_and_their_rows():
    signals = fly(1, EFFECTS)
    flight = weak(signals, force=True)
    left = flight.averaged(flight.residual(signals))
    rows = sum(flight.rows(chosen, signals) @ np.array(values) for chosen, values in EFFECTS)
    np.testing.assert_allclose(left, rows, atol=2e-4)
    np.testing.assert_allclose(left, THROUGH.average(effect_wrench(signals, EFFECTS)), atol=2e-4)
    assert np.abs(left).max(axis=0).min() > 0.01 or np.abs(left[:, 5]).max() < 1e-3


def test_unknown_channels_are_zero():
    flight = weak(fly(1, EFFECTS), force=False)
    assert flight.known.tolist() == [True] * 3 + [False] * 3
    everything = Columns(np.ones((len(flight.signals), 6, 2)))
    assert flight.averaged(everything)[:, 3:].any() == False  # noqa: E712
    np.testing.assert_allclose(flight.averaged(everything)[:, :3], 1.0)
    assert weak(replace(fly(1), specific_force=None, velocity=None), force=True).known[3:].tolist() == [False] * 3


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
    moved = actuated(signals, [delay, lag])
    np.testing.assert_allclose(moved.speed[2:], signals.speed[:-2])
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
    left = flight.averaged(flight.residual(flight.signals))[:, :3]
    assert left.std() < 0.05
