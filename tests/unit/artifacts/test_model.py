"""Facts that follow from the datasets of a model, each in one place."""

from dataclasses import fields, replace

import numpy as np
import pytest

from cpfls_cli.artifacts.evidence import VerdictGroup
from cpfls_cli.artifacts.identified import ChosenGroup, IdentifiedRecord, RulesGroup, SearchGroup, SolveGroup
from cpfls_cli.artifacts.model import InertiaFunctionsGroup, VehicleGroup
from cpfls_cli.artifacts.spec import Header
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.vehicle.settings import VehicleSettings

GROUPS = (
    "vehicle",
    "chosen",
    "solve",
    "rules",
    "front",
    "history",
    "judged",
    "baselines",
    "training_indices",
    "findings",
)
ALL_ROUND = np.eye(72, dtype=bool)


def record(**groups):
    return IdentifiedRecord(header=Header("0.1.0", 1, "seed: 1\n"), **{**dict.fromkeys(GROUPS), **groups})


def vehicle(**values):
    names = (each.name for each in fields(InertiaFunctionsGroup))
    functions = InertiaFunctionsGroup(**{**dict.fromkeys(names), **values})
    return replace(VehicleGroup.of(VehicleModel(vehicle=VehicleSettings())), inertia_functions=functions)


def model(**values):
    return ChosenGroup(**{**dict.fromkeys(("weights", "base", "ridge_weight")), **values})


def rules(*names):
    return RulesGroup(name=names, firing=None, determined=None, excited=None)


def solve(rank, condition_number):
    return SolveGroup(singular_values=None, rank=rank, condition_number=condition_number, parameters=5)


@pytest.mark.parametrize(
    ("search", "complete", "reason"),
    [
        (None, True, ""),
        (SearchGroup(complete=True, stop_reason="converged"), True, "converged"),
        (SearchGroup(complete=False, stop_reason="time-limit"), False, "time-limit"),
        (SearchGroup(complete=False), False, ""),
        (SearchGroup(stop_reason="generations"), True, "generations"),
    ],
)
def test_a_search_is_complete_unless_the_model_says_otherwise(search, complete, reason):
    own = record(search=search)
    assert (own.complete, own.stop_reason) == (complete, reason)


@pytest.mark.parametrize(
    ("names", "visited", "rank", "condition", "same", "known"),
    [
        (("D11 rule 1", "D13 rule 1"), ALL_ROUND, 5, 3.0, True, True),
        (("D11 rule 1", "D13 rule 1"), ALL_ROUND, 5, 100.0, True, True),
        (("D11 rule 1", "D13 rule 1"), ALL_ROUND, 5, 100.1, True, False),
        (("D11 rule 1", "D13 rule 1"), ALL_ROUND, 4, 3.0, True, False),
        (("D11 rule 1", "D13 rule 1", "D13 rule 2"), ALL_ROUND, 5, 3.0, False, False),
        (("D11 rule 1", "D13 rule 1"), ALL_ROUND[:, :71], 5, 3.0, False, False),
    ],
)
def test_one_rule_holds_everywhere_where_training_went_all_round_and_determined_it(
    names, visited, rank, condition, same, known
):
    own = record(rules=rules(*names), vehicle=vehicle(visited=visited), solve=solve(rank, condition))
    assert (own.same_everywhere, own.known_everywhere) == (same, known)


def test_an_infinite_ridge_switches_the_fuzzy_part_off_and_without_weights_there_is_no_search():
    off = record(chosen=model(ridge_weight=np.inf, weights=np.zeros(0)))
    on = record(chosen=model(ridge_weight=0.1, weights=np.ones(4)))
    assert (off.fuzzy_part_off, off.searched) == (True, False)
    assert (on.fuzzy_part_off, on.searched) == (False, True)


def test_a_verdict_may_lack_any_of_its_datasets():
    assert VerdictGroup(label="do-not-use").reasons == []
    assert VerdictGroup(label="do-not-use").summary == {"label": "do-not-use", "region": "", "reasons": []}
    assert VerdictGroup(reason=("a", "b")).reasons == [("a", 0), ("b", 0)]
    assert VerdictGroup(reason=("a", "b"), speaks=np.array([1.0, -1.0])).reasons == [("a", 1), ("b", -1)]
    assert record(verdict=VerdictGroup(region="all")).trust == "not-judged"
    assert record(verdict=VerdictGroup(region="all")).validated
    assert not record().validated
