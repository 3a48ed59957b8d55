"""A torque that no model knows, from flights through the windows: the signal it follows."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.weak_flight import weak_flight
from cpfls_cli.gap.residual.dependence import joined_states, rank_dependence, state_signals, without_actuation
from cpfls_cli.inertia import symmetric
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import blocks_of, windows

VEHICLE = VehicleSettings()
TENSOR = symmetric(VEHICLE.inertia_kg_m2)
TIME = 0.01 * np.arange(3000)
WINDOWS = windows(0.01, 0.4, 0.5)
UNKNOWN = {
    "air velocity y": lambda signals: 0.1 * signals.air_velocity[:, 1] * np.abs(signals.air_velocity[:, 1]),
    "body rate z": lambda signals: 0.4 * np.tanh(signals.body_rate[:, 2] / 0.1),
    "height": lambda signals: 3.0 / signals.position[:, 2] ** 2,
    "yaw": lambda signals: 0.3 * np.cos(3 * signals.attitude[:, 2]),
}


def wander(rng, size, smooth_s):
    values = gaussian_filter1d(rng.standard_normal((3000, 3)), smooth_s / 0.01, axis=0)
    return size * values / values.std(axis=0)


def wandering_flight(rng, unknown):
    rate = wander(rng, 0.4, 0.25)
    attitude = np.column_stack([wander(rng, 0.15, 0.6)[:, :2], 0.4 * TIME + wander(rng, 1.0, 2.0)[:, 2]])
    position = wander(rng, 0.5, 1.5) + np.array([0, 0, 2.5])
    moved = Signals(
        time=TIME,
        body_rate=rate,
        vehicle=VEHICLE,
        attitude=attitude,
        velocity=wander(rng, 2.0, 1.0),
        position=np.maximum(position, 0.6),
    )
    torque = np.gradient(rate, 0.01, axis=0) @ TENSOR + np.cross(rate, rate @ TENSOR)
    torque[:, 0] -= unknown(moved)
    torque += 2.0 * rng.standard_normal(torque.shape)
    return replace(moved, stated_torque=torque)


@pytest.mark.parametrize("signal", UNKNOWN)
def test_the_signal_that_an_unknown_torque_follows_is_named(signal):
    rng = np.random.default_rng(7)
    flights = [wandering_flight(rng, UNKNOWN[signal]) for _ in range(3)]
    weak = [weak_flight(signals, WINDOWS, None, force=False) for signals in flights]
    residual = np.concatenate([w.averaged(w.residual(s)) for w, s in zip(weak, flights, strict=True)])
    flight_index = np.repeat(np.arange(3), [len(w) for w in weak])
    block = blocks_of(flight_index, np.concatenate([w.windows.centres(TIME) for w in weak]), 4.0)
    state = joined_states([state_signals(w, s) for w, s in zip(weak, flights, strict=True)])
    best = rank_dependence(residual, flight_index, block, without_actuation(state), 99, rng)[0]
    assert (best.channel, best.signal) == ("torque x", signal)
    assert best.p_value == 0.01
    assert set(state) - set(without_actuation(state)) == {f"rotor torque {axis}" for axis in "xyz"}
