"""Blocks as lines of a terminal: what is shown, in how many columns, and in which colours."""

import re

import pytest

from cpfls_cli.report.content import Box, Cell, Facts, Folded, Heading, Listing, Plot, Table, Text
from cpfls_cli.report.terminal import folded_words, terminal_lines, warnings_of

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


def test_facts_stand_in_two_columns_and_long_ones_are_broken_under_themselves():
    facts = Facts([("Source", "simulated along a path with a long name"), ("Samples", "549")])
    assert lines(facts) == ["Source   simulated along a path with a long name", "Samples  549"]
    assert lines(facts, width=30) == ["Source   simulated along a", "         path with a long name", "Samples  549"]


def test_a_table_without_titles_has_no_header():
    assert lines(Table("t", "", ("", ""), [["a", "1"], ["bc", "23"]])) == ["a    1", "bc  23"]


def test_sentences_stand_as_they_are_and_pictures_stay_on_the_page():
    plot, folded = Plot("p", "A picture.", "<svg/>"), Folded("More", [TABLE])
    box = Box("Verdict", "good", ["one reason", "another"])
    shown = lines(Text("a sentence"), Heading("a heading"), box, Listing("one\ntwo\n"), plot, folded)
    assert shown == ["a sentence", "a heading", "Verdict: good", "  one reason", "  another", "one", "two"]


def test_what_warns_is_apart():
    blocks = [Text("all is well"), Text("beware", "warning"), Text("note this", "note")]
    assert lines(*blocks) == ["all is well", "note this"]
    assert warnings_of(blocks) == (Text("beware", "warning"),)
    assert warnings_of([Folded("More", blocks)]) == warnings_of(blocks)


def test_what_is_folded_away_is_named_and_shown_on_request():
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
