"""Two effects hidden by a simulator of its own, found by `cpfls gap` from the logs alone, with all that it writes."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.blind.cases import make
from benchmarks.blind_study.fly import fly
from benchmarks.blind_study.judge import judge
from benchmarks.blind_study.score import Scored, outcome
from benchmarks.blind_study.sets import Set
from tests.builders.command_line import run

HIDDEN = ("com_offset", "rotor_drag")
DAMPING, ACROSS, ALONG = 0.04 * 0.027, 9.1785e-7, 10.311e-7


@pytest.fixture(scope="module")
def answer(tmp_path_factory):
    """The folder of `cpfls gap`, its summary, and what was hidden."""
    place = tmp_path_factory.mktemp("pair")
    case = make("pair", "pair", "sixkg", HIDDEN, np.random.default_rng(5), level=0.5)
    [logs] = fly([[Set(case, "mid", "white", 11)]], place, duration=8.0)
    flights = [*sorted(logs.glob("train_*.csv")), *sorted(logs.glob("held_out_*.csv"))]
    folder = place / "gap"
    held = [word for path in flights[3:] for word in ("--held-out", path)]
    result = run.done("gap", logs / "study.yaml", *flights[:3], *held, "-o", folder, "--json", "--set", "gap.shifts=39")
    return SimpleNamespace(folder=folder, summary=json.loads(result.stdout), hidden=case.hidden, logs=logs, held=held)


def test_both_effects_are_named_and_nothing_else(answer):
    assert answer.summary["verdict"] == "NAMED"
    assert {effect["name"] for effect in answer.summary["effects"]} == set(HIDDEN)


def test_the_numbers_of_both_come_back(answer):
    found = {effect["name"]: effect["coefficients"] for effect in answer.summary["effects"]}
    offset, drag = answer.hidden["com_offset"]["offset"], answer.hidden["rotor_drag"]["drag"]
    assert found["rotor_drag"]["k_d"]["value"] == pytest.approx(drag, rel=0.05)
    for name, true in zip(("c_x", "c_y"), offset, strict=False):
        assert found["com_offset"][name]["value"] == pytest.approx(true, abs=0.05 * np.hypot(*offset[:2]))


def test_gap_closes_on_flights_held_out(answer):
    before, after = answer.summary["gap_before"], answer.summary["gap_after"]
    for channels in ("floors", "force_floors"):
        assert max(before[channels]) > 20
        assert max(after[channels]) < 1.5


def test_every_artifact_is_good(answer):
    names = {"disagreement.h5", "diagnosis.h5", "extended.h5", "report.html", "gap.json"}
    assert {path.name for path in answer.folder.iterdir()} == names
    for name in ("disagreement", "diagnosis", "extended"):
        run.done("check", answer.folder / f"{name}.h5")


def test_extended_model_leaves_the_gap_that_was_promised(answer):
    again = answer.folder.parent / "again.h5"
    flights = answer.held[1::2]
    model = answer.folder / "extended.h5"
    gap = run.summary("compare", answer.logs / "study.yaml", *flights, "--model", model, "-o", again)["gap"]
    assert gap["torque_n_m"] == pytest.approx(answer.summary["gap_after"]["torque_n_m"], rel=1e-6)
    assert max(gap["floors"]) < 1.5


@pytest.fixture(scope="module")
def judged(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bullet")
    hidden = ("quick_rotors", "bullet_damping", "bullet_drag")
    case = make("pybullet-cf2x-drag-0", "pybullet", "cf2x", hidden, np.random.default_rng(1))
    [logs] = fly([[Set(case, "mid", "white", 3)]], folder, duration=8.0)
    key = json.loads((folder / "keys" / logs.name / "key.json").read_text(encoding="ascii"))
    said = judge(logs)
    return Scored(key, said, outcome(key, said))


def test_its_drags_are_seen_and_nothing_cancels(judged):
    assert {"rotor_drag", "parasitic_drag", "inflow"} <= set(judged.names)
    assert not judged.unphysical
    assert min(effect["share"] for effect in judged.said["effects"]) > -0.02


def test_its_numbers_come_back(judged):
    found = {effect["name"]: effect["coefficients"] for effect in judged.said["effects"]}
    # The drag of the rotors holds the linear part of Bullet's damping: four rotors of 1517 rad/s carry the craft.
    linear = DAMPING / (4 * 1517)
    assert found["parasitic_drag"]["c_x"]["value"] == pytest.approx(DAMPING, rel=0.1)
    assert found["rotor_drag"]["k_d"]["value"] == pytest.approx(ACROSS + linear, rel=0.1)
    assert found["inflow"]["k_z"]["value"] == pytest.approx(ALONG + linear, rel=0.2)


def test_its_force_gap_closes(judged):
    before, after = (np.array(judged.said[when]["floors"][3:]) for when in ("gap_before", "gap_after"))
    assert before.min() > 10
    assert after.max() < 1.5
