"""Pages of the gap workflow: its forms, effects, disagreement, repeats and disturbance."""

import json
import re
from dataclasses import replace
from html import unescape
from itertools import starmap

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from cpfls_cli import page
from cpfls_cli.config.study import Study
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.naming.results import Estimate, LikelySet, Unexplained
from cpfls_cli.pages.gap import BEFORE, MEASURED, effect_title, keep_in_view, leaves_view, marked
from cpfls_cli.pages.gap_words import NOT_SPLIT, WHAT_TO_FLY, repeatability_drawn
from cpfls_cli.pages.page import report_page
from cpfls_cli.playback.disturbance import FoundGusts
from cpfls_cli.playback.errors import PREDICTIONS, WITH_PAST
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import Observer, free_runs, player_of
from cpfls_cli.playback.replay import Played, replay
from cpfls_cli.report.canvas import HELD, picture_of
from cpfls_cli.report.content import Box, Facts, Folded, Form, Table, Text, unfolded
from cpfls_cli.report.source import Sources
from cpfls_cli.report.terminal import terminal_lines
from cpfls_cli.result import plain
from cpfls_cli.stages.compare import _offsets, _signal_words
from cpfls_cli.stages.vehicle import vehicle
from cpfls_cli.stages.vehicle import vehicle as stage
from tests.builders import gap_artifacts as made
from tests.builders.gusty_flights import SMALL, STORM, Flight, gusty_flights
from tests.builders.vehicle_models import QUAD, source_of_vehicle, vehicle_of, whole

WITH = "With offset of the centre of mass"
NO_EFFECT = "The residual is not repeatable: no effect of the vehicle explains it."
NOTHING = np.zeros((6, 6))


def test_curves_are_distinguished_without_colour():
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


GREW = made.gap_change(after=np.array([60.0, 0.01, 0.9, 0.9, 0.8, 1.2]))
LEFT = (
    Unexplained("torque z", 14.2, "yaw", 0.82, 3.21, "feeds"),
    Unexplained("force x", 2.0, None, 0.0, None, "neither"),
)
_WIDE = 80


def phrases(block):
    """List what a block says: sentences, rows of tables, facts."""
    match block:
        case Box():
            return [block.title, *block.sentences]
        case Table():
            return [" ".join(cell.text for cell in row) for row in block.cells]
        case Facts():
            return [value for _, value in block.rows]
        case Text():
            return [block.text]
        case Folded():
            return [phrase for inner in block.blocks for phrase in phrases(inner)]
    return []


def words(text):
    """Let case, spaces, the marks of what is code and the end of a sentence be."""
    return " ".join(text.replace("`", "").split()).lower().rstrip(".")


def in_all_forms(source, blocks):
    """Tell a record on a page; give the text of each form, one line for each row of a table."""
    sources = Sources([source], source.vehicle, Study().report)
    html, markdown, data = (report_page(sources, "0", form).text for form in (Form.HTML, Form.MARKDOWN, Form.JSON))
    plain = re.sub(r"^> ", "", markdown, flags=re.MULTILINE)
    plain = plain.replace("**", "").replace(" | ", " ").replace("| ", "").replace(" |", "")
    texts = {
        "terminal": "\n".join(terminal_lines(blocks, whole=True)),
        "html": _of_html(html),
        "markdown": unescape(re.sub(r"\\(.)", r"\1", plain)),
        "json": "\n".join(_of_json(json.loads(data))),
    }
    return {form: "\n".join(" ".join(line.split()) for line in text.splitlines()) for form, text in texts.items()}


def _of_html(page):
    rows = re.sub(r"\s*\n\s*", " ", re.sub(r"<style>.*?</style>|<svg.*?</svg>", "", page, flags=re.DOTALL))
    return unescape(re.sub(r"<[^>]+>", " ", re.sub(r"</(tr|p|div|li|dd|h\d|caption|figcaption|thead)>", "\n", rows)))


