"""A small part of the blind study: right names, no names where nothing is hidden, and a gap that shrinks."""

import json
from collections import Counter
from dataclasses import replace

import pytest

from benchmarks.blind.cases import LACKING
from benchmarks.blind.measure import ATTACKS
from benchmarks.blind_study.air_tables import air_by_channel, air_totals
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
    for logs, own in zip(fly(groups, folder, duration=8.0), groups, strict=True):
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
        (["motor_lag", "command_delay"], "AMBIGUOUS", ["low_pass_filter"], RIVAL),
        (["motor_lag"], "AMBIGUOUS", ["low_pass_filter"], WRONG),
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
def test_answers_are_distinguished(truth, verdict, names, expected):
    torque = 1.0 if "com_offset" in truth else 0.01
    key = {
        "truth": truth,
        "hidden": {},
        "only": "",
        "residual_rms_n_m": {"held_out_1": [torque, 0.0, 0.0], "train_1": [9.0, 9.0, 9.0]},
    }
    said = {
        "verdict": verdict,
        "effects": [{"name": name} for name in names],
        "alternatives": [
            {"name": "com_offset", "instead_of": "inflow"},
            {"name": "motor_lag", "instead_of": "low_pass_filter", "jointly_with": "command_delay"},
        ],
        "floor": [0.1] * 6,
    }
    assert outcome(key, said) == expected


def test_a_part_of_a_study_holds_as_many_different_things_as_it_can():
    each = {"single": 12, "none": 2, "outside": 5, "attack": 6}
    part = sets(Size(31, 2, ("mid",), ("white",), ("single", "none", "outside", "attack"), each=each))
    found = {}
    for own in part:
        found.setdefault(own[0].case.group, []).append(own[0].case)
    assert {group: len(own) for group, own in found.items()} == each
    assert len({tuple(case.hidden) for case in found["single"]}) == 12
    assert len({tuple(case.hidden) for case in found["outside"]}) == 5
    assert {case.attack for case in found["attack"]} == set(ATTACKS)
    assert part == sets(Size(31, 2, ("mid",), ("white",), ("single", "none", "outside", "attack"), each=each))


def test_in_turn_each_case_is_flown_in_one_air_and_all_airs_come_up_alike():
    airs = {"gusts": (0, 1, 2), "instruments": ("none", "repeats")}
    size = Size(31, 1, ("mid",), ("white",), ("single",), vehicles=("crazyflie",), **airs)
    every, dealt = sets(size), sets(replace(size, in_turn=True))
    assert [own[0].case.name for own in dealt] == list(dict.fromkeys(own[0].case.name for own in every))
    assert all(own in every for own in dealt)
    counts = Counter((own[0].case.gusts, own[0].case.instruments) for own in dealt)
    assert len(counts) == 6
    assert max(counts.values()) - min(counts.values()) <= 1
    assert dealt == sets(replace(size, in_turn=True))


def test_each_case_is_flown_in_each_air_and_the_usual_study_stays_as_it_is():
    usual = Size(31, 1, ("mid",), ("white",), ("single",), vehicles=("crazyflie",))
    names = [own[0].name for own in sets(usual)]
    study = sets(replace(usual, gusts=(0, 1), instruments=("none", "repeats")))
    assert [own[0].name for own in study[::4]] == names
    assert len({own[0].name for own in study}) == 4 * len(names)
    assert "gusts" not in study[0][0].case.key()
    assert study[3][0].case.key() == study[0][0].case.key() | {
        "gusts": 1,
        "instruments": "repeats",
        "air": study[2][0].case.air,
    }


def said(verdict, *effects, rivals=()):
    result = [
        {"name": name, "share": share, "coefficients": {"c": {"value": value, "possible": possible}}}
        for name, share, value, possible in effects
    ]
    return {"verdict": verdict, "effects": result, "alternatives": list(rivals), "floor": [0.1] * 6}


def answered(result, **key):
    usual = {"truth": [], "nearest": [], "outside": [], "hidden": {}, "only": "", "group": "single", "dominant": ""}
    key = usual | key | {"residual_rms_n_m": {"held_out_1": [1.0] * 3, "train_1": [1.0] * 3}}
    return Scored(key, result, outcome(key, result))


DRAG, DAMPING = ("rotor_drag", 1.0, 1e-3, [0.0, 1.0]), ("linear_damping", 1.0, 0.1, [0.0, 1.0])

FACTOR, IZZ = ("drag_factor_error", 1.0, 0.2, [-0.6, 1.5]), ("parameter_error", 1.0, -0.17, [-0.9, 3.0])
OF_FACTOR = {"truth": ["parameter_error"], "hidden": {"drag_factor": {}}, "nearest": ["drag_factor_error"]}
RIVAL_BY = {"name": "rotor_drag", "instead_of": "linear_damping"}


