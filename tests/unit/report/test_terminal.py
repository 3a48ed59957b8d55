"""Answers on a terminal: tables, folds, numbers, and words for changes."""

import math
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli import page
from cpfls_cli.changes.results import Alike, Found
from cpfls_cli.report.content import (
    Box,
    Cell,
    Facts,
    Folded,
    Heading,
    Listing,
    Plot,
    Table,
    Text,
    change,
    number,
    percent,
    plain,
    printed,
    probability,
    r_squared,
    sentence,
    unfolded,
    whole_percent,
    with_interval,
)
from cpfls_cli.report.terminal import folded_words, terminal_lines, warnings_of
from cpfls_cli.result import Estimate
from cpfls_cli.stage import loaded
from cpfls_cli.stages._flight_numbers import cause_name, change_words, smallest_words, what_to_check
from cpfls_cli.words import joined
from tests.builders.drawn_numbers import QUAD, drawn_changed, drawn_trend
from tests.builders.gap_artifacts import source_of as made_of

TABLE = Table(
    "errors",
    "Attitude errors of a flight.",
    ("Controller", "RMS roll, °", "Largest roll, °", "What it knows"),
    [
        ["identified model", "0.0149", Cell("12.5", "warning"), "the torque that a motion takes"],
        ["PD alone", "1.2", "3", "nothing"],
    ],
    words=frozenset({0, 3}),
)
made = {"changed": cache(drawn_changed), "trend": cache(drawn_trend)}
NOTHING = {"p": 0.5, "causes": (), "numbers": ()}


def lines(*blocks, **options):
    return list(terminal_lines(blocks, **options))


def test_where_there_is_no_terminal_no_line_is_broken():
    assert lines(TABLE) == [
        "Attitude errors of a flight.",
        "Controller        RMS roll, °  Largest roll, °  What it knows",
        "identified model       0.0149             12.5  the torque that a motion takes",
        "PD alone                  1.2                3  nothing",
    ]


@pytest.mark.parametrize("width", [60, 50])
def test_a_table_fits_the_terminal_and_loses_nothing(width):
    shown = lines(TABLE, width=width)[1:]
    assert max(map(len, shown)) <= width
    assert "…" not in "".join(shown)
    for row in TABLE.cells:
        for word in " ".join(cell.text for cell in row).split():
            assert any(word in line.split() for line in shown)


def test_facts_stand_in_two_columns_and_tables_without_titles_have_no_header():
    facts = Facts([("Source", "simulated along a path with a long name"), ("Samples", "549")])
    assert lines(facts) == ["Source   simulated along a path with a long name", "Samples  549"]
    assert lines(facts, width=30) == ["Source   simulated along a", "         path with a long name", "Samples  549"]
    assert lines(Table("t", "", ("", ""), [["a", "1"], ["bc", "23"]])) == ["a    1", "bc  23"]


def test_sentences_stand_as_they_are_and_pictures_stay_on_the_page():
    plot, folded = Plot("p", "A picture.", "<svg/>"), Folded("More", [TABLE])
    box = Box("Verdict", "good", ["one reason", "another"])
    shown = lines(Text("a sentence"), Heading("a heading"), box, Listing("one\ntwo\n"), plot, folded)
    assert shown == ["a sentence", "a heading", "Verdict: good", "  one reason", "  another", "one", "two"]


def test_what_warns_is_apart_and_what_is_folded_away_is_named():
    blocks = [Text("all is well"), Text("beware", "warning"), Text("note this", "note")]
    assert lines(*blocks) == ["all is well", "note this"]
    assert warnings_of(blocks) == (Text("beware", "warning"),)
    assert warnings_of([Folded("More", blocks)]) == warnings_of(blocks)
    blocks = [Text("the answer"), Folded("why", [Text("because"), Folded("numbers", [Facts([("one", "1")])])])]
    assert lines(*blocks) == ["the answer"]
    assert folded_words(blocks) == ("why",)
    assert lines(*blocks, whole=True) == ["the answer", "why:", "because", "numbers:", "one  1"]