def _of_json(value):
    """List all text, the cells of a row on one line."""
    if isinstance(value, dict):
        for item in value.values():
            yield from _of_json(item)
    elif isinstance(value, list) and value and all(isinstance(item, str) for item in value):
        yield " ".join(value)
    elif isinstance(value, list):
        for item in value:
            yield from _of_json(item)
    elif isinstance(value, str):
        yield value


@pytest.mark.parametrize(
    ("stage", "found"),
    [
        ("compare", made.disagreement()),
        ("compare", made.disagreement(force=False)),
        ("compare", made.disagreement(floors=np.linspace(1.0, 1.5, 6))),
        ("diagnose", made.diagnosis()),
        ("diagnose", made.diagnosis("AMBIGUOUS", alternatives=(made.RIVAL,))),
        ("diagnose", made.diagnosis("UNEXPLAINED", named=(), closest=(made.effect(),), unexplained=LEFT)),
        ("diagnose", made.diagnosis("NO_GAP", named=(), force=False)),
        ("extend", made.extended()),
        ("extend", made.extended(gap=GREW)),
        (
            "diagnose",
            made.diagnosis(named=("gyro_bias",), audit=made.audit_with_fault(warnings=("rotor 2 looks saturated",))),
        ),
    ],
)
def test_every_form_says_what_the_command_says(stage, found):
    _require_in_all_forms(made.source_of(found, stage), made.blocks_of(found, stage))


def _holds(answer, phrase):
    return set(words(phrase).split()) <= set(answer.split())


def _require_in_all_forms(source, blocks):
    said = [phrase for block in blocks for phrase in phrases(block)]
    assert len(said) > 6
    warned = [block.text for block in blocks if isinstance(block, Text) and block.tone == "warning"]
    for form, text in in_all_forms(source, blocks).items():
        answer = words(text)
        for phrase in said:
            # Warnings of a command go to standard error, and a terminal breaks long cells.
            assert words(phrase) in answer or (
                form == "terminal" and (phrase in warned or (len(phrase) > _WIDE and _holds(answer, phrase)))
            ), (form, phrase)


OFFSET = made.named_effect(
    "com_offset",
    linear=[0.01],
    numbers=(Estimate("c_x", "m", 0.0100000015, 0.0099995, 0.0100012, (-0.1, 0.1)),),
    p_value=1e-9,
    share=0.998,
    sentence="Off centre.",
)


def closest_sentence(effect):
    box, *_ = made.blocks_of(replace(made.diagnosis("UNEXPLAINED", named=()), closest=(effect,)), "diagnose")
    return box.sentences[0]


def named_sentences(effects):
    box, *_ = made.blocks_of(replace(made.diagnosis(), effects=tuple(effects)), "diagnose")
    return box.sentences


def effect_sentence(effect):
    return named_sentences([effect])[0]


def tables(found):
    return [each for each in unfolded(made.blocks_of(found, "diagnose")) if isinstance(each, Table)]


def test_every_effect_has_a_title():
    assert all(effect_title(name) == entry.title for name, entry in CATALOGUE.items())
    assert effect_title("of_another_version") == "of another version"


def test_ends_of_an_interval_can_be_distinguished_and_rounding_makes_no_certainty():
    assert effect_sentence(OFFSET) == (
        "Offset of the centre of mass (com_offset): c_x = 0.01000000 [0.00999950, 0.01000120] m (p < 10⁻⁶, more than "
        "99 % of the gap)."
    )
    assert "less than 1 % of" in effect_sentence(replace(OFFSET, share=-0.001))
    assert "(p = 0.012, " in effect_sentence(replace(OFFSET, p_value=0.0123))
    assert closest_sentence(OFFSET).startswith(
        "The closest was offset of the centre of mass, which does not explain the gap: "
    )
    # Of an effect that is not the answer the share is none of the gap.
    assert closest_sentence(OFFSET).endswith("(p < 10⁻⁶, more than 99 % of what the closest effects explain).")


def test_shares_of_effects_that_overlap_are_what_returns_without_each():
    pair = [replace(OFFSET, share=0.7), replace(OFFSET, share=0.6)]
    assert named_sentences(pair)[1].endswith("(p < 10⁻⁶, 60 % of the gap returns without it).")
    apart = [replace(OFFSET, share=0.7), replace(OFFSET, share=0.3)]
    assert named_sentences(apart)[1].endswith("(p < 10⁻⁶, 30 % of the gap).")