@pytest.mark.parametrize(
    ("result", "key", "good"),
    [
        (said("NAMED", DRAG), {"truth": ["rotor_drag"], "group": "lacking"}, True),
        (said("NAMED", DAMPING), {"truth": ["rotor_drag"], "group": "lacking"}, False),
        (
            said("AMBIGUOUS", DAMPING, rivals=[RIVAL_BY | {"separated_by": "log velocity"}]),
            {"truth": ["rotor_drag"], "group": "lacking", "left_out": LACKING["velocity"]},
            True,
        ),
        (
            said("AMBIGUOUS", DAMPING, rivals=[RIVAL_BY | {"separated_by": "log velocity"}]),
            {"truth": ["rotor_drag"], "group": "lacking", "left_out": LACKING["attitude"]},
            False,
        ),
        (said("FLIGHTS_DIFFER"), {"only": "held_out", "hidden": {"rotor_drag": {}}, "group": "differing"}, True),
        (said("NAMED", DRAG), {"only": "held_out", "hidden": {"rotor_drag": {}}, "group": "differing"}, False),
        (said("NO_GAP"), {"only": "train", "hidden": {"rotor_drag": {}}, "group": "differing"}, False),
        (said("NAMED", DAMPING), {"outside": ["cyclic_swirl"], "hidden": {"cyclic_swirl": {}}}, False),
        (said("PARTIAL", DAMPING), {"outside": ["cyclic_swirl"], "hidden": {"cyclic_swirl": {}}}, True),
        (said("NAMED", FACTOR), {"group": "drag_factor", **OF_FACTOR}, True),
        (said("NAMED", FACTOR, IZZ), {"group": "drag_factor", **OF_FACTOR}, False),
        (said("NAMED", IZZ), {"group": "drag_factor", **OF_FACTOR}, True),
        (said("NO_GAP"), {"group": "attack"}, True),
        (said("PARTIAL", DAMPING), {"group": "attack"}, False),
        (said("NAMED", DRAG), {"group": "pybullet", "nearest": ["rotor_drag"]}, True),
        (said("NAMED", DAMPING), {"group": "pybullet", "nearest": ["rotor_drag"]}, False),
    ],
)
def test_what_is_asked_for_depends_on_the_group(result, key, good):
    assert answered(result, **key).good == good


@pytest.mark.parametrize(
    ("effects", "unphysical"),
    [
        ([DRAG], False),
        ([("linear_damping", 1.0, -1e-5, [0.0, 1.0])], True),
        ([("linear_damping", 1.0, 0.0, [0.0, 1.0])], False),
        ([("channel_delay", 1.0, -0.05, [-0.05, 0.05])], True),
        ([("rotor_drag", 8.12, 0.1, [0.0, 1.0]), ("linear_damping", -7.12, 0.1, [0.0, 1.0])], True),
    ],
)
def test_numbers_that_nobody_believes_are_counted(effects, unphysical):
    assert answered(said("NAMED", *effects)).unphysical == unphysical
    assert not answered(said("UNEXPLAINED", *effects)).unphysical


def in_gusts(group, level, verdict="UNEXPLAINED", **air):
    """Judge a set that has gusts of size 2 N m and memory 0.5 s in all channels, or none."""
    found = {"size": 2.2, "low": 1.8, "high": 2.5, "memory": 1.1, "memory_low": 0.4, "memory_high": None} | air
    air = {"gusts_only": [True, *[False] * 5]} | {name: [value, *[None] * 5] for name, value in found.items()}
    key = {"group": group, "gusts": level, "instruments": "setpoints", "level": "mid", "kind": "white"}
    key["air"] = {"size": [2.0] * 6, "memory": [0.5] * 6} if level else {}
    by_flight = {"held_out_1": [1.0, 0.1, 0.1]}
    key |= {"averaged_n_m": by_flight, "gusts_averaged_n_m": {"held_out_1": [0.9] * 3}} if level else {}
    return answered(said(verdict) | {"air": air}, **key)


def test_what_was_said_in_gusts_is_counted_by_air():
    text = air_totals([in_gusts("none", 0), in_gusts("single", 1), in_gusts("none", 1, low=2.1)])
    rows = {row.split(" | ")[0].strip("| "): row.split(" | ")[1:] for row in text.splitlines()}
    assert rows[""][:2] == ["gusts 0, setpoints", "gusts 1, setpoints"]
    assert rows["one effect above the air's share: exactly right"][1] == "0 of 1 (0.0 %)"
    assert rows["channels in gusts: residual is gusts alone"][1] == "2 of 12 (16.7 %)"
    assert rows["channels in gusts: size identified"][1] == "2 of 12 (16.7 %)"
    assert rows["of these: size within 30 %"][1] == "2 of 2 (100.0 %)"
    assert rows["of these: memory within a factor of 2"][1] == "0 of 2 (0.0 %)"
    assert rows["of these: size in its interval"][1] == "1 of 2 (50.0 %)"
    assert rows["of these: memory in its interval"][1] == "2 of 2 (100.0 %)"
    assert rows["channels without gusts: residual is gusts alone"][0] == "1 of 6 (16.7 %)"
    assert "| torque x | 2 of 2 | 1.10, 1.10 to 1.10 |" in air_by_channel([in_gusts("none", 1), in_gusts("none", 1)])
    assert not air_totals([answered(said("NO_GAP"))])
