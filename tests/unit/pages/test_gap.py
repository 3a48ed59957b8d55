import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from cpfls_cli.pages.gap import BEFORE, MEASURED, keep_in_view, leaves_view, marked
from cpfls_cli.report.canvas import HELD


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
    keep_in_view(axes, (good, good + 0.1), bad)
    assert leaves_view((good, good + 0.1), bad) is leaves
    low, high = axes.get_ylim()
    assert low < -1.0
    assert high > 1.1
    assert bool(bad.max() > high or bad.min() < low) is leaves
