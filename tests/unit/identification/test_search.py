"""The search for a model, its local search, and what identify makes of them."""

import copy
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import block_diag

from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.evaluator import LARGEST_GENE, Problem, decode, refine, weight_jacobian
from cpfls_cli.identification.identify import identify, model_evaluator
from cpfls_cli.identification.samples import Samples
from cpfls_cli.identification.search import SearchRun, choose, search
from cpfls_cli.identification.settings import IdentificationSettings, LocalSearchSettings, RidgeSettings
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from tests.builders.flights import random_flight, rigid_torque

SETTINGS = IdentificationSettings(
    consequents="seesaw", products="additive", membership_functions=3, population=24, subpopulations=3, generations=6
)
SMALL = {"population": 10, "generations": 2, "local_search": LocalSearchSettings(evaluations=2)}
SEARCHED = {**SMALL, "consequents": "seesaw", "products": "additive", "membership_functions": 3}


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
    return searched(on_generation=lambda state: kept.append(copy.deepcopy(state))), kept


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
    assert (choose(FRONT, rule), choose(FRONT[::-1], rule)) == (member, 4 - member)
    assert choose(FRONT[:1], rule) == 0


def test_held_out_errors_decide_alone():
    assert (choose(FRONT, "held-out", KEPT), choose(FRONT[::-1], "held-out", KEPT[::-1])) == (3, 1)


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


def one_by_one(weights):
    """Breakpoints of one partition as equation (10) has them, and their derivatives by the weights."""
    if len(weights) == 0:
        return np.zeros(1), np.zeros((0, 0))
    ends = np.concatenate([[0.0], np.cumsum(weights) / np.sum(weights)])
    ends[-1] = 1.0
    return ends, (np.tri(max(len(weights) - 1, 0), len(weights)) - ends[1:-1, None]) / np.sum(weights)


@pytest.mark.parametrize("functions", [1, 2, 5, 9, 15, (1, 2, 3, 4, 15, 2), (15, 14, 9, 2, 9, 3)])
def test_all_partitions_at_once_are_those_one_by_one_to_the_last_bit(functions):
    structure = model_structure(StructureSettings(membership_functions=functions))
    rng = np.random.default_rng(50)
    for scale in (1.0, 65535.0, 1e-3):
        weights = scale * rng.uniform(0, 1, structure.genes) ** 3
        ends, slopes = zip(*(one_by_one(weights[part]) for part in structure.weight_slices()), strict=True)
        for found, expected in zip(decode(structure, weights), ends, strict=True):
            np.testing.assert_array_equal(found, expected)
        np.testing.assert_array_equal(weight_jacobian(structure, weights), block_diag(*slopes))


@pytest.mark.parametrize("evaluations", [1, 2, 4])
@pytest.mark.parametrize("every", [1, 2])
def test_a_refinement_spends_its_budget_and_hands_back_the_products_of_its_genes(monkeypatch, evaluations, every):
    def torque(motion):
        whole = rigid_torque(np.diag([0.5, 0.7, 1.1]))(motion)
        whole[:, 1] += np.exp(np.cos(motion.attitude[:, 0])) * motion.acceleration[:, 1]
        return whole

    data = random_flight(torque, np.random.default_rng(14), 120, noise=0.05)
    settings = IdentificationSettings(
        base="none",
        consequents="seesaw",
        products="additive",
        membership_functions=3,
        local_search=LocalSearchSettings(),
    )
    evaluator = model_evaluator(data, data[::every], settings)
    genes = np.random.default_rng(51).integers(20000, LARGEST_GENE, evaluator.structure.genes)
    partitions = decode(evaluator.structure, genes.astype(float))
    products, calls = evaluator.solver.products(partitions), []
    problem = Problem(evaluator.solver, evaluator.solver.fit(partitions, products))
    counted = Samples.products
    monkeypatch.setattr(Samples, "products", lambda self, at: calls.append(at) or counted(self, at))
    found = refine(problem, genes, products, evaluations)
    assert len(calls) <= evaluations - 1
    again = evaluator.solver.products(decode(evaluator.structure, found.genes.astype(float)))
    np.testing.assert_array_equal(found.products.gram, again.gram)
    start = problem.point(genes, products).square
    assert found.square < start if evaluations > 1 else found.square == start


def nearly_rigid_flight(samples=100, noise=0.02, seed=22, limit=np.pi):
    return random_flight(rigid_torque(), seed, samples, noise=noise, limit=limit)


def identified(settings, data=None, progress=None, seed=1):
    data = nearly_rigid_flight() if data is None else data
    return identify(
        data,
        data,
        {"held out": nearly_rigid_flight(seed=23)},
        IdentificationSettings(**settings),
        np.random.default_rng(seed),
        SearchRun(progress=progress or (lambda _: None)),
    )