def test_a_power_of_ten_that_all_three_have_stands_once():
    torque = Estimate("M_x", "N m", 2e-6, -6.86e-5, 7.28e-5, (-1e-3, 1e-3))
    assert "M_x = 0.2 [−6.9, 7.3] × 10⁻⁵ N m (p" in effect_sentence(replace(OFFSET, numbers=(torque,)))
    alone = Estimate("M_x", "N m", 2e-6, np.nan, np.nan, (-1e-3, 1e-3))
    assert "M_x = 2 × 10⁻⁶ [—, —] N m (p" in effect_sentence(replace(OFFSET, numbers=(alone,)))


def test_a_wrong_thrust_is_not_said_to_be_a_wrong_inertia_too():
    """Rates show inertia over rotor torque, so that of a thrust 17 % less every moment of inertia seems 20 % more."""

    def headline(inertia, half):
        numbers = [Estimate("inertia_x", "1", inertia, inertia - half, inertia + half, (-1, 3))]
        numbers.append(Estimate("thrust_scale", "1", -0.17, -0.175, -0.165, (-1, 3)))
        effect = made.named_effect("parameter_error", numbers=tuple(numbers))
        box, *_ = made.blocks_of(replace(made.diagnosis(), effects=(effect,)), "diagnose")
        return box.title

    assert headline(0.2, 0.01) == (
        "A parameter of the vehicle is wrong: thrust −17.00 % (as the ratio of Ixx to the rotor torque shows too) "
        "against the config."
    )
    assert headline(0.3, 0.01).startswith("Parameters of the vehicle are wrong: Ixx +30.0 % and thrust −17.0")


def test_errors_of_the_vehicles_numbers_are_per_cent_with_a_sign():
    def said(name, *number, effect="parameter_error"):
        return effect_sentence(replace(OFFSET, name=effect, numbers=(Estimate(name, "1", *number, (-0.9, 3.0)),)))

    assert "(parameter_error): Izz over yaw torque +24.0 % [+19.9, +28.1] (p" in said("inertia_z", 0.24, 0.199, 0.281)
    assert "Ixx −8 % [−20, +4] (p" in said("inertia_x", -0.08, -0.2, 0.04)
    assert ": drag factor +20.1 % [+18.0, +22.2] (p" in said("error", 0.201, 0.18, 0.222, effect="drag_factor_error")
    assert "thrust −9.00 % [−9.11, −8.89] (p" in said("thrust_scale", -0.09, -0.0911, -0.0889)


def test_an_effect_stands_once_next_to_its_coefficients():
    found = made.diagnosis(named=("com_offset", "wind"))
    (table,) = [each for each in tables(found) if each.header[:2] == ["Effect", "Coefficient"]]
    assert [row[0].text for row in table.cells] == ["com_offset", "wind"]


def test_sets_stand_in_a_table_with_how_likely_each_is():
    likely = {("com_offset", "motor_lag"): 0.954, ("torque_bias", "motor_lag"): 0.046}
    found = made.diagnosis(sets=tuple(starmap(LikelySet, likely.items())))
    (table,) = [each for each in tables(found) if each.header[0] == "Set of effects"]
    assert [[cell.text for cell in row] for row in table.cells] == [
        ["offset of the centre of mass and motor lag", "95 %"],
        ["constant torque and motor lag", "5 %"],
    ]


# What the example of docs/gap.md shows with nothing hidden and seed 13: five of six channels above one floor.
NOTHING_HIDDEN = np.array([1.01, 1.15, 0.908, 1.01, 1.06, 1.10])


