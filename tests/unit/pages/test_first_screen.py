"""The first screen of a diagnosis: each sentence from the facts of a record, and nothing that its numbers deny."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli import page
from cpfls_cli.artifacts.diagnosis import Diagnosis
from cpfls_cli.gap.naming.results import Alternative, ByKind, Unexplained
from cpfls_cli.gap.residual.rotor_loss import RotorLoss
from cpfls_cli.playback.gusts import GustAxis
from cpfls_cli.report.content import Box, Facts, Folded, Table, Text
from cpfls_cli.result import Estimate, plain
from cpfls_cli.simulators.results import Corrected
from cpfls_cli.validation.trust import Trust
from tests.builders import gap_artifacts as made
from tests.builders.gap_artifacts import diagnosis
from tests.builders.vehicle_search import CONFIG

BEFORE_AND_AFTER = "held-out flights before and after, and what to know of the verdict"
USE = "Take the model with it, extended.h5"
WRONG = "the inertia about z would have to be 29 times that of the config"
GUESSED = "guesses from mass and arms are used for what the config leaves open (--accept-guesses); as multiples"


def screen(found, **origin):
    """The box, the facts by term, the rows of the table by what they are, its caption, and all facts below."""
    box, facts, *rest = (
        each for each in blocks(found, **origin) if not isinstance(each, Folded) or "effects" not in each.summary
    )
    below = next(each.blocks for each in rest if isinstance(each, Folded) and each.summary == BEFORE_AND_AFTER)
    table, caption, *more = below
    assert (type(box), type(facts), type(table)) == (Box, Facts, Table)
    return (
        box,
        dict(facts.rows),
        {row[0].text: row[1:] for row in table.cells},
        caption.text,
        [row for each in more if isinstance(each, Facts) for row in each.rows],
    )


def blocks(found, **origin):
    return page.blocks(made.text_of(found, "diagnose", **origin))


def texts(row):
    return [cell.text for cell in row]


def remarks(found):
    below = next(each.blocks for each in blocks(found) if isinstance(each, Folded) and each.summary == BEFORE_AND_AFTER)
    return [each.text for each in below[2:] if isinstance(each, Text)]


def next_steps(found):
    return screen(found)[1]["Next"]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"verdict": "NO_GAP", "named": ()}, "Nothing is missing that these flights can show."),
        ({"verdict": "NOT_EXCITED", "named": ()}, "These flights move too little to show whether anything is missing."),
        (
            {"verdict": "PARTIAL"},
            "What the model misses is offset of the centre of mass. That is the closest, not all of it.",
        ),
        (
            {"verdict": "AMBIGUOUS", "alternatives": (made.RIVAL,)},
            "These flights cannot separate offset of the centre of mass from constant torque.",
        ),
        (
            {
                "verdict": "AMBIGUOUS",
                "named": ("com_offset", "motor_lag", "parameter_error"),
                "alternatives": (made.RIVAL,),
            },
            "These flights cannot separate offset of the centre of mass from constant torque. What the model misses "
            "besides is motor lag. "
            "A parameter of the vehicle is wrong: Izz over yaw torque +24.0 % against the config.",
        ),
        (
            {
                "verdict": "AMBIGUOUS",
                "named": ("com_offset", "motor_lag"),
                "alternatives": (made.RIVAL, replace(made.RIVAL, name="command_delay", instead_of="motor_lag")),
            },
            "These flights cannot separate offset of the centre of mass from constant torque. Nor can they separate "
            "motor lag from delay of the command.",
        ),
        (
            {"verdict": "UNEXPLAINED", "named": (), "closest": (made.effect(),)},
            "There is a gap that nothing in the catalogue explains.",
        ),
        (
            {"verdict": "FLIGHTS_DIFFER", "named": (), "closest": (made.effect(),)},
            "These flights differ: what shows in some of them does not show in the others.",
        ),
        ({"named": ("gyro_bias",)}, "The sensors are at fault: gyro bias."),
        ({"named": ("channel_delay",)}, "The sensors are at fault: time shift between rotor and gyro channels."),
        (
            {"named": ("parameter_error",)},
            "A parameter of the vehicle is wrong: Izz over yaw torque +24.0 % against the config.",
        ),
        (
            {"verdict": "CONTRADICTED", "named": (), "contradictions": (WRONG,)},
            f"The log contradicts itself: T{WRONG[1:]}.",
        ),
    ],
)
def test_every_verdict_has_a_headline(given, words):
    box, *_ = screen(diagnosis(**given))
    assert (box.label, box.title) == (given.get("verdict", "NAMED").replace("_", " "), words)


def test_a_name_comes_with_its_size_its_interval_and_how_sure_it_is():
    box, facts, _, _, below = screen(diagnosis())
    assert list(box.sentences) == [
        "Offset of the centre of mass (com_offset): c_x = 0.0100 [0.0090, 0.0111] m (p < 10⁻⁶, 93 % of the gap)."
    ]
    assert facts["How sure"] == (
        "Of the held-out gap above the noise, 97 % is gone; each rival that could be tried leaves more."
    )
    assert ("What it is", f"Offset of the centre of mass: {made.SENTENCE}") in below


def test_a_wrong_number_of_the_vehicle_is_named_as_people_do():
    box, *_ = screen(diagnosis(named=("parameter_error",)))
    assert list(box.sentences) == [
        "Wrong inertia or thrust scale (parameter_error): Izz over yaw torque +24.0 % [+20.0, +28.1] (p < 10⁻⁶, 93 % of"
        " the gap)."
    ]


@pytest.mark.parametrize(
    ("moments", "cautions", "against"),
    [
        ("[0.0040, 0.0044, 0.0075]", (GUESSED,), "the config"),
        ("null", (GUESSED,), "the guess"),
        ("null", ("vehicle.h5: DO NOT USE",), "the vehicle that was found"),
    ],
)
def test_a_number_is_wrong_against_what_was_taken_for_it(moments, cautions, against):
    config = CONFIG.replace("[0.0040, 0.0044, 0.0075]", moments)
    box, *_ = screen(diagnosis(named=("parameter_error",)), config=config, cautions=cautions)
    assert box.title == f"A parameter of the vehicle is wrong: Izz over yaw torque +24.0 % against {against}."


def test_what_speaks_against_the_model_stands_in_the_box():
    box, *_ = screen(diagnosis(), cautions=(GUESSED, "vehicle.h5: DO NOT USE: predicts no better.", "more"))
    assert box.sentences[0] == "The gap is that of vehicle.h5: DO NOT USE: predicts no better."
    assert "The gap is that of" not in "".join(screen(diagnosis())[0].sentences)
    # Of a simulator's file the numbers are its own, and a model gives what it leaves open.
    of_file = replace(
        diagnosis(), corrected=Corrected(files=("mine.sdf",), changes=(), unchanged=(), elsewhere=(), diff="")
    )
    box, *_ = screen(of_file, cautions=("vehicle.h5: DO NOT USE: predicts no better.",))
    assert box.sentences[0] == (
        "What the simulator's file leaves open is that of vehicle.h5: DO NOT USE: predicts no better."
    )


@pytest.mark.parametrize("verdict", ["NAMED", "PARTIAL", "AMBIGUOUS"])
def test_a_model_that_plays_back_worse_is_not_to_be_taken(verdict):
    worse = made.played_pair(body_rate=(0.5, 0.3, 0.3, 0.4), attitude=(0.1, 0.3, 0.3, 0.2))
    assert next_steps(diagnosis(verdict, playback=worse)).endswith(
        "Do not take the model with it, extended.h5, yet: it plays held-out flights back worse in body rate."
    )
    alike = made.played_pair(body_rate=(0.4001, 0.5, 0.5, 0.4), attitude=(0.1, 0.3, 0.3, 0.2))
    assert "ake the model with it" in next_steps(diagnosis(verdict, playback=alike))


def test_names_that_make_no_forecast_come_with_what_does():
    losing = made.played_pair(body_rate=(0.4, 0.3, 0.3, 0.6), attitude=(0.5, 0.3, 0.3, 0.7))
    said = (
        "Look at the residual. Do not take the model with it, extended.h5, yet: it forecasts worse than no model in "
        "all that is played back; "
    )
    lost = diagnosis("PARTIAL", playback=losing)
    assert next_steps(lost) == f"{said}`cpfls vehicle` looks for one that forecasts."
    # No vehicle comes of rotors that are logged rarely.
    slowly = {name: replace(each, slow_rotors="logged slowly") for name, each in lost.recorded.items()}
    assert next_steps(replace(lost, recorded=slowly)) == f"{said}log the rotors at 100 Hz or faster."
    winning = made.played_pair(body_rate=(0.2, 0.3, 0.3, 0.6), attitude=(0.5, 0.3, 0.3, 0.7))
    assert "cpfls vehicle" not in next_steps(diagnosis("PARTIAL", playback=winning))


@pytest.mark.parametrize(("rival", "taken"), [(0.6, True), (0.3, False)])
def test_in_gusts_too_a_model_that_forecasts_worse_than_none_is_not_to_be_taken(rival, taken, monkeypatch):
    """It was, where it was farther off than the model as given, and the command below went on with the other one."""
    monkeypatch.setattr(Diagnosis, "gusts", (GustAxis("roll", 5.0, 4.0, 6.0, 0.2, 0.1, 0.3),))
    air = SimpleNamespace(instrument_kind="past", alone=None, axes=lambda *_: ())
    worse = made.played_pair(body_rate=(0.5, rival, rival, 0.4), attitude=(0.5, rival, rival, 0.4))
    said = next_steps(diagnosis(playback=worse, air=air))
    assert ("for a simulation take it all the same" in said) is taken
    assert ("Do not take the model with it" in said) is not taken


def test_a_model_whose_own_file_says_do_not_use_is_not_to_be_taken():
    """Better in attitude alone: its file goes by body rates, and so does what is said of it."""
    played = made.played_pair(body_rate=(0.35, 0.3, 0.3, 0.6), attitude=(0.05, 0.2, 0.1, 0.3))
    assert made.extended(playback=played).trust == Trust.DO_NOT_USE
    assert next_steps(diagnosis("NAMED", playback=played)).startswith(
        "Do not take the model with it, extended.h5, yet: it forecasts worse than no model in body rate"
    )


@pytest.mark.parametrize("verdict", ["NAMED", "PARTIAL", "AMBIGUOUS"])
def test_nobody_is_sent_to_a_model_that_is_not_written(verdict):
    said = next_steps(diagnosis(verdict, refused="not extended: the gap does not shrink"))
    assert "extended.h5" not in said
    assert "eave the model as it is: the gap does not shrink" in said


def test_rivals_take_away_from_how_sure_it_is_and_come_with_the_flight_that_separates():
    sure, below = (screen(diagnosis("PARTIAL", alternatives=(made.RIVAL,)))[place] for place in (1, 4))
    assert sure["How sure"] == (
        "Of the held-out gap above the noise, 97 % is gone. "
        "It could be constant torque instead of offset of the centre of mass."
    )
    answer = "constant torque from offset of the centre of mass: change the thrust"
    assert ("To separate", answer) in below
    _, facts, _, _, below = screen(diagnosis("AMBIGUOUS", alternatives=(made.RIVAL,)))
    planned = "`cpfls trajectory CONFIG --for diagnosis.h5 -o path.h5` plans such a flight."
    assert facts["Next"] == f"To separate {answer}. {planned} Until then t{USE[1:]}."
    untried = diagnosis("AMBIGUOUS", alternatives=(Alternative("wind", "com_offset", np.nan, "log velocity"),))
    assert planned not in next_steps(untried)
    assert next_steps(untried).startswith("To separate steady wind from offset of the centre of mass: log velocity.")
    (rival,) = untried.alternatives
    both = diagnosis("AMBIGUOUS", alternatives=(rival, replace(rival, name="payload")))
    assert "To separate steady wind or load on a cable from offset" in next_steps(both)
    assert next_steps(both).count("log velocity") == 1
    assert facts["How sure"] == "Of the held-out gap above the noise, 97 % is gone."
    assert "To separate" not in dict(below)
    three = tuple(replace(rival, name=name, separated_by=name) for name in ("wind", "payload", "torque_bias"))
    _, facts, _, _, below = screen(diagnosis("AMBIGUOUS", alternatives=three))
    assert facts["Next"].count("To separate") == 2
    assert "constant torque" not in facts["Next"]
    assert [text for name, text in below if name == "To separate"] == [
        "constant torque from offset of the centre of mass: torque_bias"
    ]


def test_two_effects_that_do_what_a_named_one_does_are_one_rival_and_no_path_shows_them():
    pair = (Alternative("motor_lag", "low_pass_filter", 1.0, "log the speeds of the rotors", "command_delay"),)
    box, facts, *_ = screen(diagnosis("AMBIGUOUS", named=("low_pass_filter",), alternatives=pair))
    assert "from motor lag with delay of the command" in str(box)
    assert "trajectory" not in facts["Next"]


@pytest.mark.parametrize(
    ("given", "first"),
    [
        ({}, f"{USE}."),
        ({"verdict": "PARTIAL"}, f"{USE}; then look at the residual."),
        ({"verdict": "UNEXPLAINED", "named": ()}, "Look at the residual: its axis, what it follows, "),
        (
            {"verdict": "FLIGHTS_DIFFER", "named": ()},
            "Find out what changed between the flights; learn from flights of",
        ),
        ({"verdict": "NO_GAP", "named": ()}, "Nothing, unless you suspect one of the effects that these flights "),
        ({"verdict": "NOT_EXCITED", "named": ()}, "Fly more: roll, pitch and yaw sweeps at two amplitudes, "),
        (
            {"verdict": "CONTRADICTED", "named": (), "contradictions": (WRONG,)},
            "Correct what is wrong, in the section `import` of the config or in `vehicle`, and run this again.",
        ),
    ],
)
def test_every_verdict_says_what_to_do_next(given, first):
    assert next_steps(diagnosis(**given)).startswith(first)


def test_where_says_channel_time_and_how_long():
    _, facts, *_ = screen(diagnosis())
    assert facts["Where"] == (
        "Force along z (up), above the noise 75 % of the time, most from 1.0 to 2.5 s of two.csv; also torque x, "
        "force x, force y and torque y."
    )
    _, facts, *_ = screen(replace(diagnosis(force=False), worst=()))
    assert facts["Where"] == "Torque about x (roll), above the noise 75 % of the time; also torque y."


def test_where_nothing_is_above_the_noise_nothing_is_located():
    quiet = np.array([0.4, 0.5, 0.6, 0.7, 1.42, 0.9])
    record = diagnosis("NO_GAP", named=(), gap=made.gap_change(quiet, quiet))
    _, facts, rows, caption, _ = screen(record)
    assert facts["Where"] == "Nowhere above the noise."
    assert facts["How sure"] == (
        "The largest gap is 1.4 noise floors; not ruled out, as listed below: 1 of the catalogue."
    )
    assert [row for row in rows if row.startswith("gap")] == ["gap, force y"]
    assert "Within the noise: torque x, torque y, torque z, force x, force z." in caption
    assert record.where is None


def test_the_gap_stands_before_and_after_next_to_the_noise():
    _, _, rows, caption, _ = screen(diagnosis())
    assert texts(rows["gap, roll torque"]) == ["N m", "0.494", "0.0136", "0.0123", "40 → 1.1 floors"]
    assert "gap, yaw torque" not in rows
    assert "Within the noise: torque z." in caption
    grew = made.gap_change(after=np.array([60.0, 0.01, 0.9, 0.9, 0.8, 1.2]))
    _, _, rows, caption, _ = screen(diagnosis(gap=grew))
    worse = rows["gap, roll torque"][-1]
    assert (worse.text, worse.tone) == ("40 → 60 floors, worse", "warning")


def test_playback_stands_before_and_after_next_to_what_knows_no_model():
    ends = {"velocity": (0.1, 0.5, 0.3, 0.2), "position": (0.4, 0.3, 0.5, 0.6)}
    _, _, rows, caption, _ = screen(diagnosis(playback=made.played_pair(**ends)))
    assert texts(rows["playback, body rate"]) == ["rad/s", "2.0", "0.10", "1.0", "better than “nothing moves”"]
    assert texts(rows["playback, attitude"]) == ["°", "17", "0.57", "5.7", "better than “rate stays”"]
    assert texts(rows["playback, velocity"]) == ["m/s", "0.20", "0.10", "0.30", "better than “rate stays”"]
    assert texts(rows["playback, position"]) == ["m", "0.60", "0.40", "0.30", "worse than “nothing moves”"]
    assert rows["playback, position"][-1].tone == "warning"
    assert "Playback: mean error after 0.5 s." in caption


def test_what_cannot_be_played_back_is_said():
    _, _, rows, caption, _ = screen(diagnosis())
    assert "Playback: mean error after 0.5 s; velocity and position cannot be played back, " in caption
    assert not {"playback, velocity", "playback, position"} & set(rows)
    _, _, rows, caption, _ = screen(diagnosis(playback=made.played_pair(body_rate=(0.0,) * 4, attitude=(0.0,) * 4)))
    assert "The flights show no motion that could be played back." in caption
    _, _, rows, caption, _ = screen(replace(diagnosis(), playback=None))
    assert "layback" not in caption
    assert not any(row.startswith("playback") for row in rows)


@pytest.mark.parametrize(
    ("left", "said"),
    [
        (
            ("torque z", 3.04, "speed", 0.4, None, "drains"),
            "Torque about z (yaw), 3.0 floors: follows speed most (40 % of it), drains energy from the motion.",
        ),
        (
            ("torque x", 2.2, None, 0.6, 4.013, "feeds"),
            "Torque about x (roll), 2.2 floors: rings at 4.01 Hz (60 % of it), feeds energy into the motion.",
        ),
        (
            ("torque z", 14.2, "yaw", 0.82, 3.21, "neither"),
            "Torque about z (yaw), 14 floors: follows yaw most and rings at 3.21 Hz (82 % of it).",
        ),
        (("force z", 2.2, None, 0.0, None, "neither"), "Force along z (up), 2.2 floors: follows no one signal."),
    ],
)
def test_what_is_left_has_an_axis_a_cause_and_a_way_of_energy(left, said):
    assert screen(diagnosis("UNEXPLAINED", named=(), unexplained=(Unexplained(*left),)))[1]["Residual"] == (
        f"In what it was fitted to: {said[0].lower()}{said[1:]}"
    )
    assert "Residual" not in screen(diagnosis())[1]


def test_of_many_axes_that_are_left_the_worst_with_a_cause_is_shown_and_the_others_counted():
    left = [("torque x", 9.0, None, 0.0, None, "neither"), ("force z", 2.2, None, 0.0, None, "neither")]
    left.append(("torque z", 3.04, "speed", 0.4, None, "neither"))
    _, facts, *_, below = screen(
        diagnosis("UNEXPLAINED", named=(), unexplained=tuple(Unexplained(*each) for each in left))
    )
    assert facts["Residual"] == (
        "In what it was fitted to: torque about z (yaw), 3.0 floors: follows speed most (40 % of it); 2 more, up to "
        "9.0 floors."
    )
    assert dict(below)["Residual of each axis"].startswith("torque about x (roll), 9.0 floors: follows no one signal; ")
    left.append(("torque y", 8.0, None, 0.7, 1.5, "neither"))
    rings = screen(diagnosis("UNEXPLAINED", named=(), unexplained=tuple(Unexplained(*each) for each in left[1:])))[1]
    assert rings["Residual"] == (
        "In what it was fitted to: torque about y (pitch), 8.0 floors: rings at 1.50 Hz (70 % of it); 2 more, up to "
        "3.0 floors."
    )


def test_the_gap_of_many_channels_is_that_of_the_largest():
    floors = np.array([9.0, 20.0, 30.0, 5.0, 40.0, 4.0])
    _, facts, *_ = screen(diagnosis(gap=made.gap_change(floors, floors / 2)))
    assert facts["Gap"] == (
        "Held out, in noise floors: pitch torque 20 → 10, yaw torque 30 → 15, force y 40 → 20; 3 more."
    )


def test_the_closest_effects_are_not_the_answer_and_say_how_little_they_do():
    box, facts, _, caption, below = screen(diagnosis("UNEXPLAINED", named=(), closest=(made.effect(),), share=0.31))
    assert box.sentences[0].startswith(
        "The closest was offset of the centre of mass, which does not explain the gap: com_offset, "
    )
    assert facts["How sure"] == "With the closest effects, of the held-out gap above the noise, 31 % is gone."
    assert "After: with the closest effects, offset of the centre of mass, which are not the answer." in caption
    assert "What it is" in dict(below)


def test_flights_held_out_and_why_stand_below():
    *_, below = screen(diagnosis())
    assert (dict(below)["Fitted to"], dict(below)["Held out"]) == ("one.csv", "two.csv")
    assert dict(below)["Why"] == "No flight was held out by name."


def test_remarks_are_said_but_those_that_are_said_elsewhere():
    notes = ("A note that readers need.", WRONG, *made.AUDIT.notes)
    record = diagnosis("CONTRADICTED", named=(), notes=notes, contradictions=(WRONG,))
    assert remarks(record) == ["A note that readers need."]
    assert (plain(record)["contradictions"], plain(record)["notes"]) == ([WRONG], list(notes))


def test_what_is_gone_is_said_of_torque_and_force_where_both_had_a_gap():
    both, torque = (ByKind(torque=0.95, force=share) for share in (0.412, np.nan))
    assert screen(diagnosis("PARTIAL", share_by_kind=both))[1]["How sure"].startswith(
        "Of the held-out gap above the noise, 95 % of the torque and 41 % of the force is gone"
    )
    assert "noise, 97 % is gone" in screen(diagnosis("PARTIAL", share_by_kind=torque))[1]["How sure"]


def test_effects_are_credited_with_what_the_vehicles_own_numbers_leave():
    """A gap went from 7.7 to 1.3 floors by a number of the vehicle, and of it 3 % were said to be gone."""
    record = diagnosis("PARTIAL")
    left = replace(record.residual, parameters=0.2 * record.residual.before)
    said = screen(replace(record, residual=left))[1]["How sure"]
    refitted = "that is left with the vehicle's own parameters refitted"
    assert said.startswith(f"Of the held-out gap above the noise {refitted}, 97 % is gone")


def test_what_differs_between_flights_stands_above_and_not_below():
    differ = ("the gap about y is in training alone",)
    record = diagnosis("FLIGHTS_DIFFER", named=(), closest=(made.effect(),), differences=differ, notes=differ)
    assert screen(record)[1]["Differs"] == "The gap about y is in training alone."
    assert not remarks(record)


def test_a_rotor_that_loses_thrust_is_the_answer():
    loss = RotorLoss(flight="two.csv", rotor=3, time_s=12.0, loss=Estimate.around(0.08, 0.01))
    record = diagnosis("FLIGHTS_DIFFER", named=(), differences=(loss.sentence,))
    box, facts, *_ = screen(replace(record, rotor_losses=(loss,)))
    assert (box.label, box.title) == ("FLIGHTS DIFFER", "M3 lost thrust in flight.")
    assert facts["Differs"].startswith("In two.csv M3 pulls 8 % [7, 9] less from 12.0 s on")
    assert facts["Next"].startswith("Look at propeller and motor")


def test_rotors_that_are_logged_rarely_are_said_first():
    record = diagnosis("UNEXPLAINED", named=())
    slow = "the rotors are logged 10 times a second; first log them faster"
    flights = {name: replace(each, slow_rotors=slow) for name, each in record.recorded.items()}
    first = next(iter(flights.values())).name
    box, *_ = screen(replace(record, recorded=flights))
    assert box.sentences[0] == f"{first}: {slow}."
    assert not any(slow in sentence for sentence in screen(record)[0].sentences)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "with offset of the centre of mass"),
        (
            {"named": (), "closest": (made.effect(),)},
            "with the closest effects, offset of the centre of mass, which are not the answer",
        ),
        ({"named": ()}, "with nothing but the vehicle's own parameters refitted"),
    ],
)
def test_the_second_model_is_said_to_be_what_it_is(given, words):
    assert f"; after: {words}." in made.text_of(diagnosis(**given), "diagnose")


def test_notes_on_flights_are_folded():
    said = blocks(diagnosis(warnings=("a.csv: gaps", "b.csv: late")))
    assert said[-1].summary == "2 notes on the flights and their import"
    assert [row[0].text for row in said[-1].blocks[0].cells] == ["a.csv: gaps.", "b.csv: late."]
    assert "notes on the flights" not in str(blocks(diagnosis()))


def test_machines_read_what_people_read():
    summary = plain(diagnosis(warnings=("a.csv: gaps",)))
    assert summary["where"] == {
        "channels": ["force z", "torque x", "force x", "force y", "torque y"],
        "flight": "two.csv", "start_s": 1.0, "end_s": 2.5, "floors": 80.0, "share_of_time": 0.75,
    }  # fmt: skip
    assert summary["playback"]["at_end"]["body_rate"] == {
        "before": 2.0, "after": pytest.approx(0.1), "rival": "nothing-moves", "without_model": 1.0, "worse": False,
    }  # fmt: skip
    assert set(summary["playback"]["models"]) == {"after", "nothing-moves", "rate-stays", "before"}
    assert summary["playback"]["models"]["before"]["attitude"]["mae"][-1] == pytest.approx(0.3)
    assert (summary["warnings"], summary["contradictions"]) == (["a.csv: gaps"], [])
