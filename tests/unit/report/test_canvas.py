import re
from xml.etree import ElementTree

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli.arrays import runs
from cpfls_cli.report.canvas import band, figure_html, kept_samples, legend_above, legend_over, line, plot, stacked

pytestmark = pytest.mark.usefixtures("drawn")


def draw(figure):
    axes = figure.subplots()
    line(axes, np.linspace(0, 1, 9000), np.linspace(0, 1, 9000) ** 2, color="k", marker="o")
    axes.set_title("a < b & c")


def test_equal_figures_are_equal_text_whatever_the_reader_s_settings():
    first = plot("one", "", "what", 2.0, draw).picture.svg
    with matplotlib.rc_context({"font.size": 30, "axes.grid": False, "svg.fonttype": "path", "lines.linewidth": 9}):
        assert plot("one", "", "what", 2.0, draw).picture.svg == first
        assert matplotlib.rcParams["font.size"] == 30


def test_ids_of_two_figures_do_not_meet_and_all_references_resolve():
    pictures = [plot(name, "", "what", 2.0, draw).picture.svg for name in ("one", "two")]
    ids = [re.findall(r'\bid="([^"]+)"', svg) for svg in pictures]
    assert ids[0]
    assert not set(ids[0]) & set(ids[1])
    for svg, own in zip(pictures, ids, strict=True):
        references = re.findall(r'(?:url\(|href=")#([^)"]+)', svg)
        assert references
        assert set(references) == set(own)


def test_a_figure_is_well_formed_named_and_carries_no_style_sheet():
    root = ElementTree.fromstring(plot("one", "", 'says "what" & <more>', 2.0, draw).picture.svg)
    assert (root.get("aria-label"), root.get("role")) == ('says "what" & <more>', "img")
    tags = {element.tag.rsplit("}", 1)[-1] for element in root.iter()}
    assert not tags & {"style", "metadata", "script", "image"}
    assert "a < b & c" in "".join(root.itertext())


def test_a_unit_stays_on_one_line_and_what_cannot_be_drawn_is_marked():
    def label(figure):
        figure.subplots().set_xlabel("torque, N\N{NO-BREAK SPACE}m of a\x07b")

    words = "".join(ElementTree.fromstring(plot("one", "", "what", 2.0, label).picture.svg).itertext())
    assert "torque, N\N{NO-BREAK SPACE}m of a\N{REPLACEMENT CHARACTER}b" in words


@pytest.mark.parametrize("over", [False, True])
def test_names_in_a_figure_are_shown_as_they_are_written(over):
    """Neither as mathematics, which this would not even be, nor as one of matplotlib's own names, which are hidden."""
    names = ["$\\frac{$", "_hidden", "_child", "__", "a$b$c"]

    def draw(figure):
        axes = figure.subplots()
        for name in names:
            axes.plot([0.0, 1.0], [0.0, 1.0], label=name)
        axes.bar([0.0], [1.0], label="_bars")
        axes.plot([0.0, 1.0], [1.0, 0.0])
        axes.set_title("_$x_")
        legend_over(figure, axes) if over else legend_above(axes)

    picture = plot("one", "", "what", 2.0, draw).picture
    shown = [text for text in ElementTree.fromstring(picture.svg).itertext() if text.strip()]
    assert [text for text in shown if text in {*names, "_bars", "_$x_"}] == ["_$x_", *names, "_bars"]
    assert {curve for _, curve, _, _ in picture.rows} == {*names, "_bars", ""}


@given(samples=st.integers(2, 6000), largest=st.integers(4, 1500), seed=st.integers(0, 1000))
def test_thinning_keeps_extremes_and_ends_and_is_short(samples, largest, seed):
    values = np.random.default_rng(seed).standard_normal(samples)
    kept = kept_samples(values, largest)
    assert len(kept) <= max(largest, 2) + 2
    assert np.all(np.diff(kept) > 0)
    assert {0, samples - 1, int(np.argmin(values)), int(np.argmax(values))} <= set(kept.tolist())


def test_a_lone_spike_survives():
    values = np.sin(np.linspace(0, 20, 100_000))
    values[54_321] = 9.0
    assert 54_321 in kept_samples(values)