@pytest.mark.parametrize(
    ("floors", "above"),
    [
        (NOTHING_HIDDEN, "nnnnnn"),
        (np.array([12.0, 3.0, 0.8, 5.0, 4.0, 70.0]), "yynyyy"),
        (np.array([1.5, 1.51, 0.8, np.nan, np.nan, np.nan]), "nyn"),
    ],
)
def test_every_form_calls_the_same_channels_above_noise(floors, above):
    record = made.disagreement(floors=floors)
    assert "".join("y" if index in record.sizes.above_noise else "n" for index in record.sizes.known) == above
    for form, text in in_all_forms(made.source_of(record, "compare"), made.blocks_of(record, "compare")).items():
        begins = ("roll t", "pitch t", "yaw t", "force")
        rows = [line.split() for line in text.splitlines() if line.startswith(begins) and line.endswith("%")]
        assert "".join(row[-3][0] for row in rows) == above, form
        assert ("Model and flights agree within the noise." in text) is ("y" not in above), form
        assert ("The gap is largest in the" in text) is ("y" in above), form
        assert ("follows thrust (90 %)" in text) is ("y" in above), form


def test_no_signal_is_drawn_where_nothing_is_above_noise():
    assert "(dependence)" not in made.text_of(made.disagreement(floors=NOTHING_HIDDEN), "compare")


@given(st.lists(st.tuples(st.floats(0, 1e4), st.integers(1, 30)), min_size=1, max_size=5))
def test_flights_stand_one_after_another_without_overlap(flights):
    clock = np.concatenate([start + 0.2 * np.arange(windows) for start, windows in flights])
    flight = np.repeat(np.arange(len(flights)), [windows for _, windows in flights])
    shifted = clock + _offsets(flight, clock)[flight]
    assert shifted[0] == pytest.approx(0.0, abs=1e-9)
    assert np.all(np.diff(shifted) > -1e-9)


@pytest.mark.parametrize(
    ("signal", "words"),
    [("body rate x", "body rate x, rad/s"), ("height", "height, m"), ("rotor speed 2", "rotor speed 2, rad/s")],
)
def test_signals_carry_their_units(signal, words):
    assert _signal_words(signal) == words


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
    answer = next(
        each for each in blocks if isinstance(each, Folded) and each.summary.startswith("repeatable part, ch")
    )
    return box, [each.text for each in answer.blocks]


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


def test_what_runs_do_not_show_is_open_chance_is_no_effect_and_larger_noise_is_named():
    box, sentences = again_box(made.repeatability(NOTHING, error=0.5))
    assert box.title == "These runs do not show whether the gap is repeatable: up to 100 % of it may be."
    assert "nothing is surely repeatable" in sentences[0]
    # Twice the error, in one of 36 numbers, is nothing.
    assert not made.repeatability(shares(yaw=[0.0, 0.0, 0.0, 0.2, 0.0, 0.0]), error=0.1).repeating
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
        (PITCH, 1.2, "9 %", f"{WITH}, 9 % at most of the repeatable gap remains: no further effect shows."),
        (
            PITCH + shares(yaw=[0.3, 0.0, 0.0, 0.4, 0.6, 0.0]),
            1.2,
            "9 %",
            f"{WITH}, part of the residual is repeatable, in the torque about z (yaw): more is missing.",
        ),
    ],
)
def test_what_effects_leave_is_said_and_more_is_missing_only_where_that_is_visible(after, gap, left, words):
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
def test_a_gap_that_does_not_come_again_is_said_next_to_the_verdict(floors):
    """And what to do next is no search for an effect; within the noise nothing is left."""
    given = made.diagnosis("UNEXPLAINED", named=(), gap=made.gap_change(after=np.full(6, floors)))
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


BODIES = np.array([*QUAD.inertia_kg_m2[:3], *[QUAD.mass_kg] * 3])
FOUND = FoundGusts(
    size=BODIES * [3.0, np.nan, np.nan, 0.3, np.nan, np.nan],
    low=BODIES * [2.5, 0.0, np.nan, 0.25, 0.0, 0.0],
    high=BODIES * [3.6, 0.5, np.nan, 0.4, 0.1, 0.2],
    memory=np.array([0.4, np.nan, np.nan, 1.0, np.nan, np.nan]),
    memory_low=np.array([0.2, np.nan, np.nan, 0.8, np.nan, np.nan]),
    memory_high=np.array([0.8, np.nan, np.nan, 1.3, np.nan, np.nan]),
    instrument_kind="repeats",
    noise=np.zeros((6, 2)),
    predicted=np.full(6, 0.1),
    predicted_without=np.full((9, 6), 0.1),
)


