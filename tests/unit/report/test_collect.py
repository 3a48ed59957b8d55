import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure

from cpfls_cli.report.canvas import band, line, plot
from cpfls_cli.report.collect import panels_of
from cpfls_cli.report.figure_tables import figure_tables


def collected(draw, panels=1):
    figure = Figure()
    axes = figure.subplots(panels, 1, sharex=True, squeeze=False)[:, 0]
    draw(*axes)
    return panels_of(figure)


def series_of(draw):
    (panel,) = collected(draw)
    return panel.series


X = np.linspace(0.0, 2.0, 7)


def test_a_curve_is_collected_with_its_labels_and_those_of_the_panel_that_shares_its_axis():
    def draw(upper, lower):
        upper.plot(X, X**2, label="square")
        upper.set_title("above", loc="right")
        upper.set_ylabel("area, m²")
        lower.plot(X, -X, label="_hidden")
        lower.set_xlabel("time, s")

    first, second = collected(draw, 2)
    assert (first.title, first.x_label, first.y_label) == ("above", "time, s", "area, m²")
    assert [series.label for panel in (first, second) for series in panel.series] == ["square", ""]
    np.testing.assert_array_equal(first.series[0].y, X**2)


def test_points_are_told_from_curves_however_they_are_drawn():
    def draw(axes):
        axes.plot(X, X, "o", label="plot")
        axes.scatter(X, 2 * X, label="scatter")
        axes.plot(X, 3 * X)

    found = {series.label: series for series in series_of(draw)}
    assert {label: series.form for label, series in found.items()} == {
        "plot": "points",
        "scatter": "points",
        "": "line",
    }
    np.testing.assert_array_equal(found["scatter"].y, 2 * X)


@pytest.mark.parametrize("name", ["bar", "barh"])
def test_bars_give_their_places_and_their_ends(name):
    (bars,) = series_of(lambda axes: getattr(axes, name)([0.0, 1.0], [3.0, -2.0], label="count"))
    places, ends = (bars.x, bars.y) if name == "bar" else (bars.y, bars.x)
    assert bars.form == "bars"
    np.testing.assert_allclose(places, [0, 1])
    np.testing.assert_allclose(ends, [3, -2])


@pytest.mark.parametrize("fill", [lambda axes, *data: axes.fill_between(*data), band])
def test_a_band_gives_both_of_its_ends(fill):
    (found,) = series_of(lambda axes: fill(axes, X, X - 1, X**2 + 1))
    assert found.form == "band"
    np.testing.assert_allclose(found.x, X)
    np.testing.assert_allclose(found.low, X - 1)
    np.testing.assert_allclose(found.high, X**2 + 1)


def test_error_bars_belong_to_their_points():
    (found,) = series_of(lambda axes: axes.errorbar(X, X, 0.1 * (1 + X), capsize=2, label="mean"))
    assert found.label == "mean"
    np.testing.assert_allclose(found.high - found.y, 0.1 * (1 + X))
    np.testing.assert_allclose(found.y - found.low, 0.1 * (1 + X))


def test_levels_and_spans_go_from_edge_to_edge():
    def draw(axes):
        axes.axhline(3.0, label="full set")
        axes.axvline(1.0)
        axes.axhspan(-1.0, 1.0, label="noise")
        axes.axvspan(4.0, 5.0)
        axes.broken_barh([(6.0, 2.0)], (0.0, 1.0), transform=axes.get_xaxis_transform())

    found = sorted((tuple(mark.x), tuple(mark.y)) for mark in series_of(draw))
    edges = (-np.inf, np.inf)
    assert found == sorted(
        [(edges, (3.0, 3.0)), ((1.0, 1.0), edges), (edges, (-1.0, 1.0)), ((4.0, 5.0), edges), ((6.0, 8.0), edges)]
    )


def test_a_map_gives_the_middle_and_the_value_of_every_known_cell():
    values = np.array([[1.0, np.nan], [3.0, 4.0]])
    (found,) = series_of(lambda axes: axes.pcolormesh([0, 2, 4], [0, 1, 2], np.ma.masked_invalid(values)))
    assert sorted(zip(found.x, found.y, found.value, strict=True)) == [(1, 0.5, 1), (1, 1.5, 3), (3, 1.5, 4)]


def test_the_pieces_of_one_curve_are_joined_and_two_curves_are_not():
    def draw(axes):
        axes.plot(X, X, color="k", label="run")
        axes.plot(X + 3, X, color="k")
        axes.plot(X, X, color="r")

    first, second = series_of(draw)
    np.testing.assert_array_equal(first.x, [*X, *(X + 3)])
    assert len(second.x) == len(X)


def test_words_at_the_ticks_stand_for_places():
    def draw(axes):
        axes.plot([0.0, 1.0], [5.0, 6.0])
        axes.set_xticks([0.0, 1.0], ["small", "off"])

    panels = collected(draw)
    assert panels[0].x_names == {0.0: "small", 1.0: "off"}
    assert [row[0] for row in figure_tables(panels)[0].rows] == ["small", "off"]


def test_a_table_of_a_thinned_curve_shows_samples_of_the_whole_one_at_a_common_x():
    time = np.linspace(0.0, 10.0, 20001)
    rough = np.random.default_rng(1).standard_normal(time.size)

    def draw(figure):
        axes = figure.subplots()
        line(axes, time, rough, label="one")
        line(axes, time, 2 * rough, label="two")
        axes.set_xlabel("time, s")

    panels = plot("name", "", "what", 2.0, draw).picture.panels
    assert all(len(series.x) < 2000 for series in panels[0].series)
    (table,) = figure_tables(panels)
    assert list(table.header) == ["time, s", "one", "two"]
    assert len(table.rows) == 25
    place = int(np.flatnonzero(np.isclose(time, float(table.rows[7][0]), atol=1e-5))[0])
    one, two = (float(cell.replace("−", "-")) for cell in table.rows[7][1:])
    assert one == pytest.approx(rough[place], rel=1e-3)
    assert two == pytest.approx(2 * one, rel=1e-3)
    assert f"{len(panels[0].series[0].x)}" in table.caption


def test_no_figure_is_left_open():
    plot("name", "", "what", 2.0, lambda figure: figure.subplots().plot(X, X))
    assert not plt.get_fignums()
