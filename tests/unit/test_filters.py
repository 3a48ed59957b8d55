"""Filters along signals and step by step."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter_zi, sosfiltfilt

from cpfls_cli.filters import SecondOrder
from cpfls_cli.flightlog.smoothing import low_pass

WAVES = np.random.default_rng(1).standard_normal((400, 3)) + np.array([0.0, 5.0, -80.0])


@pytest.mark.parametrize("upper", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.5, 1.0, 2.0)])
def test_a_filter_begins_settled_and_goes_step_by_step_as_along(upper):
    made = SecondOrder.of(0.01, 0.3, upper)
    state = made.settled(WAVES[0])
    np.testing.assert_allclose(state, lfilter_zi(made.over, made.under)[:, None] * WAVES[0], atol=1e-9)
    along, steps = made.along(WAVES), []
    for value in WAVES:
        passed, state = made.step(value, state)
        steps.append(passed)
    np.testing.assert_allclose(along, steps, atol=1e-9)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 7, 12])
@pytest.mark.parametrize("cutoff_hz", [0.3, 10.0, 49.0])
def test_a_low_pass_is_padded_for_three_periods(order, cutoff_hz):
    padding = min(len(WAVES) - 1, int(np.ceil(3 * 100.0 / cutoff_hz)))
    expected = sosfiltfilt(butter(order, cutoff_hz, fs=100.0, output="sos"), WAVES, axis=0, padlen=padding)
    np.testing.assert_allclose(low_pass(WAVES, 100.0, cutoff_hz, order), expected, atol=1e-8)