def test_a_terminal_breaks_sentences_between_words():
    box = Box("Verdict", "good", ["one reason that is long"])
    assert lines(Text("a long sentence"), box, width=15) == [
        "a long sentence",
        "Verdict: good",
        "  one reason",
        "  that is long",
    ]
    assert lines(Text("a long sentence", "note"), width=14) == ["a long", "sentence"]


def test_a_wide_table_breaks_its_sentences_where_there_is_no_terminal():
    sentence = " ".join(f"word{number}" for number in range(30))
    rows = [["1.5", sentence], ["-2", sentence]]
    shown = lines(Table("t", "", ("A number", "What it is"), rows, frozenset({1}), frozenset({1})))
    assert max(map(len, shown)) <= 100
    assert " ".join(" ".join(shown).split()).count("word29") == 2
    # Numbers and words stay whole, however many there are.
    wide = Table("t", "", [f"column-{number}" for number in range(20)], [["1"] * 20])
    assert len(lines(wide)) == 2


def test_colours_only_where_they_are_asked_for():
    assert not any("\x1b" in line for line in lines(TABLE, width=80))
    (marked,) = (line for line in lines(TABLE, width=80, colour=True) if "12.5" in line)
    assert re.search(r"\x1b\[1;31m *12\.5\x1b\[0m", marked)


def test_no_block_gives_a_terminal_orders():
    name = "\x1b]0;title\x07red\x1b[31m"
    blocks = [
        Heading(name),
        Text(name),
        Box(name, "", ()),
        Facts([(name, "value")]),
        Listing(name),
        Table("names", "", (name, name), [[name, name]]),
    ]
    said = lines(*blocks)
    assert len(said) == 7
    assert all(line.isprintable() and "\\x1b]0;title\\x07red\\x1b[31m" in line for line in said)


def test_what_holds_only_warnings_or_figures_has_no_heading():
    careful = Folded("what to be careful with", [Text("a gust", "warning"), Folded("inner", [])])
    assert lines(careful, whole=True) == []
    assert folded_words([careful, Folded("why", [Text("because")])]) == ("why",)
    assert [each.text for each in warnings_of([careful])] == ["a gust"]


def found(name, *sizes, **more):
    """A change of these sizes, each surely not 0."""
    given = tuple(Estimate.around(size, 0.1 * abs(size)) for size in sizes)
    return Found(**{"name": name, "named": True, "belief": 0.97, "unit": "1", "sizes": given, "alike": (), **more})


def source_of(result, name):
    """Say where a result of this vehicle comes from."""
    return replace(made_of(result, name), vehicle=QUAD)


def answer(name, **more):
    """Give the blocks of the answer."""
    result = replace(made[name](), **more)
    return page.blocks(loaded(name).text(result, about=source_of(result, name)))


@pytest.mark.parametrize(
    ("cause", "sizes", "words", "shows"),
    [
        ("rotor M3", [0.2], "rotor M3 pulls 20 % less (18 to 22 %)", "a rotor that pulls 20 % less"),
        ("mass", [-0.1], "it is 600 g lighter (540 to 660 g)", "a mass that differs by 600 g"),
        ("hover", [0.1], "hover needs 10 % more (9.0 to 11 %) thrust: 600 g heavier, or all rotors pull less", None),
        ("load on a cable", [0.1], "600 g (540 to 660 g) hang under it on a cable of 0.70 m", "600 g on a cable"),
        ("centre of mass", [-0.02, 0.01], "the centre of mass lies 20 mm to the back (18 to 22 mm) and 10 mm", None),
        ("turn M1", [np.log(1.21)], "rotor M1 turns 10 % faster (", None),
        ("vibration", [np.log(2)], "it vibrates 2.0 times as strong", "2.0 times the vibration"),
        ("delay", [-0.01], "rotation follows the rotors 10 ms earlier (9.0 to 11 ms)", None),
        ("drift", [0.05, 0.02, 0.01], "the gyroscope is off by 0.050 rad/s about x, 0.020 rad/s about y and", None),
        ("axes", [0.1, 0.02, 0.01], "the gyroscope is turned by 5.7° about x, 1.1° about y and 0.57° about z", None),
        ("odd thing", [0.5], "odd thing: 0.50", "odd thing: 0.50"),
    ],
)
def test_a_change_in_words(cause, sizes, words, shows):
    names = [f"{kind} {axis}" for kind in ("drift", "axes") for axis in "xyz"]
    assert change_words(found(cause, *sizes, cable_m=0.7), 6.0, names).startswith(words)
    if shows:
        assert smallest_words(cause, abs(sizes[0]), 6.0) == shows