@given(st.lists(st.booleans(), max_size=60))
def test_runs_cover_exactly_what_is_marked(marked):
    covered = [index for first, after in runs(np.array(marked, dtype=bool)) for index in range(first, after)]
    assert covered == [index for index, value in enumerate(marked) if value]


def labels_of_several_widths(figure):
    for panel, (low, high) in zip(stacked(figure, 3), [(0.0, 1.0), (-3e4, 2.5e5), (0.00012, 0.00019)], strict=True):
        line(panel, np.linspace(0.0, 30.0, 50), np.linspace(low, high, 50))
        panel.set_ylabel("what")
    legend_above(panel)


def powers_of_ten(figure):
    left, right = figure.subplots(1, 2)
    left.loglog([1e-3, 1e4], [2.0, 7.0])
    right.plot([0.0, 1.0], [0.0, 3e-9])


@pytest.mark.parametrize("draw", [labels_of_several_widths, powers_of_ten])
def test_a_layout_by_few_ticks_is_that_of_the_library(draw):
    picture = plot("one", "", "what", 4.0, draw).picture
    figure = picture.figure()
    figure.set_dpi(72)
    figure.draw_without_rendering()
    frames = re.findall(r'<path d="M ([\d.]+) ([\d.]+) L ([\d.]+) \2 L \3 ([\d.]+) L \1 \4', picture.svg)
    # The first frame is the whole figure.
    found = np.array(frames[1 : 1 + len(figure.axes)], dtype=float)
    boxes = np.array([axes.bbox.extents for axes in figure.axes])
    height = figure.bbox.height
    expected = np.column_stack([boxes[:, 0], height - boxes[:, 1], boxes[:, 2], height - boxes[:, 3]])
    # Points, of which a letter is ten high; a power that is typeset is higher than one that is written.
    assert found == pytest.approx(expected, abs=2.0)


def test_ticks_are_written_in_words_that_need_no_typesetting_and_keep_their_factor():
    figure = plot("one", "", "what", 4.0, powers_of_ten).picture
    words = {text.strip() for text in ElementTree.fromstring(figure.svg).itertext()}
    assert {"10⁻³", "10⁰", "10⁴", "2 × 10⁰", "1e−9", "0.5"} <= words
    assert not any("$" in word or "\\" in word for word in words)


def test_who_does_not_see_a_figure_reads_its_panels_curves_and_their_extremes():
    time = np.linspace(0.0, 10.0, 20001)
    torque = np.sin(time)

    def draw(figure):
        upper, lower = figure.subplots(2, 1)
        line(upper, time, torque, label="torque")
        band(upper, time, torque - 1.0, torque + 1.0, label="95 %")
        upper.axhline(0.3)
        upper.set_title("roll <b>", loc="right")
        upper.set_ylabel("N m")
        upper.set_xlabel("time, s")
        lower.barh([0.0, 1.0], [3.0, -2.0], label="effects")
        lower.set_yticks([0.0, 1.0], ["drag", "lag"])
        lower.set_ylabel("effect")

    picture = plot("one", "", "what", 2.0, draw).picture
    panel = "roll <b>, N m over time, s"
    assert picture.rows[:4] == [
        (panel, "torque", "0", "0"),
        (panel, "torque", "4.713", "−1.000"),
        (panel, "torque", "7.854", "1.000"),
        (panel, "torque", "10.00", "−0.5440"),
    ]
    assert {"−2.000", "2.000"} <= {y for _, curve, _, y in picture.rows if curve == "95 %"}
    assert picture.rows[-2:] == [("effect", "effects", "3.000", "drag"), ("effect", "effects", "−2.000", "lag")]
    page = figure_html(picture)
    assert "<td>roll &lt;b&gt;, N m over time, s</td><td>torque</td><td>7.854</td><td>1.000</td>" in page
    assert "<b>" not in page


def test_a_figure_without_numbers_scrolls_on_a_narrow_page_too():
    picture = plot("one", "", "what", 2.0, lambda figure: figure.subplots()).picture
    assert not picture.rows
    assert figure_html(picture).startswith('<div class="plot"><svg ')


def test_no_figure_is_left_open():
    plot("name", "", "what", 2.0, draw).picture.figure()
    assert not plt.get_fignums()
