"""Signals of the state over windows."""

import numpy as np
import pytest

from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.weak_flight import weak_flight
from cpfls_cli.gap.balance.windows import windows
from cpfls_cli.gap.residual.state_signals import joined_states, state_signals
from cpfls_cli.vehicle.settings import VehicleSettings

TIME = 5.0 + 0.01 * np.arange(1000)
VEHICLE = VehicleSettings()


def flight(**given):
    rate = np.column_stack([np.sin(TIME), np.cos(TIME), 0.1 * TIME])
    signals = Signals(time=TIME, body_rate=rate, vehicle=VEHICLE, **given)
    return weak_flight("one", signals, windows(0.01, 0.4, 0.5), None, force=False), signals


def test_a_full_flight_has_every_signal_and_a_bare_one_its_rates():
    turning = np.column_stack([0.1 * np.ones(1000), np.zeros(1000), 0.9 * TIME])
    full = state_signals(
        *flight(
            attitude=turning,
            velocity=np.column_stack([3 + 0 * TIME, 4 + 0 * TIME, 0.5 + 0 * TIME]),
            position=np.column_stack([TIME, TIME, 2 * TIME]),
            rotor_speed=np.full((1000, 4), 348.0),
            voltage=np.ones(1000),
        )
    )
    assert len(full) == 1 + 3 + 3 + 3 + 3 + 1 + 4 + 1 + 3 + 1
    assert full["horizontal speed"] == pytest.approx(5)
    assert full["vertical speed"] == pytest.approx(0.5)
    assert full["thrust"] == pytest.approx(4 * 121.5e-6 * 348.0**2)
    assert full["height"] == pytest.approx(2 * (full["time"] + TIME[0]))
    bare = state_signals(*flight())
    assert set(bare) == {"time", "body rate x", "body rate y", "body rate z"}


def test_a_turn_through_half_a_turn_does_not_average_to_zero():
    yaw = (0.9 * TIME + np.pi) % (2 * np.pi) - np.pi
    state = state_signals(*flight(attitude=np.column_stack([0 * yaw, 0 * yaw, yaw])))
    np.testing.assert_allclose(np.exp(1j * state["yaw"]), np.exp(0.9j * (state["time"] + TIME[0])), atol=1e-9)


def test_what_a_flight_lacks_is_not_a_number_there():
    with_voltage, without = state_signals(*flight(voltage=np.ones(1000))), state_signals(*flight())
    joined = joined_states([without, with_voltage])
    assert np.isnan(joined["voltage"][: len(without["time"])]).all()
    assert joined["voltage"][len(without["time"]) :] == pytest.approx(1)
    assert np.isfinite(joined["body rate x"]).all()
