import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.pages.figures.before_after import BEFORE, HELD, MEASURED, keep_in_view, marked
from cpfls_cli.pages.figures.residual_time import flight_offsets
from cpfls_cli.pages.gap_words import effect_title, joined, probability, sentence, signal_words, whole_percent


def test_curves_are_told_apart_without_colour():
    looks = [(str(style["linestyle"]), style["linewidth"], style.get("marker")) for style in (MEASURED, BEFORE, HELD)]
    looks.append((marked(100)["linestyle"], marked(100)["linewidth"], marked(100)["marker"]))
    assert len(set(looks)) == len(looks)
    assert MEASURED["linewidth"] > 2 * marked(100)["linewidth"]


@given(points=st.integers(1, 5000))
def test_a_curve_gets_a_few_marks_whatever_its_length(points):
    assert 1 <= len(range(0, points, marked(points)["markevery"])) <= 24


@pytest.mark.parametrize(("error", "leaves"), [(1.0, False), (50.0, True), (-50.0, True)])
def test_only_a_curve_that_runs_away_leaves_the_picture(error, leaves):
    axes = Figure().subplots()
    good = np.linspace(-1.0, 1.0, 50)
    bad = good + np.linspace(0, error, 50)
    axes.plot(good)
    axes.plot(bad)
    assert keep_in_view(axes, (good, good + 0.1), bad) is leaves
    low, high = axes.get_ylim()
    assert low < -1.0
    assert high > 1.1
    assert bool(bad.max() > high or bad.min() < low) is leaves


@given(st.lists(st.tuples(st.floats(0, 1e4), st.integers(1, 30)), min_size=1, max_size=5))
def test_flights_stand_one_after_another_without_overlap(flights):
    clock = np.concatenate([start + 0.2 * np.arange(windows) for start, windows in flights])
    flight = np.repeat(np.arange(len(flights)), [windows for _, windows in flights])
    shifted = clock + flight_offsets(flight, clock)[flight]
    assert shifted[0] == pytest.approx(0.0, abs=1e-9)
    assert np.all(np.diff(shifted) > -1e-9)


def test_every_effect_has_a_title_and_every_word_an_end():
    assert all(effect_title(name) == entry.title for name, entry in CATALOGUE.items())
    assert effect_title("of_another_version") == "of another version"
    assert joined(["a", "b", "c", "a"]) == "a, b and c"
    assert joined(["a", "b"], "or") == "a or b"
    assert sentence("no rotors") == "No rotors."
    assert sentence("log_1.csv: saturated?") == "log_1.csv: saturated?"


def test_numbers_are_not_rounded_into_certainty():
    assert [whole_percent(share) for share in (0.0, 0.001, 0.42, 0.9961, 1.0)] == [
        "0 %", "< 1 %", "42 %", "> 99 %", "100 %",
    ]  # fmt: skip
    assert probability(1e-9) == "< 10⁻⁶"
    assert probability(0.0123) == "0.012"


@pytest.mark.parametrize(
    ("signal", "words"),
    [("body rate x", "body rate x, rad/s"), ("height", "height, m"), ("rotor speed 2", "rotor speed 2, rad/s")],
)
def test_signals_carry_their_units(signal, words):
    assert signal_words(signal) == words
