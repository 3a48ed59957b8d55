"""Where a model and flights disagree: one threshold, whichever form it is told in."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli.stages.compare import _offsets, _signal_words
from tests.builders import gap_artifacts as made
from tests.builders.forms import in_all_forms

# What the example of docs/gap.md shows with nothing hidden and seed 13: five of six channels above one floor.
NOTHING_HIDDEN = np.array([1.01, 1.15, 0.908, 1.01, 1.06, 1.10])


def disagreement(floors):
    return made.disagreement(**{"gap/floors": floors})


@pytest.mark.parametrize(
    ("floors", "above"),
    [
        (NOTHING_HIDDEN, "nnnnnn"),
        (np.array([12.0, 3.0, 0.8, 5.0, 4.0, 70.0]), "yynyyy"),
        (np.array([1.5, 1.51, 0.8, np.nan, np.nan, np.nan]), "nyn"),
    ],
)
def test_every_form_calls_the_same_channels_above_noise(floors, above):
    record = disagreement(floors)
    assert "".join("y" if index in record.sizes.above_noise else "n" for index in record.sizes.known) == above
    for form, text in in_all_forms(made.source_of(record, "compare"), made.blocks_of(record, "compare")).items():
        begins = ("roll t", "pitch t", "yaw t", "force")
        rows = [line.split() for line in text.splitlines() if line.startswith(begins) and line.endswith("%")]
        assert "".join(row[-3][0] for row in rows) == above, form
        assert ("Model and flights agree within the noise." in text) is ("y" not in above), form
        assert ("The gap is largest in the" in text) is ("y" in above), form
        assert ("follows thrust (90 %)" in text) is ("y" in above), form


def test_no_signal_is_drawn_where_nothing_is_above_noise():
    assert "(dependence)" not in made.text_of(disagreement(NOTHING_HIDDEN), "compare")


@given(st.lists(st.tuples(st.floats(0, 1e4), st.integers(1, 30)), min_size=1, max_size=5))
def test_flights_stand_one_after_another_without_overlap(flights):
    clock = np.concatenate([start + 0.2 * np.arange(windows) for start, windows in flights])
    flight = np.repeat(np.arange(len(flights)), [windows for _, windows in flights])
    shifted = clock + _offsets(flight, clock)[flight]
    assert shifted[0] == pytest.approx(0.0, abs=1e-9)
    assert np.all(np.diff(shifted) > -1e-9)


@pytest.mark.parametrize(
    ("signal", "words"),
    [("body rate x", "body rate x, rad/s"), ("height", "height, m"), ("rotor speed 2", "rotor speed 2, rad/s")],
)
def test_signals_carry_their_units(signal, words):
    assert _signal_words(signal) == words
