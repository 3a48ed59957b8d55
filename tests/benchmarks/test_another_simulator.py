"""The physics of gym-pybullet-drones, rebuilt from its formulas: effects with the right sign, none against another."""

import json

import numpy as np
import pytest

from benchmarks.blind.cases import make
from benchmarks.blind_study.fly import fly
from benchmarks.blind_study.judge import judge
from benchmarks.blind_study.score import Scored, outcome
from benchmarks.blind_study.sets import Set

DAMPING, ACROSS, ALONG = 0.04 * 0.027, 9.1785e-7, 10.311e-7


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
