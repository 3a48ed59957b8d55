"""What comes again, on a page: sentences from the facts of a record, and nothing that its numbers deny."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.artifacts.diagnosis import DiagnosisRecord
from cpfls_cli.artifacts.disagreement import DisagreementRecord
from cpfls_cli.pages.diagnosis import answer
from cpfls_cli.pages.disagreement import answer as answer_of_disagreement
from cpfls_cli.pages.first_screen import next_steps, verdict_box
from cpfls_cli.pages.repeats import NO_EFFECT, NOT_SPLIT, WHAT_TO_FLY, again_blocks, again_box
from cpfls_cli.report.content import Box, Facts, Folded, Heading, Plot, Text, unfolded
from tests.builders import gap_artifacts as made
from tests.builders.forms import source_of_record

NOTHING = np.zeros((6, 6))


def shares(**parts):
    """Shares of nothing, but for some channels, by band: all, 2 to 6 Hz, and so on to the slowest."""
    found = NOTHING.copy()
    for channel, bands in parts.items():
        found[["roll", "pitch", "yaw", "x", "y", "z"].index(channel)] = bands
    return found


PITCH = shares(pitch=[0.3, 0.0, 0.0, 0.4, 0.6, 0.0])


def test_the_largest_share_that_comes_again_stands_first():
    box = again_box(made.comes_again(PITCH))
    assert box.title == (
        "Of the gap in the torque about y (pitch) from 0.25 to 1.5 Hz 50 % comes again: the model lacks an effect "
        "there."
    )
    assert box.sentences[1] == (
        "Torque about y (pitch): 50 % comes again from 0.25 to 1.5 Hz (of the motion that comes again the model "
        "explains 85 % "
        "to 90 %). The rest: gusts of about 3.3 rad/s², or noise that is not white."
    )
    assert len(box.sentences) == 6


def test_where_nothing_comes_again_no_effect_explains_the_gap():
    box = again_box(made.comes_again(NOTHING))
    assert box.title == (
        "The gap does not come again (at most 4 % of it): gusts or noise, and no effect of the vehicle explains it."
    )
    assert box.sentences[0].startswith("Torque about x (roll): nothing comes again (at most 4 %).")


def test_what_runs_do_not_tell_is_open():
    box = again_box(made.comes_again(NOTHING, error=0.5))
    assert box.title == "These runs do not tell whether the gap comes again: up to 100 % of it may."
    assert "nothing surely comes again" in box.sentences[0]


def test_chance_is_not_taken_for_an_effect():
    """Twice the error, in one of 36 numbers, is nothing."""
    assert not made.comes_again(shares(yaw=[0.0, 0.0, 0.0, 0.2, 0.0, 0.0]), error=0.1).channels


def test_noise_that_is_larger_than_gusts_is_named():
    box = again_box(made.comes_again(NOTHING, noise=3.9))
    assert "The rest: noise of the sensors of about 3.9 rad/s²." in box.sentences[0]


@pytest.mark.parametrize(
    ("after", "gap", "left", "words"),
    [
        (
            NOTHING,
            4.0,
            "0 %",
            "With damping, what is left does not come again (at most 4 % of it): gusts or noise, and no effect of",
        ),
        (
            PITCH / 2,
            4.0,
            "50 %",
            "With damping, part of what is left comes again, in the torque about y (pitch): more is missing.",
        ),
        # Squares: all of 1.2 of 4.0 is left.
        (PITCH, 1.2, "9 %", "With damping, 9 % at most of what comes again is left: no further effect shows."),
        (
            PITCH + shares(yaw=[0.3, 0.0, 0.0, 0.4, 0.6, 0.0]),
            1.2,
            "9 %",
            "With damping, part of what is left comes again, in the torque about z (yaw): more is missing.",
        ),
    ],
)
def test_what_effects_leave_is_told_and_more_is_missing_only_where_that_is_visible(after, gap, left, words):
    box = again_box(made.comes_again(PITCH), made.comes_again(after, gap=gap), "with damping")
    assert box.sentences[-1].startswith(words)
    assert f"50 % comes again from 0.25 to 1.5 Hz, of which {left} is left" in box.sentences[1]


def test_the_split_stands_behind_a_verdict_and_before_a_gap():
    groups = {"again_before": made.comes_again(PITCH), "again_after": made.comes_again(NOTHING)}
    record = replace(DiagnosisRecord.of_data(*_parts(made.diagnosis())), **groups)
    first, second = (block for block in answer(source_of_record(record)) if isinstance(block, Box))
    assert [first.label, second.label] == ["NAMED", "REPEATS"]
    assert record.summary["comes_again"]["before"]["channels"]["torque y"]["comes_again"][3:5] == [True, True]
    compared = replace(DisagreementRecord.of_data(*_parts(made.disagreement())), again=groups["again_before"])
    boxes = [block.label for block in answer_of_disagreement(source_of_record(compared)) if isinstance(block, Box)]
    assert boxes == ["REPEATS", "GAP"]


@pytest.mark.parametrize("floors", [2.0, 1.0])
def test_a_gap_that_does_not_come_again_is_said_beside_the_verdict(floors):
    """And what to do next is no search for an effect; within the noise nothing is left."""
    given = made.diagnosis(**{"verdict": "UNEXPLAINED", "named": (), "gap/after_floors": np.full(6, floors)})
    groups = {"again_before": made.comes_again(NOTHING), "again_after": made.comes_again(NOTHING)}
    record = replace(DiagnosisRecord.of_data(*_parts(given)), **groups)
    assert (NO_EFFECT in verdict_box(record).sentences) == (floors > 1.5)
    assert next_steps(record)[0].startswith("Nothing on the model" if floors > 1.5 else "Look at what is left")


def test_without_repeats_one_line_says_what_to_fly():
    record = DiagnosisRecord.of_data(*_parts(made.diagnosis()))
    rows = [
        row for block in unfolded(answer(source_of_record(record))) if isinstance(block, Facts) for row in block.rows
    ]
    assert ("Gusts", NOT_SPLIT) in rows
    assert NOT_SPLIT.endswith(WHAT_TO_FLY)
    compared = DisagreementRecord.of_data(*_parts(made.disagreement()))
    assert Text(NOT_SPLIT) in list(unfolded(answer_of_disagreement(source_of_record(compared))))
    assert record.summary["comes_again"] is compared.summary["comes_again"] is None


def test_bars_hold_all_and_the_table_every_band():
    heading, text, plot, folded = again_blocks(made.comes_again(PITCH), made.comes_again(NOTHING), 1, "diagnosed")
    assert (type(heading), type(text), type(plot), type(folded)) == (Heading, Text, Plot, Folded)
    assert text.text.startswith("4 runs of one path (one.csv and two.csv)")
    panels = plot.picture.panels
    assert len(panels) == 6
    before = [series.y for series in panels[1].series if len(series.y) == 5]
    assert len(before) == 8
    (table,) = folded.blocks
    assert len(table.rows) == 36
    assert table.rows[9][:3] == ["torque about y (pitch)", "0.5 to 1.5", "rad/s²"]
    assert table.rows[9][3:] == ["4.0", "40 ± 4 %", "90 %", "4.0", "0 ± 4 %", "100 %"]
    assert "<svg" in plot.picture.svg


def _parts(artifact):
    return artifact.header, artifact.data
