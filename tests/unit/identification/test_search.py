"""The search over a made-up evaluator: watched, stopped in the middle and continued."""

import copy
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.errors import ComputationError
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.identification.search import NothingFoundError, search
from cpfls_cli.identification.search_run import SearchRun
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor.structure import model_structure

SETTINGS = IdentificationSettings(
    consequents="seesaw", products="additive", membership_functions=3, population=24, subpopulations=3, generations=6
)


class Bowls:
    """Three paraboloids with minima at different places; a chromosome is refined a little."""

    structure = model_structure(SETTINGS)

    def __init__(self, finite=True):
        self.evaluated, self.finite = [], finite

    def __call__(self, genes):
        self.evaluated.extend(map(tuple, genes.tolist()))
        refined = genes // 2 * 2
        x = refined / 65535
        objectives = np.column_stack([np.sum((x - place) ** 2, axis=1) + 1 for place in (0.2, 0.5, 0.9)])
        return Evaluation(refined, objectives if self.finite else np.full_like(objectives, np.nan))


def searched(evaluator=None, settings=SETTINGS, **run):
    return search(evaluator or Bowls(), settings, np.random.default_rng(3), SearchRun(**run))


def stop_after(evaluator, evaluations, reason="interrupted"):
    return lambda: reason if len(evaluator.evaluated) >= evaluations else None


def assert_same(one, other):
    for result in ("front", "history"):
        for name, values in vars(getattr(one, result)).items():
            np.testing.assert_array_equal(values, getattr(getattr(other, result), name))
    assert one.stop_reason == other.stop_reason


def states():
    kept = []
    whole = searched(on_generation=lambda state: kept.append(copy.deepcopy(state)))
    return whole, kept


def test_continued_from_any_generation_it_ends_as_if_it_had_not_stopped():
    whole, kept = states()
    assert [state.index for state in kept] == list(range(7))
    for state in kept:
        assert_same(searched(resumed=state), whole)


def test_result_does_not_depend_on_the_order_of_evaluations():
    @contextmanager
    def backwards(evaluate):
        def stream(genes):
            for rows in np.array_split(np.arange(len(genes))[::-1], 3):
                yield rows, evaluate(genes[rows])

        yield SimpleNamespace(stream=stream)

    assert_same(searched(workers=backwards), searched())


@pytest.mark.parametrize("evaluations", range(1, 60, 9))
def test_stopped_after_the_running_evaluation_it_keeps_what_it_has(evaluations):
    evaluator = Bowls()
    found = searched(evaluator, should_stop=stop_after(evaluator, evaluations))
    assert found.stop_reason == "interrupted"
    assert len(evaluator.evaluated) == evaluations == found.history.evaluations[-1]
    expected = Bowls()(np.array(evaluator.evaluated))
    np.testing.assert_array_equal(found.history.best[-1], expected.objectives.min(axis=0))
    for genes, objectives in zip(found.front.chromosomes, found.front.objectives, strict=True):
        assert genes.tolist() in expected.genes.tolist()
        assert not np.any(np.all(expected.objectives < objectives, axis=1))
    assert len(found.history.best) == len(found.history.front_size) == len(found.history)


@pytest.mark.parametrize("evaluations", [1, 10, 24, 25, 33, 60])
def test_what_is_evaluated_of_a_generation_is_not_evaluated_again(evaluations):
    first, second, states, unfinished = Bowls(), Bowls(), [None], [None]
    searched(
        first,
        should_stop=stop_after(first, evaluations),
        on_generation=lambda state: states.append(copy.deepcopy(state)),
        on_stop=unfinished.append,
    )
    steps = []
    found = searched(second, resumed=states[-1], unfinished=unfinished[-1], progress=steps.append)
    assert_same(found, searched())
    assert len(set(first.evaluated) | set(second.evaluated)) == found.history.evaluations[-1]
    assert set(first.evaluated).isdisjoint(second.evaluated)
    assert np.all(np.diff([step.generation + step.share for step in steps]) > 0)


def test_stopped_between_generations_it_counts_no_further_one():
    kept = []
    found = searched(on_generation=kept.append, should_stop=lambda: "time-limit" if len(kept) == 3 else None)
    assert found.stop_reason == "time-limit"
    assert [state.index for state in kept] == [0, 1, 2]
    np.testing.assert_array_equal(found.history.evaluations, kept[-1].history.evaluations)


def test_asked_to_stop_at_the_end_it_is_complete():
    whole, kept = states()
    late = searched(should_stop=stop_after(Bowls(), 0), resumed=kept[-1])
    assert late.stop_reason == "generations"
    assert_same(late, whole)


def test_search_that_stalls_ends_converged():
    settings = IdentificationSettings(**{**vars(SETTINGS), "generations": 50, "stall_generations": 1})
    found = searched(settings=settings)
    assert found.stop_reason == "converged"
    assert len(found.history) < 51


@pytest.mark.parametrize(("stop", "reason"), [(lambda: None, "generations"), (lambda: "time-limit", "time-limit")])
def test_search_without_a_finite_model_tells_why_it_ended(stop, reason):
    with pytest.raises(NothingFoundError, match="no chromosome gave a finite model") as error:
        searched(Bowls(finite=False), should_stop=stop)
    assert error.value.stop_reason == reason


def test_failing_worker_leaves_the_generations_before():
    kept, evaluator = [], Bowls()

    def fail_later(genes):
        if len(evaluator.evaluated) > 30:
            raise ComputationError("the worker is gone")
        return evaluator(genes)

    fail_later.structure = evaluator.structure
    with pytest.raises(ComputationError, match="the worker is gone"):
        searched(fail_later, on_generation=lambda state: kept.append(copy.deepcopy(state)))
    assert_same(searched(resumed=kept[-1]), searched())


def test_progress_goes_on_where_it_was():
    _, kept = states()
    steps = []
    searched(resumed=kept[3], progress=steps.append)
    done = [step.generation + step.share for step in steps]
    assert done[0] == 4.0
    assert np.all(np.diff(done) > 0)
    assert done[-1] == 7.0
    np.testing.assert_array_equal(steps[0].best, kept[3].history.best[-1])
