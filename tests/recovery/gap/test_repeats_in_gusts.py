"""What of a gap comes again in gusts, on flights of known truth: drag and damping that no config states, or none."""

import numpy as np
import pytest

from cpfls_cli.blocks import half_width
from cpfls_cli.gap.balance.weak_flight import weak_flight
from cpfls_cli.gap.extended import plain
from cpfls_cli.gap.residual.repeated import RepeatedRuns
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.weak_form.windows import common_windows
from tests.builders.gusty_flights import CALM, GUSTS, SMALL, STORM, Flight, gusty_flights, logged

LACKS = SMALL._replace(drag=0.1, damping=6e-5)
NOTHING = SMALL._replace(drag=0.0, damping=0.0)
SETS = {
    "gusts": (LACKS, GUSTS, 4),
    "calm": (LACKS, CALM, 2),
    "gusts alone": (NOTHING, GUSTS, 4),
    "storm alone": (NOTHING, STORM, 4),
}
"""What flies, in which gusts, and how often each of two paths."""


@pytest.fixture(scope="module")
def found():
    """What comes again of each set, of a model that knows neither drag nor damping."""
    flown = gusty_flights(
        [
            Flight(truth, gusts, path, draw)
            for truth, gusts, runs in SETS.values()
            for path in (0, 1)
            for draw in range(runs)
        ],
        seconds=40.0,
    )
    return {name: split([next(flown) for _ in range(2 * runs)]) for name, (*_, runs) in SETS.items()}


def split(flown):
    recordings = [logged(flight, SMALL.vehicle).parts[0] for flight in flown]
    windows, model = common_windows(recordings, GapSettings()), plain(None)
    flights = [weak_flight(each, windows, None, force=True) for each in recordings]
    return RepeatedRuns.of(recordings).split(model.system(flights), model.linear)


def test_the_repeatable_share_is_that_of_the_effects(found):
    """In still air all of the gap is theirs; in gusts the same comes again, next to what does not."""
    gusty, calm = found["gusts"], found["calm"]
    rest = gusty.total - gusty.repeatable
    off = (
        np.abs(gusty.share - calm.repeatable / (calm.repeatable + rest))[[0, 1, 3, 4]] / gusty.share_half[[0, 1, 3, 4]]
    )
    # Of two dozen intervals of 95 % some do not hold the truth.
    assert (off < 1).mean() > 0.8
    assert (off < 2).all()
    assert gusty.sure[[0, 1]].any(axis=1).all()
    assert gusty.sure[[3, 4]].all()


def test_the_share_that_is_explained_is_that_of_still_air(found):
    """From 0.25 to 3 Hz, where a model without damping explains 0.88 to 0.92 of roll and pitch."""
    gusty, calm = found["gusts"], found["calm"]
    result = (slice(0, 2), slice(2, 5))
    half = half_width(gusty.explained_error, gusty.blocks)[result]
    assert calm.explained[result] == pytest.approx(0.9, abs=0.03)
    assert (np.abs(gusty.explained[result] - calm.explained[result]) < 1.5 * half).all()


@pytest.mark.parametrize("name", ["gusts alone", "storm alone"])
def test_gusts_alone_do_not_come_again_and_have_their_size(found, name):
    """But for a fifth of theirs that is faster than the windows, or slower than a flight."""
    alone = found[name]
    assert alone.repeating == []
    assert max(alone.at_most(channel) for channel in range(6)) < 0.3
    assert alone.non_repeatable[:3] == pytest.approx(np.array(SETS[name][1]), rel=0.2)
