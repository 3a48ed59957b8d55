"""Another team's simulator, played back: with what its origin states as hidden nothing is left, without it much is."""

import pytest

from benchmarks.shared.playback_scores import free_runs, rate_stays, score
from tests.builders.playback_flights import ROTORPY_HIDDEN, rotorpy_flight, rotorpy_truth


@pytest.mark.parametrize("name", ROTORPY_HIDDEN)
def test_the_model_that_flew_plays_the_flight_back(name):
    flight = rotorpy_flight(name)
    truth = score([free_runs(rotorpy_truth(name), flight, every=5)])
    stays = score([rate_stays(flight, every=5)])
    # Measured speeds are joined by straight lines; the rotors follow with a lag of 5 ms.
    assert (truth.sums < 4e-4 * stays.sums).all()


@pytest.mark.parametrize("name", [name for name, hidden in ROTORPY_HIDDEN.items() if hidden])
def test_what_is_hidden_is_seen(name):
    flight = rotorpy_flight(name)
    without, truth = (score([free_runs(rotorpy_truth(model), flight, every=5)]) for model in ("none", name))
    assert (without.sums > 1000 * truth.sums).all()
