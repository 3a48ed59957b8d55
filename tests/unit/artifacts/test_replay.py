"""To which horizon a model is better than what knows no model."""

from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.artifacts.replay import SignalErrorGroup, better_to

HORIZON = np.array([0.1, 0.2, 0.3, 0.4])
NOTHING, STAYS, STATED = [1.0, 2.0, 3.0, 4.0], [2.0, 2.0, 2.0, 2.0], [9.0] * 4


@pytest.mark.parametrize(
    ("model", "horizon"),
    [
        ([0.5, 0.5, 0.5, 0.5], 0.4),
        # Worse at the first sample, better over all.
        ([1.1, 1.0, 1.0, 1.0], 0.4),
        # "nothing moves" adds up to 1, 3, 6, 10 and "rate stays" to 2, 4, 6, 8: the better of both counts.
        ([0.5, 0.5, 0.5, 6.6], 0.3),
        ([1.5, 2.0, 3.0, 4.0], 0.0),
    ],
)
def test_sums_up_to_a_horizon_are_compared(model, horizon):
    group = SignalErrorGroup(mae=np.array([model, NOTHING, STAYS, STATED]), rms=np.zeros((4, 4, 3)))
    errors = SimpleNamespace(horizon_s=HORIZON, errors={"body_rate": group, "velocity": None})
    assert better_to(errors, "body_rate") == horizon
    assert np.isnan(better_to(errors, "velocity"))
