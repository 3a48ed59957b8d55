"""What is said of changes: of every kind, with every verdict, for one flight and for many."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cpfls_cli import page
from cpfls_cli.changes.results import Alike, Found
from cpfls_cli.report.change_words import cause_name, change_words, smallest_words, what_to_check
from cpfls_cli.report.content import Box, Facts, Folded, unfolded
from cpfls_cli.report.terminal import warnings_of
from cpfls_cli.result import Estimate
from cpfls_cli.stage import loaded
from tests.builders.drawn_numbers import QUAD, drawn_changed, drawn_trend
from tests.builders.gap_artifacts import source_of as made_of

made = {"changed": cache(drawn_changed), "trend": cache(drawn_trend)}


def found(name, *sizes, **more):
    """A change of these sizes, each surely not 0."""
    given = tuple(Estimate.around(size, 0.1 * abs(size)) for size in sizes)
    return Found(**{"name": name, "named": True, "belief": 0.97, "unit": "1", "sizes": given, "alike": (), **more})


def source_of(result, name):
    """Say where a result of this vehicle comes from."""
    return replace(made_of(result, name), vehicle=QUAD)


def told(name, **more):
    """Give the blocks of the answer."""
    result = replace(made[name](), **more)
    return page.blocks(loaded(name).text(result, about=source_of(result, name)))


@pytest.mark.parametrize(
    ("cause", "sizes", "words", "shows"),
    [
        ("rotor M3", [0.2], "rotor M3 pulls 20 % less (18 to 22 %)", "a rotor that pulls 20 % less"),
        ("mass", [-0.1], "it is 600 g lighter (540 to 660 g)", "600 g"),
        ("hover", [0.1], "hover needs 10 % more (9.0 to 11 %) thrust: 600 g heavier, or all rotors pull less", None),
        ("load on a cable", [0.1], "600 g (540 to 660 g) hang under it on a cable of 0.70 m", "600 g on a cable"),
        ("centre of mass", [-0.02, 0.01], "the centre of mass lies 20 mm to the back (18 to 22 mm) and 10 mm", None),
        ("turn M1", [np.log(1.21)], "rotor M1 turns 10 % faster (", None),
        ("vibration", [np.log(2)], "it vibrates 2.0 times as strong", "2.0 times the vibration"),
        ("delay", [-0.01], "rotation follows the rotors 10 ms earlier (9.0 to 11 ms)", None),
        ("drift", [0.05, 0.02, 0.01], "the gyroscope is off by 0.050 rad/s about x, 0.020 rad/s about y and", None),
        ("odd thing", [0.5], "odd thing: 0.50", "odd thing: 0.50"),
    ],
)
def test_a_change_in_words(cause, sizes, words, shows):
    given = found(cause, *sizes, cable_m=0.7)
    assert change_words(given, 6.0, ["drift x", "drift y", "drift z"]).startswith(words)
    if shows:
        assert smallest_words(cause, abs(sizes[0]), 6.0) == shows


def test_names_and_checks():
    assert cause_name("unbalance M2") == "another balance of rotor M2"
    assert cause_name("unbalance") == "another balance of rotors"
    assert cause_name("odd thing") == "odd thing"
    assert what_to_check("scale z").startswith("see whether the gyroscope's range")
    assert what_to_check("odd thing") == "look at the numbers that changed"


NOTHING = {"p": 0.5, "causes": (), "numbers": ()}


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
        (NOTHING | {"shows": ()}, "CANNOT TELL", "no change of any size that is looked for would have", "unsure"),
        (NOTHING | {"undetermined": ("scale z",)}, "CANNOT TELL", "scale z may be zero or reversed today", "unsure"),
        (NOTHING | {"contradictions": ("a.csv: odd", "a.csv: more")}, "CANNOT TELL", "a.csv", "unsure"),
    ],
)
def test_verdicts_of_today(more, verdict, title, tone):
    (box,) = [block for block in told("changed", **more) if isinstance(block, Box)]
    assert (box.label, box.tone) == (verdict, tone)
    assert title in box.title


def test_alike_changes_and_notes():
    alike = tuple(Alike(name=name, belief=0.2) for name in ("rotors M1 and M3", "mass", "delay"))
    causes = (found("rotor M3", 0.2, alike=alike), found("hover", 0.1, named=False, belief=0.5, alike=alike[1:]))
    notes = ("left out: b.csv: flies for 1 s", "another <note> of *it*")
    blocks = told("changed", causes=causes, warnings=notes, other_ranges=("c.csv",))
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
    box = told("trend", **more)[0]
    assert (box.label, title in box.title) == (verdict, True)


@pytest.mark.parametrize("name", ["changed", "trend"])
def test_each_has_a_figure_and_tables(name):
    result = made[name]()
    section = loaded(name).section(source_of(result, name), 1)
    assert section.plots == [f"{name}-1-numbers"]
    assert len(section.tables) == 2
    (fold,) = [block for block in section.blocks if isinstance(block, Folded)]
    assert fold.shown
    assert not [block for block in unfolded(section.blocks) if isinstance(block, Box)]
