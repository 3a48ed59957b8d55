"""Facts that follow from the fields of an identified model, each in one place."""

from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.dynamics import InertiaFunctions
from cpfls_cli.regressor.structure import StructureSettings, model_structure

ALL_ROUND = np.eye(72, dtype=bool)


def made(**values):
    return IdentifiedModel(**{**dict.fromkeys(own.name for own in fields(IdentifiedModel)), **values})


def functions(count, visited):
    structure = model_structure(StructureSettings(membership_functions=count))
    return InertiaFunctions(structure, (), (), np.zeros(0), np.zeros(6), visited)


@pytest.mark.parametrize(
    ("reason", "stopped"),
    [("generations", ""), ("converged", ""), ("time-limit", "time-limit"), ("interrupted", "interrupted")],
)
def test_a_search_is_complete_where_it_came_to_its_end(reason, stopped):
    own = made(stop_reason=reason)
    assert (own.complete, own.stopped) == (not stopped, stopped)


@pytest.mark.parametrize(
    ("count", "visited", "rank", "condition", "same", "known"),
    [
        (1, ALL_ROUND, 5, 3.0, True, True),
        (1, ALL_ROUND, 5, 100.0, True, True),
        (1, ALL_ROUND, 5, 100.1, True, False),
        (1, ALL_ROUND, 4, 3.0, True, False),
        (3, ALL_ROUND, 5, 3.0, False, False),
        (1, ALL_ROUND[:, :71], 5, 3.0, False, False),
    ],
)
def test_one_rule_holds_everywhere_where_training_went_all_round_and_determined_it(
    count, visited, rank, condition, same, known
):
    model = SimpleNamespace(fuzzy=functions(count, visited))
    own = made(model=model, rank=rank, parameters=5, condition_number=condition)
    assert (own.functions.same_everywhere, own.known_everywhere) == (same, known)


def test_an_infinite_ridge_switches_the_fuzzy_part_off_and_without_weights_there_is_no_search():
    off = made(ridge_weight=np.inf, weights=np.zeros(0, dtype=int))
    on = made(ridge_weight=0.1, weights=np.ones(4, dtype=int))
    assert (off.fuzzy_part_off, off.searched) == (True, False)
    assert (on.fuzzy_part_off, on.searched) == (False, True)


def test_without_a_verdict_it_is_not_judged():
    assert (made().trust, made().validated) == ("not-judged", False)
