"""The repeatable part, on a page: sentences from the facts of a record, and nothing that its numbers deny."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.pages.gap_words import NOT_SPLIT, WHAT_TO_FLY, repeatability_drawn
from cpfls_cli.report.canvas import picture_of
from cpfls_cli.report.content import Box, Facts, Folded, Table, Text, unfolded
from cpfls_cli.result import plain
from tests.builders import gap_artifacts as made

WITH = "With offset of the centre of mass"
NO_EFFECT = "The residual is not repeatable: no effect of the vehicle explains it."
NOTHING = np.zeros((6, 6))


def shares(**parts):
    """Shares of nothing, but for some channels, by band: all, 2 to 6 Hz, and so on to the slowest."""
    found = NOTHING.copy()
    for channel, bands in parts.items():
        found[["roll", "pitch", "yaw", "x", "y", "z"].index(channel)] = bands
    return found


PITCH = shares(pitch=[0.3, 0.0, 0.0, 0.4, 0.6, 0.0])


def again_box(before, after=None):
    """Give the box of what repeats, and what is said channel by channel, of a comparison or a diagnosis."""
    if after is None:
        blocks = made.blocks_of(replace(made.disagreement(), repeatability=before), "compare")
    else:
        blocks = made.blocks_of(
            replace(made.diagnosis(), repeatability_before=before, repeatability_after=after), "diagnose"
        )
    box = next(each for each in blocks if isinstance(each, Box) and each.label == "REPEATS")
    told = next(each for each in blocks if isinstance(each, Folded) and each.summary.startswith("repeatable part, ch"))
    return box, [each.text for each in told.blocks]


def test_the_largest_repeatable_share_is_first():
    box, sentences = again_box(made.repeatability(PITCH))
    assert box.title == (
        "Of the gap in the torque about y (pitch) from 0.25 to 1.5 Hz 50 % is repeatable: the model lacks an effect "
        "there."
    )
    assert sentences[1] == (
        "Torque about y (pitch): 50 % is repeatable from 0.25 to 1.5 Hz (of the repeatable motion the model "
        "explains 85 % "
        "to 90 %). The rest: gusts of about 3.3 rad/s², or noise that is not white."
    )
    assert len(sentences) == 6


def test_where_nothing_is_repeatable_no_effect_explains_the_gap():
    box, sentences = again_box(made.repeatability(NOTHING))
    assert box.title == (
        "The gap is not repeatable (at most 4 % of it): gusts or noise, and no effect of the vehicle explains it."
    )
    assert sentences[0].startswith("Torque about x (roll): nothing is repeatable (at most 4 %).")


def test_what_runs_do_not_tell_is_open():
    box, sentences = again_box(made.repeatability(NOTHING, error=0.5))
    assert box.title == "These runs do not show whether the gap is repeatable: up to 100 % of it may be."
    assert "nothing is surely repeatable" in sentences[0]


def test_chance_is_not_taken_for_an_effect():
    """Twice the error, in one of 36 numbers, is nothing."""
    assert not made.repeatability(shares(yaw=[0.0, 0.0, 0.0, 0.2, 0.0, 0.0]), error=0.1).repeating


def test_noise_that_is_larger_than_gusts_is_named():
    _, sentences = again_box(made.repeatability(NOTHING, noise=3.9))
    assert "The rest: noise of the sensors of about 3.9 rad/s²." in sentences[0]


@pytest.mark.parametrize(
    ("after", "gap", "left", "words"),
    [
        (
            NOTHING,
            4.0,
            "0 %",
            f"{WITH}, the residual is not repeatable (at most 4 % of it): gusts or noise, and no effect of",
        ),
        (
            PITCH / 2,
            4.0,
            "50 %",
            f"{WITH}, part of the residual is repeatable, in the torque about y (pitch): more is missing.",
        ),
        # Squares: all of 1.2 of 4.0 is left.
        (
            PITCH,
            1.2,
            "9 %",
            f"{WITH}, 9 % at most of the repeatable gap remains: no further effect shows.",
        ),
        (
            PITCH + shares(yaw=[0.3, 0.0, 0.0, 0.4, 0.6, 0.0]),
            1.2,
            "9 %",
            f"{WITH}, part of the residual is repeatable, in the torque about z (yaw): more is missing.",
        ),
    ],
)
def test_what_effects_leave_is_told_and_more_is_missing_only_where_that_is_visible(after, gap, left, words):
    _, sentences = again_box(made.repeatability(PITCH), made.repeatability(after, gap=gap))
    assert sentences[-1].startswith(words)
    assert f"50 % is repeatable from 0.25 to 1.5 Hz, of which {left} remains" in sentences[1]


def test_the_split_stands_behind_a_verdict_and_before_a_gap():
    groups = {"repeatability_before": made.repeatability(PITCH), "repeatability_after": made.repeatability(NOTHING)}
    found = replace(made.diagnosis(), **groups)
    assert [each.label for each in made.blocks_of(found, "diagnose") if isinstance(each, Box)] == ["NAMED", "REPEATS"]
    assert plain(found)["repeatability"]["before"]["channels"]["torque y"]["repeatable"][3:5] == [True, True]
    compared = made.blocks_of(replace(made.disagreement(), repeatability=groups["repeatability_before"]), "compare")
    assert [each.label for each in compared if isinstance(each, Box)] == ["REPEATS", "GAP"]


@pytest.mark.parametrize("floors", [2.0, 1.0])
def test_a_gap_that_does_not_come_again_is_said_beside_the_verdict(floors):
    """And what to do next is no search for an effect; within the noise nothing is left."""
    given = made.diagnosis(**{"verdict": "UNEXPLAINED", "named": (), "gap/after_floors": np.full(6, floors)})
    groups = {"repeatability_before": made.repeatability(NOTHING), "repeatability_after": made.repeatability(NOTHING)}
    box, facts, *_ = made.blocks_of(replace(given, **groups), "diagnose")
    assert (NO_EFFECT in box.sentences) == (floors > 1.5)
    assert dict(facts.rows)["Next"].startswith("Nothing on the model" if floors > 1.5 else "Look at the residual")


def test_without_repeats_one_line_says_what_to_fly():
    blocks = list(unfolded(made.blocks_of(made.diagnosis(), "diagnose")))
    assert ("Gusts", NOT_SPLIT) in [row for block in blocks if isinstance(block, Facts) for row in block.rows]
    assert NOT_SPLIT.endswith(WHAT_TO_FLY)
    assert Text(NOT_SPLIT) in list(unfolded(made.blocks_of(made.disagreement(), "compare")))
    assert plain(made.diagnosis())["repeatability"] is plain(made.disagreement())["repeatability"] is None


@pytest.mark.usefixtures("drawn")
def test_bars_hold_all_and_the_table_every_band():
    groups = {"repeatability_before": made.repeatability(PITCH), "repeatability_after": made.repeatability(NOTHING)}
    found = replace(made.diagnosis(), **groups)
    picture = picture_of(repeatability_drawn(lambda r: (r.repeatability_before, r.repeatability_after)), "again", found)
    panels = picture.figure().axes
    assert len(panels) == 6
    assert len([bars for bars in panels[1].containers if len(bars) == 5]) == 8
    assert "<svg" in picture.svg
    blocks = made.blocks_of(found, "diagnose")
    text, _, table = next(each.blocks for each in blocks if getattr(each, "summary", "").endswith("band by band"))
    assert text.text.startswith("4 runs of one path (one.csv and two.csv)")
    assert isinstance(table, Table)
    assert len(table.rows) == 36
    row = [cell.text for cell in table.cells[9]]
    assert row[:3] == ["torque about y (pitch)", "0.5 to 1.5", "rad/s²"]
    assert row[3:] == ["4.0", "40 ± 4 %", "90 %", "4.0", "0 ± 4 %", "100 %"]
