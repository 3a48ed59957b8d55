"""What a repeated test signal is for: in gusts the other runs tell the body, where a regression misses it."""

import numpy as np

from tests.builders.gusty_flights import GUSTS, LARGE, SMALL, Flight
from tests.builders.missions_in_gusts import found, mission_of


def test_runs_are_instruments_for_each_other():
    """Two vehicles of 45 g and 1.5 kg, which have room for all of the signal, two draws of gusts each."""
    mission = mission_of(SMALL, seconds=16.0)
    np.testing.assert_array_equal(mission.position, mission_of(LARGE, seconds=16.0).position)
    flights = [Flight(truth, GUSTS, draw=draw) for truth in (SMALL, LARGE) for draw in (0, 1)]
    by_torque, _, by_runs = np.moveaxis(found(mission, flights), 1, 0)
    assert (by_torque > 1.05).all()
    assert np.abs(by_runs - 1).max() < 0.04
