"""Charts as SVG."""

import base64
import re
import struct
import zlib
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest

from cpfls_cli.chart import Axis, Chart, span

SVG = "{http://www.w3.org/2000/svg}"


def drawn(chart):
    """The picture as a tree, and all that stands beside it."""
    shown = str(chart)
    ElementTree.fromstring(f"<div>{shown}</div>")
    picture = shown[shown.index('<svg class="chart" viewBox="0 0 380') :].split("</svg>")[0] + "</svg>"
    return ElementTree.fromstring(picture), shown


def chart(**own):
    return Chart("gain", "Gain & <more>", Axis("Hz", 1.0, 100.0, log=True), Axis("rad/s²", 0.0, 100.0), **own)


@pytest.mark.parametrize(
    ("axis", "ticks"),
    [
        (Axis("", 0.0, 1.0), ["0", "0.2", "0.4", "0.6", "0.8", "1"]),
        (Axis("", -30.0, 30.0), ["−30", "−20", "−10", "0", "10", "20", "30"]),
        (Axis("", 1.0, 100.0, log=True), ["1", "2", "5", "10", "20", "50", "100"]),
        (Axis("", 1.0, 1e4, log=True), ["1", "10", "100", "1000", "10000"]),
        (Axis("", 0.0, 3.0, names={1.0: "M1", 2.0: "M2"}), ["M1", "M2"]),
        (Axis("", 5.0, 5.0), ["5"]),
    ],
)
def test_ticks(axis, ticks):
    assert list(axis.ticks().values()) == ticks


def test_an_axis_holds_all_values():
    assert span(np.array([1.0, np.nan, 3.0]), None) == pytest.approx((0.9, 3.1))
    assert span(np.array([1.0, 3.0]), zero=True) == pytest.approx((0.0, 3.15))
    assert span(np.array([np.nan])) == pytest.approx((-0.05, 1.05))


def test_a_curve_is_where_its_numbers_are_with_gaps_and_band():
    own = chart()
    x = np.array([1.0, 10.0, 50.0, 100.0])
    own.line("roll", x, np.array([0.0, 50.0, np.nan, 100.0]), low=x * 0, high=x)
    own.line("before", x, x, "g", kind="dashed")
    picture, shown = drawn(own)
    path = next(each for each in picture.iter() if "curve s0" in each.get("class", ""))
    points = re.findall(r"([ML])([\d.]+) ([\d.]+)", path.get("d"))
    assert [pen for pen, *_ in points] == ["M", "L", "M"]
    left, middle, right = (float(x) for _, x, _ in points)
    assert middle == pytest.approx((left + right) / 2, abs=0.2)
    assert [float(y) for *_, y in points] == pytest.approx([200.0, 111.0, 22.0])
    assert shown.count("<li>") == 2
    assert '<th scope="col">roll, high</th>' in shown
    assert "<td>50.00</td>" in shown
    assert "&lt;more&gt;" in shown


def test_bars_and_whiskers_begin_at_zero():
    own = Chart("bars", "", Axis("", 0.0, 3.0, names={1.0: "M1", 2.0: "M2"}), Axis("%", -10.0, 10.0))
    own.bars("", np.array([1.0, 2.0]), np.array([5.0, -5.0]), low=np.array([4.0, -6.0]), high=np.array([6.0, np.nan]))
    picture, shown = drawn(own)
    bars = [each for each in picture.iter(f"{SVG}rect") if each.get("class") == "f0"] or [
        each for each in picture.iter("rect") if each.get("class") == "f0"
    ]
    assert [float(each.get("height")) for each in bars] == pytest.approx([44.5, 44.5], abs=0.1)
    assert shown.count('class="whisker"') == 1
    assert '<th scope="row">M2</th>' in shown


def test_a_map_is_a_picture_in_the_colour_of_the_page():
    own = chart()
    own.map(np.array([[0.0, 1.0, 2.0], [4.0, np.nan, 8.0]]), 0.0, 4.0, 2)
    _, shown = drawn(own)
    png = base64.b64decode(re.search(r"base64,([^\"]+)", shown)[1])
    width, height = struct.unpack(">II", png[16:24])
    lines = np.frombuffer(zlib.decompress(png[png.index(b"IDAT") + 4 : -16]), np.uint8).reshape(height, width + 1)
    assert lines[:, 1:].tolist() == [[255, 0, 255], [0, 64, 128]]
    assert 'class="f2" mask="url(#gain-map)"' in shown
    assert "<details>" not in shown


def test_no_label_stands_over_another_or_beyond_the_edge():
    own = chart()
    for x, label in ((10.0, "crossover"), (11.0, "second"), (99.0, "at the edge of it"), (60.0, "notch")):
        own.mark(label, x=x)
    own.mark(x=200.0, label="outside")
    own.mark("limit", y=50.0)
    picture, shown = drawn(own)
    texts = {"".join(each.itertext()): each for each in picture.iter() if each.tag.endswith("text")}
    places = sorted((float(own.get("x")), 3.2 * len(label)) for label, own in texts.items() if own.get("y") == "14")
    assert {"crossover", "notch"} <= texts.keys()
    assert not {"second", "outside"} & texts.keys()
    assert all(a + half_a <= b - half_b for (a, half_a), (b, half_b) in pairwise(places))
    assert all(at + half <= own.width for at, half in places)
    assert shown.count("dashed thin") == 5