def found_in(found=FOUND):
    return vehicle_of(replace(whole(), gusts=found.gusts), disturbance=found)


def blocks_of(of):
    return list(unfolded(page.blocks(vehicle.text(of, about=source_of_vehicle(of)))))


def said(of):
    texts = [block.text for block in blocks_of(of) if isinstance(block, Text)]
    return " ".join(text for text in texts if text.startswith(("Gusts:", "No gusts")))


def test_sizes_are_said_as_accelerations_with_how_long_they_last():
    words = said(found_in())
    assert "Gusts: 3.0 rad/s² about roll (2.5 to 3.6), lasting 0.40 s (0.20 to 0.80); 0.30 m/s² along x" in words
    assert "No gusts above 0.50 rad/s² about pitch, 0.10 m/s² along y and 0.20 m/s² along z." in words
    assert "Gusts about yaw are not known" in words
    assert "--gusts" in words
    (table,) = [block for block in blocks_of(found_in()) if isinstance(block, Table) and block.header[0] == "Gusts"]
    assert len(table.cells) == 6


def test_without_instruments_there_is_a_bound():
    bound = replace(FOUND, size=np.full(6, np.nan), memory=np.full(6, np.nan), instrument_kind="none")
    assert bound.gusts is None
    words = said(found_in(bound))
    assert words.startswith("No gusts above 3.6 rad/s² about roll")
    assert "nothing separates gusts from what it lacks" in words
    assert "--gusts" not in words


def test_where_flights_show_the_loop_alone_sizes_are_not_known():
    shown = vehicle_of(whole())
    assert said(shown) == ""
    assert "their sizes are not known" in said(replace(shown, loop=shown.loop._replace(explained=np.full(3, 0.5))))


def test_machines_read_sizes():
    answer = plain(found_in())
    assert answer["disturbance"]["name"] == ["roll", "pitch", "yaw", "x", "y", "z"]
    assert answer["disturbance"]["size"][0] == pytest.approx(3.0 * BODIES[0])
    assert answer["disturbance"]["size"][1] is None
    assert answer["model"]["gusts"]["size"][3] == pytest.approx(0.3 * QUAD.mass_kg)
    assert plain(vehicle_of(whole()))["disturbance"] is None


def test_gusts_stand_on_a_small_screen_next_to_however_many_effects():
    air = replace(FOUND, alone=np.isfinite(FOUND.size))
    blocks = made.blocks_of(replace(made.diagnosis(named=("com_offset",) * 3), air=air), "diagnose")
    rows = [row for block in blocks if isinstance(block, Facts) for row in block.rows]
    (words,) = [words for name, words in rows if name == "Gusts"]
    assert words.startswith("The residual is gusts, ")


def test_errors_with_the_past_stand_next_to_those_without():
    (flight,) = gusty_flights([Flight(SMALL, STORM)], seconds=6.0)
    player = player_of(VehicleModel(vehicle=SMALL.vehicle), flight)
    known = replace(player, observer=Observer(rate=np.full(6, 20.0), memory_s=np.full(6, 0.5), past_s=0.5))
    pair = Played(flight, player, player, with_past=known)
    held = replay([pair], 20, 5).along([pair])
    assert tuple(held.models) == (*PREDICTIONS, WITH_PAST)
    runs = free_runs(known, flight, flight.starts(20, 5), 20)
    expected = np.linalg.norm(runs.errors[:, :, 3], axis=2).mean(axis=0)
    np.testing.assert_allclose(held.models[WITH_PAST].body_rate.mae, expected)
    vehicle = vehicle_of(whole(), held_out=held, history=known.observer)
    said = stage.text(vehicle, about=source_of_vehicle(vehicle))
    smaller = 1 - held.models[WITH_PAST].body_rate.sum / held.model.body_rate.sum
    assert f"body rate {100 * smaller:.0f} % smaller" in said
    assert len(re.findall(r"\|\s*with the past\s*\|", said)) == 4
