"""A small part of the blind study: right names, no names where nothing is hidden, and a gap that shrinks."""

import json

import pytest

from benchmarks.blind_study.fly import fly
from benchmarks.blind_study.judge import judge
from benchmarks.blind_study.score import (
    EXTRA,
    MISSED,
    PARTIAL,
    REFUSED,
    RIGHT,
    RIVAL,
    SOME,
    UNSEEN,
    WRONG,
    Scored,
    numbers,
    outcome,
)
from benchmarks.blind_study.sets import Size, sets

CASES = {
    "single-sixkg-com_offset-0",
    "single-sixkg-motor_lag-0",
    "single-sixkg-parameter_error-0",
    "none-sixkg-0",
    "outside-sixkg-yaw_cogging-0",
}


@pytest.fixture(scope="module")
def judged(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    groups = [own for own in sets(Size(777, 1, ("mid",), ("coloured",))) if own[0].case.name in CASES]
    found = {}
    for logs, own in zip(fly(groups, folder), groups, strict=True):
        key = json.loads((folder / "keys" / logs.name / "key.json").read_text(encoding="ascii"))
        said = judge(logs)
        found[own[0].case.name] = Scored(key, said, outcome(key, said))
    return found


@pytest.mark.parametrize("effect", ["com_offset", "motor_lag"])
def test_hidden_effect_is_named_alone_and_closes_the_gap(judged, effect):
    each = judged[f"single-sixkg-{effect}-0"]
    assert each.names == (effect,)
    assert each.outcome == RIGHT
    assert each.floors("before") > 3
    assert each.floors("after") < 1.3


@pytest.mark.parametrize(("effect", "error"), [("com_offset", 0.02), ("motor_lag", 0.05)])
def test_coefficients_of_a_hidden_effect_come_back(judged, effect, error):
    found = numbers(judged[f"single-sixkg-{effect}-0"])
    assert found
    assert [number.error for number in found] == pytest.approx([0.0] * len(found), abs=error)


def test_wrong_numbers_of_the_vehicle_are_called_so(judged):
    each = judged["single-sixkg-parameter_error-0"]
    assert each.names == ("parameter_error",)
    assert [number.error for number in numbers(each)] == pytest.approx([0.0] * len(numbers(each)), abs=0.1)


def test_nothing_hidden_has_no_name(judged):
    each = judged["none-sixkg-0"]
    assert each.names == ()
    assert each.verdict == "NO_GAP"


def test_what_no_catalogue_lists_is_never_called_found(judged):
    assert judged["outside-sixkg-yaw_cogging-0"].verdict in ("UNEXPLAINED", "PARTIAL")


@pytest.mark.parametrize(
    ("truth", "verdict", "names", "expected"),
    [
        (["com_offset"], "NAMED", ["com_offset"], RIGHT),
        (["com_offset"], "PARTIAL", ["com_offset"], PARTIAL),
        (["com_offset"], "NAMED", ["com_offset", "inflow"], EXTRA),
        (["com_offset"], "NAMED", ["inflow"], WRONG),
        (["com_offset"], "AMBIGUOUS", ["inflow"], RIVAL),
        (["com_offset", "wind"], "NAMED", ["com_offset", "inflow"], SOME),
        (["wind", "rotor_drag"], "NAMED", ["wind"], RIGHT),
        (["wind", "rotor_drag"], "NAMED", ["rotor_drag"], SOME),
        (["com_offset"], "UNEXPLAINED", [], REFUSED),
        (["com_offset"], "NO_GAP", [], MISSED),
        (["inflow"], "NO_GAP", [], UNSEEN),
        ([], "NO_GAP", [], RIGHT),
        ([], "UNEXPLAINED", [], REFUSED),
        ([], "PARTIAL", ["inflow"], WRONG),
    ],
)
def test_answers_are_told_apart(truth, verdict, names, expected):
    torque = 1.0 if "com_offset" in truth else 0.01
    key = {
        "truth": truth,
        "only": "",
        "residual_rms_n_m": {"held_out_1": [torque, 0.0, 0.0], "train_1": [9.0, 9.0, 9.0]},
    }
    rivals = [{"name": "com_offset", "instead_of": "inflow"}]
    said = {
        "verdict": verdict,
        "effects": [{"name": name} for name in names],
        "alternatives": rivals,
        "floor": [0.1] * 6,
    }
    assert outcome(key, said) == expected
