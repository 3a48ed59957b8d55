"""The search over a made-up evaluator, watched, stopped in the middle and continued; and the choice of a member."""

import copy
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.errors import SettingError
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.identification.identify import identify
from cpfls_cli.identification.search import SearchRun, choose, search
from cpfls_cli.identification.settings import IdentificationSettings, LocalSearchSettings
from cpfls_cli.regressor.structure import model_structure
from tests.builders.flights import random_flight, rigid_torque

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


def test_progress_goes_on_where_it_was():
    _, kept = states()
    steps = []
    searched(resumed=kept[3], progress=steps.append)
    done = [step.generation + step.share for step in steps]
    assert done[0] == 4.0
    assert np.all(np.diff(done) > 0)
    assert done[-1] == 7.0
    np.testing.assert_array_equal(steps[0].best, kept[3].history.best[-1])


# Mean squared error, largest error, condition number; the median condition number is 300.
FRONT = np.array([[1.0, 5.0, 900.0], [2.0, 1.0, 400.0], [3.0, 4.0, 300.0], [4.0, 3.0, 200.0], [5.0, 2.0, 100.0]])
KEPT = np.array([4.0, np.inf, 2.0, 1.0, 3.0])


@pytest.mark.parametrize(("rule", "member"), [("mse", 0), ("max-error", 1), ("mse-below-median-condition", 2)])
def test_rules(rule, member):
    assert choose(FRONT, rule) == member
    assert choose(FRONT[::-1], rule) == 4 - member
    assert choose(FRONT[:1], rule) == 0


def test_held_out_errors_decide_alone():
    assert choose(FRONT, "held-out", KEPT) == 3
    assert choose(FRONT[::-1], "held-out", KEPT[::-1]) == 1


@pytest.mark.parametrize(("rule", "kept", "said"), [("held-out", None, "add --choose-on"), ("mse", KEPT, "held-out")])
def test_rule_and_kept_flights_go_together(rule, kept, said):
    with pytest.raises(SettingError, match=said) as caught:
        choose(FRONT, rule, kept)
    assert caught.value.key == "choice"


FLIGHT = IdentificationSettings(
    population=10,
    generations=2,
    local_search=LocalSearchSettings(evaluations=2),
    consequents="seesaw",
    products="additive",
    membership_functions=3,
    base="none",
)


def noisy_flight(seed):
    return random_flight(rigid_torque(), seed, 120, noise=0.3)


def found(base="none", kept=None, choice="held-out", **parts):
    settings = replace(FLIGHT, base=base, choice=choice)
    training = noisy_flight(1)
    return identify(training, training, parts, settings, np.random.default_rng(3), kept=kept)


@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_errors_are_those_of_the_members_on_the_kept_flight(base):
    """The chosen member is judged as if its flight had been given to judge, axes scaled as the solver scales them."""
    kept = noisy_flight(5)
    result = found(base, kept, judged=kept)
    front = result.front
    assert front.held_out.shape == (len(front.objectives),)
    assert front.held_out[front.chosen] == front.held_out.min()
    error = np.mean(result.scores["judged"]["model"].mse * result.fit.row_scale**2)
    assert front.held_out[front.chosen] == pytest.approx(error, rel=1e-9)


def test_the_choice_differs_between_flights_and_from_that_on_the_training_part():
    """All come from the same search, so that only the flight that is chosen on can make the difference."""
    fronts = [found(kept=noisy_flight(seed)).front for seed in range(5, 15)] + [found(choice="mse").front]
    for front in fronts:
        np.testing.assert_array_equal(front.chromosomes, fronts[0].chromosomes)
    assert len({front.chosen for front in fronts}) > 1
    assert fronts[-1].held_out is None


@pytest.mark.parametrize(("choice", "kept"), [("held-out", None), ("mse", noisy_flight(5))])
def test_a_choice_that_its_flights_do_not_fit_is_refused_before_the_search(choice, kept):
    with pytest.raises(SettingError) as caught:
        found(choice=choice, kept=kept)
    assert caught.value.key == "choice"


def test_a_structure_without_genes_has_one_member_to_choose():
    training = noisy_flight(1)
    settings = replace(FLIGHT, consequents="harmonic", products="tensor", membership_functions=1, choice="held-out")
    result = identify(training, training, {}, settings, np.random.default_rng(3), kept=noisy_flight(5))
    assert result.front.held_out.shape == (1,)
