"""A periodic torque that no model knows: its frequency and its energy, from a flight through the windows."""

import numpy as np
import pytest
from scipy.signal import lfilter

from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.weak_flight import weak_flight
from cpfls_cli.gap.naming.open_questions import narrow_band
from cpfls_cli.inertia import symmetric
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import windows

VEHICLE = VehicleSettings()
TENSOR = symmetric(VEHICLE.inertia_kg_m2)
PERIOD, SAMPLES = 0.01, 3000
WINDOWS = windows(PERIOD, 0.4, 0.5)
HOP = WINDOWS.hop * PERIOD
TURN = 2 * np.pi * 0.91


def flight_with_periodic_torque(rng, amplitude, lead):
    """A motion of many slow sines, and the torque that makes it together with a 0.91 Hz torque about y."""
    time = PERIOD * np.arange(SAMPLES)
    frequency, phase = rng.uniform(0.1, 0.7, (6, 3)), rng.uniform(0, 2 * np.pi, (6, 3))
    angle = 2 * np.pi * frequency * time[:, None, None] + phase
    start = rng.uniform(0, 2 * np.pi)
    rate = 0.2 * np.sin(angle).sum(axis=1)
    rate[:, 1] += 0.3 * np.sin(TURN * time + start)
    acceleration = 0.2 * (2 * np.pi * frequency * np.cos(angle)).sum(axis=1)
    acceleration[:, 1] += 0.3 * TURN * np.cos(TURN * time + start)
    unknown = amplitude * np.sin(TURN * time + start + lead)
    torque = acceleration @ TENSOR + np.cross(rate, rate @ TENSOR)
    torque[:, 1] -= unknown
    torque += lfilter([0.05], [1, -0.9], rng.standard_normal((SAMPLES, 3)), axis=0)
    return Signals(time=time, body_rate=rate, vehicle=VEHICLE, stated_torque=torque)


def found(seed, amplitude, lead=0.0):
    rng = np.random.default_rng(seed)
    residual, rates = [], []
    for _ in range(3):
        signals = flight_with_periodic_torque(rng, amplitude, lead)
        weak = weak_flight(signals, WINDOWS, None, force=False)
        residual.append(weak.averaged(weak.residual(signals)))
        rates.append(WINDOWS.average(signals.body_rate))
    return narrow_band(residual, rates, HOP, 99, rng)


@pytest.mark.parametrize(("lead", "energy"), [(0.0, "feeds"), (np.pi, "drains"), (np.pi / 2, "neither")])
def test_a_periodic_torque_is_found_with_its_frequency_and_its_energy(lead, energy):
    band = found(1, 0.2, lead)
    assert band.channel == "torque y"
    assert band.frequency_hz == pytest.approx(0.91, abs=0.02)
    assert band.p_value <= 0.01
    assert band.share > 0.5
    assert band.energy == energy


def test_the_power_is_half_the_product_of_the_amplitudes():
    band = found(2, 0.2)
    # Windows of 0.4 s let through a little less than all of a 0.91 Hz sine, in torque and in rate.
    passed = np.abs(WINDOWS.weight @ np.exp(1j * TURN * PERIOD * np.arange(len(WINDOWS.weight))))
    assert band.power == pytest.approx(0.5 * 0.2 * 0.3 * passed**2, abs=4 * band.power_error)
    assert band.power_error < 0.1 * band.power


def test_noise_has_no_narrow_band():
    assert np.mean([found(seed, 0.0).p_value <= 0.05 for seed in range(10, 20)]) <= 0.3