@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_result_hangs_together(base):
    calls = []
    found = identified({**SEARCHED, "base": base}, progress=calls.append)
    assert np.isfinite(found.front.objectives).all()
    assert np.isfinite(found.history.best).all()
    assert np.all(np.diff(found.history.best, axis=0) <= 0)
    assert len(calls) == found.history.evaluations[-1]
    assert np.all(np.diff([step.generation + step.share for step in calls]) > 0)
    assert {step.generations for step in calls} == {2}
    for step in calls:
        if step.generation > 0:
            np.testing.assert_array_equal(step.best, found.history.best[step.generation - 1])
    chosen = found.front.objectives[found.front.chosen]
    assert chosen[0] == pytest.approx(found.fit.mean_squared_error, rel=1e-9)
    training = found.scores["training"]
    assert chosen[1] == pytest.approx(training["model"].max_error.max(), rel=1e-9)
    assert set(found.scores) == {"training", "held out"}
    assert {"model", "rigid-body", "constant-inertia", "torque-zero"} <= set(training)
    assert dict(found.samples) == {"training": 100, "held out": 100}
    error = nearly_rigid_flight().torque - found.model.torque(nearly_rigid_flight().motion)
    np.testing.assert_allclose(training["model"].mse, np.mean(error**2, axis=0), rtol=1e-10)
    assert (found.ridge is None) == (base == "none")


def test_a_structure_without_genes_needs_no_search():
    found = identified({**SMALL, "base": "none", "membership_functions": 1}, nearly_rigid_flight(noise=0.0))
    assert (found.front.chromosomes.shape, found.history.evaluations.tolist()) == ((1, 0), [1])
    assert found.model.coefficients.shape == (61,)
    assert found.scores["training"]["model"].max_error.max() < 1e-12
    assert 0 <= found.fit.mean_squared_error < 1e-24


def test_rigid_data_leave_the_model_no_worse_than_the_rigid_body():
    found = identified({**SMALL, "base": "rigid-body"}, nearly_rigid_flight(noise=0.05))
    assert found.fit.ridge_weight == np.inf
    held_out = found.scores["held out"]
    np.testing.assert_allclose(held_out["model"].mse, held_out["rigid-body"].mse, rtol=1e-9)
    assert any("switched the fuzzy part off" in finding for finding in found.findings)


def test_model_learned_from_a_selection_is_judged_on_all_of_training():
    data, selected = nearly_rigid_flight(), np.arange(0, 100, 2)
    settings = IdentificationSettings(**{**SMALL, "base": "rigid-body"})
    found = identify(data, data[selected], {}, settings, np.random.default_rng(0))
    assert dict(found.samples) == {"training": 100}
    assert np.linalg.norm(found.fit.rigid_body - [0.6, 0.7, 1.2, 0, 0, 0]) < 0.05


def test_objectives_are_judged_on_all_of_training():
    """Few samples are met exactly by 25 coefficients; what the front counts is the error next to them too."""
    data, selected = nearly_rigid_flight(noise=0.05), np.arange(0, 100, 8)
    settings = IdentificationSettings(**{**SEARCHED, "base": "none"})
    found = identify(data, data[selected], {}, settings, np.random.default_rng(0))
    error = data.torque - found.model.torque(data.motion)
    expected = [np.mean(error**2), np.abs(error).max(), found.fit.conditioning]
    np.testing.assert_allclose(found.front.objectives[found.front.chosen], expected, rtol=1e-9)
    assert np.mean(error[selected] ** 2) < 0.5 * np.mean(error**2)


def test_search_that_starts_with_the_uniform_partitions_is_never_worse():
    training = identified({**SEARCHED, "base": "none", "choice": "mse", "start": "with-uniform"}).scores["training"]
    assert training["model"].mse.sum() <= training["uniform-partitions"].mse.sum()
    assert "uniform-partitions" not in identified({**SMALL, "membership_functions": 1}).scores["training"]


@pytest.mark.parametrize(("samples", "message"), [(9, "too few for that many blocks"), (12, "cover all samples")])
def test_too_few_samples(samples, message):
    """12 samples of 0.01 s lie wholly within 0.1 s of every block of theirs."""
    with pytest.raises(SettingError, match=message):
        identified(SMALL, nearly_rigid_flight(samples))


def test_ridge_weights_must_ascend():
    with pytest.raises(SettingError) as caught:
        RidgeSettings(smallest=1.0, largest=0.5)
    assert caught.value.key == "largest"


def test_nothing_is_identified_from_a_torque_of_zero_or_a_vehicle_that_never_turns():
    # It would be a body without inertia, of which no score, band or verdict makes sense.
    data = nearly_rigid_flight()
    still = TorqueData(data.time, data.motion, np.zeros_like(data.torque))
    for base in ("rigid-body", "none"):
        with pytest.raises(ComputationError, match="the torque is zero at all samples"):
            identified({**SMALL, "base": base}, still)
    zero = np.zeros((40, 3))
    still = TorqueData(0.01 * np.arange(40), Motion(zero, zero, zero), np.ones((40, 3)))
    for settings in ({**SMALL, "base": "rigid-body"}, {**SEARCHED, "base": "none"}):
        with pytest.raises(ComputationError, match="no chromosome gave a finite model"):
            identified(settings, still)


def test_rules_without_excitation_and_rank_are_reported():
    found = identified({**SEARCHED, "base": "none", "membership_functions": 5}, nearly_rigid_flight(limit=0.2))
    assert any(finding.startswith("rank ") for finding in found.findings)
    assert any("rules not excited" in finding and "D22 rule" in finding for finding in found.findings)