def test_names_and_checks():
    assert cause_name("unbalance M2") == "another balance of rotor M2"
    assert (cause_name("unbalance"), cause_name("odd thing")) == ("another balance of rotors", "odd thing")
    assert what_to_check("scale z").startswith("see whether the gyroscope's range")
    assert what_to_check("odd thing") == "look at the numbers that changed"


@pytest.mark.parametrize(
    ("more", "verdict", "title", "tone"),
    [
        ({}, "CHANGED", "Rotor M3 pulls ", "warning"),
        (
            {"causes": ()},
            "CHANGED",
            "More than chance, but no change that is known explains it: thrust M3 by ",
            "warning",
        ),
        ({"reversed": ("scale z",)}, "CHANGED", "Scale z is reversed, or nothing, and in no reference", "warning"),
        (NOTHING, "NO CHANGE", "nothing beyond what flights of this vehicle differ by; unchanged within", "good"),
        (NOTHING | {"missing": ("thrust M4",)}, "NO CHANGE SEEN", "nothing beyond", "warning"),
        (NOTHING | {"fewest": 6}, "NO CHANGE SEEN", "nothing beyond what is usual of vehicles; unchanged", "warning"),
        (NOTHING | {"shows": ()}, "CANNOT TELL", "no change of any size that is looked for could have", "unsure"),
        (NOTHING | {"undetermined": ("scale z",)}, "CANNOT TELL", "scale z may be zero or reversed today", "unsure"),
        (NOTHING | {"contradictions": ("a.csv: odd", "a.csv: more")}, "CANNOT TELL", "a.csv", "unsure"),
    ],
)
def test_verdicts_of_today(more, verdict, title, tone):
    (box,) = [block for block in answer("changed", **more) if isinstance(block, Box)]
    assert (box.label, box.tone) == (verdict, tone)
    assert title in box.title


def test_alike_changes_and_notes():
    alike = tuple(Alike(name=name, belief=0.2) for name in ("rotors M1 and M3", "mass", "delay"))
    causes = (found("rotor M3", 0.2, alike=alike), found("hover", 0.1, named=False, belief=0.5, alike=alike[1:]))
    notes = ("left out: b.csv: flies for 1 s", "another <note> of *it*")
    blocks = answer("changed", causes=causes, warnings=notes, other_ranges=("c.csv",))
    assert blocks[0].title.endswith(", perhaps with another; sure to 97 %.")
    assert blocks[0].sentences[0].endswith("sure to 50 %; or another weight, 20 %; or another delay of the body, 20 %.")
    assert "Commands of c.csv are shares of another range" in blocks[0].sentences[-1]
    (facts,) = [dict(block.rows) for block in blocks if isinstance(block, Facts)]
    assert facts["Looks alike"] == "Another weight and another delay of the body."
    assert [(note.text, note.always) for note in warnings_of(blocks)] == list(zip(notes, (True, False), strict=True))


@pytest.mark.parametrize(
    ("more", "verdict", "title"),
    [
        ({}, "CHANGED", "Since flight13 (2023-11-26, flight 13 of 20): rotor M3 pulls "),
        ({"reversed": ("flight7: scale z reversed",)}, "CHANGED", "flight7: scale z reversed, as in no flight of the"),
        ({"shifts": (), "flights": ()}, "NO CHANGE", "over 0 flights, beyond what they differ by; in one flight"),
    ],
)
def test_verdicts_of_a_trend(more, verdict, title):
    if "flights" in more:
        flights = tuple(replace(own, beyond=()) for own in made["trend"]().flights)
        more, title = more | {"flights": flights}, title.replace(" 0 ", " 20 ")
    box = answer("trend", **more)[0]
    assert (box.label, title in box.title) == (verdict, True)


