import numpy as np
import pytest

from cpfls_cli.artifacts.diagnosis import DiagnosisRecord
from cpfls_cli.pages.diagnosis import model_words, verdict_box
from tests.builders import gap_artifacts as made


def diagnosis(**given):
    artifact = made.diagnosis(**given)
    return DiagnosisRecord.of_data(artifact.header, artifact.data)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"verdict": "NO_GAP", "named": ()}, ["Nothing is missing that these flights can show."]),
        ({"verdict": "NOT_EXCITED", "named": ()}, ["These flights move too little"]),
        ({"verdict": "PARTIAL"}, ["What the model misses is offset of the centre of mass.", "closest, not all of it"]),
        (
            {"verdict": "AMBIGUOUS", "alternatives": [("torque_bias", "com_offset", 0.98, "change the thrust")]},
            [
                "These flights cannot tell offset of the centre of mass from constant torque.",
                "To tell: change the thrust.",
            ],
        ),
        (
            {
                "verdict": "UNEXPLAINED",
                "named": ({"named": 0},),
                "unexplained": [
                    ("torque z", 14.2, "yaw", 0.82, 3.21, "feeds"),
                    ("force x", 2.0, "", 0.0, np.nan, "neither"),
                ],
            },
            [
                "There is a gap that nothing in the catalogue explains.",
                "torque about z (yaw), 14 floors; it follows yaw most and it rings at 3.21 Hz (82 % of it); "
                "it feeds energy into the motion.",
                "force along x (forward), 2.0 floors; it follows no one signal.",
                "The closest was offset of the centre of mass, and that is not it",
                "the largest gap is 70 noise floors, in the force along z (up); with the closest effects 1.2 are left.",
            ],
        ),
        ({"named": ({"name": "gyro_bias", "kind": "sensor"},)}, ["The sensors are at fault: gyro bias."]),
        ({"named": ({"name": "parameter_error", "kind": "parameter"},)}, ["A number of the vehicle is wrong"]),
    ],
)
def test_every_verdict_is_said_in_words(given, words):
    box = verdict_box(diagnosis(**given))
    summary = " ".join([box.label, box.title, *box.sentences])
    assert box.label == given.get("verdict", "NAMED").replace("_", " ")
    for each in words:
        assert each in summary
    named = [row for row in given.get("named", ({},)) if row.get("named", 1)]
    misses = "What the model misses" in summary
    assert misses == (given.get("verdict", "NAMED") in ("NAMED", "PARTIAL") and named[0].get("kind") is None)


def test_what_hangs_on_another_flight_says_so_first():
    rivals = [("torque_bias", "com_offset", 0.98, "change the thrust")]
    ambiguous = verdict_box(diagnosis(verdict="AMBIGUOUS", alternatives=rivals)).sentences
    assert ambiguous[0] == (
        "It could be constant torque instead of offset of the centre of mass. To tell: change the thrust."
    )
    named = verdict_box(diagnosis(alternatives=rivals)).sentences
    assert named[0].startswith("Offset of the centre of mass (com_offset): ")
    assert named[1] == ambiguous[0]


@pytest.mark.parametrize(
    ("left", "said"),
    [
        (
            ("torque z", 3.04, "speed", 0.4, np.nan, "drains"),
            "Left unexplained: torque about z (yaw), 3.0 floors; it follows speed most (40 % of it); it drains energy "
            "from the motion.",
        ),
        (
            ("torque x", 2.2, "", 0.6, 4.013, "feeds"),
            "Left unexplained: torque about x (roll), 2.2 floors; it rings at 4.01 Hz (60 % of it); it feeds energy "
            "into the motion.",
        ),
        (
            ("force z", 2.2, "", 0.0, np.nan, "neither"),
            "Left unexplained: force along z (up), 2.2 floors; it follows no one signal.",
        ),
    ],
)
def test_what_is_left_has_an_axis_a_cause_and_a_way_of_energy(left, said):
    assert said in verdict_box(diagnosis(verdict="UNEXPLAINED", unexplained=[left])).sentences


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"alone": [("torque_bias", 0.9)]}, True),
        ({"alone": [("com_offset", 0.9)]}, False),
        ({"alone": [("torque_bias", 0.9)], "force": False}, False),
        ({"alone": [("torque_bias", 0.9)], "named": ({"name": "gyro_bias", "kind": "sensor"},)}, False),
        ({}, False),
    ],
)
def test_two_names_are_explained_only_where_the_forces_decided(given, said):
    assert diagnosis(**given).forces_decide is said


@pytest.mark.parametrize(
    ("named", "words"),
    [
        (({},), "with offset of the centre of mass"),
        (({"named": 0},), "with the closest effects, offset of the centre of mass, which are not the answer"),
        ((), "with nothing but the vehicle's own numbers refitted"),
    ],
)
def test_the_second_model_is_said_to_be_what_it_is(named, words):
    assert model_words(diagnosis(named=named)) == words
