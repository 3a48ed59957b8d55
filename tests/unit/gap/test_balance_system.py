"""Rotors that shake in their wake: how much, found where they shake and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.gap.balance.balance_system import scatter_size, scatter_variance, system
from cpfls_cli.gap.naming.estimate import channel_weight
from tests.builders.gap_flights import candidate, fly, weak

RING = candidate("vertical_descent", sideways=1.0)


def sinking():
    """Sinks into its own wake at 7 m/s for a third of the time."""
    signals = fly(1, seconds=60.0, tilt=0.02)
    down = np.zeros_like(signals.velocity)
    down[:, 2] = -7.0 * (np.sin(2 * np.pi * signals.time / 20.0) > 0.5)
    return replace(signals, velocity=down)


def test_variance_is_there_where_the_vehicle_sinks():
    signals = sinking()
    flight = weak(signals)
    variance = scatter_variance(system([flight], [RING]))
    centre = flight.windows.centres(signals.time)
    inside = np.interp(centre, signals.time, signals.velocity[:, 2]) < -3
    assert variance[inside, 0].min() > 0.1
    assert np.median(variance[~inside, 0]) == 0.0
    assert not variance[:, 2:].any()
    assert not scatter_variance(system([flight], [candidate("com_offset")])).any()


@pytest.mark.parametrize("size", [0.01, 0.1])
def test_the_size_of_the_scatter_comes_back(size):
    variance = scatter_variance(system([weak(sinking())], [RING]))
    floor = np.full(6, 0.05)
    residual = np.random.default_rng(0).standard_normal(variance.shape) * np.sqrt(floor**2 + size**2 * variance)
    assert scatter_size(variance, residual, floor) == pytest.approx(size**2, rel=0.3)


def test_a_residual_that_is_large_everywhere_is_no_scatter():
    variance = scatter_variance(system([weak(sinking())], [RING]))
    floor = np.full(6, 0.05)
    residual = 0.3 * np.random.default_rng(1).standard_normal(variance.shape)
    assert scatter_size(variance, residual, floor) == 0.0
    assert scatter_size(np.zeros_like(variance), residual, floor) == 0.0


def test_where_an_effect_shakes_a_fit_weighs_less():
    hypothesis = system([weak(sinking())], [RING])
    variance = scatter_variance(hypothesis)
    floor, size = np.full(6, 0.05), 0.1
    expected = np.sqrt(floor**2 + size**2 * variance)
    # In place of the residual that the flight would leave.
    vars(hypothesis)["residual"] = np.random.default_rng(2).standard_normal(variance.shape) * expected
    np.testing.assert_allclose(channel_weight(hypothesis, floor)[:, :2], expected[:, :2], rtol=0.2)