@pytest.mark.parametrize("name", ["changed", "trend"])
def test_each_has_a_figure_and_tables(name):
    result = made[name]()
    section = loaded(name).section(source_of(result, name), 1)
    assert (section.plots, len(section.tables)) == ([f"{name}-1-numbers"], 2)
    (fold,) = [block for block in section.blocks if isinstance(block, Folded)]
    assert fold.shown
    assert not [block for block in unfolded(section.blocks) if isinstance(block, Box)]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"), (5153.338, "5153"), (0.0123456, "0.01235"), (-0.5, "−0.5000"), (6.3e-9, "6.300 × 10⁻⁹"),
        (9.9999e5, "1.000 × 10⁶"), (math.inf, "∞"), (math.nan, "—"),
    ],
)  # fmt: skip
def test_a_number_keeps_its_significant_digits(value, text):
    assert number(value) == text


@pytest.mark.parametrize(
    ("value", "text"), [(121.5e-6, "121.5 × 10⁻⁶"), (2.7e-6, "2.7 × 10⁻⁶"), (9.81, "9.81"), (6.0, "6"), (0.0, "0")]
)
def test_settings_read_as_the_paper_prints_them(value, text):
    assert plain(value) == text


def test_a_share_of_variance_reads_one_only_when_nothing_is_missing():
    assert (r_squared(1.0), r_squared(1.0 - 1e-6), r_squared(0.98765)) == ("1", "> 0.9999", "0.9877")
    assert (r_squared(-1e-9), r_squared(-56730.0), r_squared(math.nan)) == ("0.0000", "−56730", "—")


def test_rounding_is_written_as_zero_and_a_change_with_its_sign():
    assert (percent(1.5e-15), percent(1.5e-6), percent(0.01706)) == ("0 %", "0.000150 %", "1.71 %")
    assert (change(56805 / 56254 - 1), change(-0.348), change(-1e-9)) == ("+0.98 %", "−34.80 %", "0 %")


@pytest.mark.parametrize(
    ("numbers", "written"),
    [
        ((0.0100000015, 0.0099995, 0.0100012), ("0.01000000", "0.00999950", "0.01000120")),
        ((0.0712, 0.0691, 0.0733), ("0.0712", "0.0691", "0.0733")),
        ((-0.0001395, -0.0001909, -8.812e-05), ("-0.000140", "-0.000191", "-0.000088")),
        ((-1.395e-5, -1.909e-5, -8.812e-06), ("-1.40e-5", "-1.91e-5", "-0.88e-5")),
        ((1234.5, 1100.0, 1400.0), ("1234", "1100", "1400")),
        ((0.001, -0.2, 0.2), ("0.00", "-0.20", "0.20")),
        ((-0.001, -0.2, 0.2), ("0.00", "-0.20", "0.20")),
        ((3.0, float("nan"), float("nan")), ("3", "—", "—")),
        ((2.0, 2.0, 2.0), ("2", "2", "2")),
        ((0.0, 0.0, 0.0), ("0", "0", "0")),
    ],
)
def test_rounding_by_the_width(numbers, written):
    assert with_interval(*numbers) == written


@given(st.floats(-1e3, 1e3), st.floats(1e-8, 1e3), st.floats(0.05, 1))
def test_ends_are_distinguished_and_right_to_a_tenth_of_the_width(value, width, share):
    low, high = value - share * width, value + width
    _, first, last = (float(text) for text in with_interval(value, low, high))
    assert first < last
    assert abs(first - low) <= 0.1 * (high - low)
    assert abs(last - high) <= 0.1 * (high - low)


def test_print():
    assert (printed("-1.40e-4"), printed("0.25")) == ("−1.40 × 10⁻⁴", "0.25")


def test_numbers_are_not_rounded_into_certainty():
    assert [whole_percent(share) for share in (0.0, 0.001, 0.42, 0.9961, 1.0)] == [
        "0 %", "< 1 %", "42 %", "> 99 %", "100 %",
    ]  # fmt: skip
    assert (probability(1e-9), probability(0.0123)) == ("< 10⁻⁶", "0.012")


def test_words_become_phrases_and_sentences():
    assert (joined(["a", "b", "c", "a"]), joined(["a", "b"], "or")) == ("a, b and c", "a or b")
    assert sentence("no rotors") == "No rotors."
    assert sentence("log_1.csv: saturated?") == "log_1.csv: saturated?"
