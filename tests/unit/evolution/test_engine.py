import copy
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from cpfls_cli.errors import ComputationError
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.evolution.engine import evolve, start, step
from cpfls_cli.evolution.settings import EvolutionSettings

# The operators of the paper, after the Sheffield toolbox.
PAPER = EvolutionSettings(
    population=75,
    generations=25,
    subpopulations=5,
    generation_gap=0.8,
    crossover_rate=0.8,
    recombination="single-point",
    insertion_rate=0.8,
    selective_pressure=1.5,
    mutated_individuals=0.04,
    mutated_bits=0.01,
    reinsertion="uniform",
)
SETTINGS = replace(PAPER, population=23, generations=12, subpopulations=4)


def zdt1(genes):
    x = genes / 65535
    g = 1 + 9 * x[:, 1:].mean(axis=1)
    return Evaluation(genes, np.column_stack([x[:, 0], g * (1 - np.sqrt(x[:, 0] / g))]))


def dtlz2(genes):
    x = genes / 65535
    g = 1 + np.sum((x[:, 1:] - 0.5) ** 2, axis=1)
    angle = x[:, 0] * np.pi / 2
    return Evaluation(genes, np.column_stack([g * np.cos(angle), g * np.sin(angle)]))


def hypervolume(points, reference):
    """Area that two-objective points dominate below a reference point."""
    area, floor = 0.0, reference[1]
    for x, y in sorted(map(tuple, points)):
        if x < reference[0] and y < floor:
            area += (reference[0] - x) * (floor - y)
            floor = y
    return area


class Recorder:
    def __init__(self, evaluate):
        self.evaluate, self.seen = evaluate, []

    def __call__(self, genes):
        self.seen.extend(map(tuple, genes.tolist()))
        return self.evaluate(genes)


def run(evaluate, seed=1, settings=SETTINGS, gene_count=6, **options):
    return list(evolve(evaluate, gene_count, settings, np.random.default_rng(seed), **options))


@pytest.mark.parametrize(
    ("operators", "ranking"),
    [
        (PAPER, "quantity-dominance"),
        (replace(PAPER, reinsertion="fitness"), "pareto-count"),
        (EvolutionSettings(), "pareto-fronts"),
    ],
    ids=["uniform", "fitness", "default"],
)
@pytest.mark.parametrize(("problem", "reference"), [(zdt1, (1.1, 6.0)), (dtlz2, (2.0, 2.0))])
def test_evolution_beats_random_search_at_equal_evaluations(problem, reference, ranking, operators):
    settings = replace(operators, population=60, generations=30, ranking=ranking)
    gained, random = [], []
    for seed in range(3):
        last = run(problem, seed, settings, gene_count=12)[-1]
        genes = np.random.default_rng(seed + 100).integers(0, 65536, (last.evaluations, 12))
        gained.append(hypervolume(last.front_objectives, reference))
        random.append(hypervolume(problem(genes).objectives, reference))
    assert min(gained) > 1.1 * max(random)


def test_the_same_seed_gives_the_same_generations():
    for one, other in zip(run(zdt1), run(zdt1), strict=True):
        np.testing.assert_array_equal(one.genes, other.genes)
        np.testing.assert_array_equal(one.front_objectives, other.front_objectives)
    assert not np.array_equal(run(zdt1, seed=2)[-1].genes, one.genes)


def test_generations_report_the_population_and_all_that_was_evaluated():
    recorder = Recorder(zdt1)
    generations = run(recorder)
    assert [generation.index for generation in generations] == list(range(13))
    assert np.bincount(generations[-1].subpopulations).tolist() == [6, 6, 6, 5]
    for generation in generations:
        assert generation.genes.shape == (23, 6)
        np.testing.assert_array_equal(generation.objectives, zdt1(generation.genes).objectives)
    assert generations[-1].evaluations == len(recorder.seen)
    objectives = zdt1(np.array(recorder.seen)).objectives
    np.testing.assert_array_equal(generations[-1].front_objectives.min(axis=0), objectives.min(axis=0))
    assert hypervolume(generations[-1].front_objectives, (9, 9)) == hypervolume(objectives, (9, 9))


def test_no_chromosome_is_evaluated_twice():
    recorder = Recorder(zdt1)
    settings = replace(PAPER, population=40, generations=30, mutated_individuals=0.0)
    # Two genes of one bit each, and no mutation: there are far fewer chromosomes than offspring.
    initial = np.random.default_rng(3).integers(0, 2, (40, 2)) * 65535
    last = run(recorder, settings=settings, gene_count=2, initial=initial)[-1]
    assert last.evaluations == len(recorder.seen) == len(set(recorder.seen))
    assert last.evaluations < 40 * 30 * 0.8


def test_refined_chromosomes_replace_the_offspring_and_are_known():
    known = set()

    def refine(genes):
        submitted, refined = set(map(tuple, genes.tolist())), genes // 4096 * 4096
        assert known.isdisjoint(submitted)
        known.update(submitted, map(tuple, refined.tolist()))
        return Evaluation(refined, zdt1(refined).objectives)

    generations = run(refine, gene_count=2)
    for generation in generations:
        assert np.all(generation.genes % 4096 == 0)
        np.testing.assert_array_equal(generation.objectives, zdt1(generation.genes).objectives)
    # The offspring that crossover rebuilds from refined parents are often refined chromosomes themselves.
    assert generations[-1].evaluations < 150


def test_rates_set_the_numbers_of_offspring_bred_and_inserted():
    settings = replace(
        PAPER, population=30, subpopulations=2, crossover_rate=0.0, mutated_individuals=1.0, mutated_bits=0.5
    )
    first = start(zdt1, 6, settings, np.random.default_rng(6))
    second = step(first, zdt1, settings)
    # Each subpopulation of 15 breeds 0.8 * 15 = 12 and inserts 0.8 * 12 = 9.6, rounded 10.
    assert len(second.archive) == 30 + 2 * 12
    assert np.count_nonzero(np.any(second.genes != first.genes, axis=1)) == 2 * 10


def test_migration_waits_for_its_interval_and_subpopulations_stay_apart_before():
    # Every gene tells its subpopulation; without mutation only migration brings another value.
    settings = replace(PAPER, population=20, generations=5, subpopulations=4, mutated_individuals=0.0)
    labels = np.repeat(np.arange(4), 5)
    generations = run(zdt1, settings=settings, initial=np.repeat(labels[:, np.newaxis] * 1000, 6, axis=1))
    for generation in generations[:5]:
        np.testing.assert_array_equal(generation.genes[:, 0], labels * 1000)
    strangers = np.any(generations[5].genes != labels[:, np.newaxis] * 1000, axis=1)
    assert np.bincount(labels[strangers]).tolist() == [1, 1, 1, 1]


def test_without_elitism_the_population_may_lose_its_best_but_the_archive_does_not():
    settings = replace(PAPER, population=20, generations=40, subpopulations=2, mutated_individuals=1.0)
    generations = run(zdt1, settings=settings)
    populations = [generation.objectives.min(axis=0) for generation in generations]
    assert any(np.any(later > earlier) for earlier, later in pairwise(populations))
    best = [generation.front_objectives.min(axis=0) for generation in generations]
    assert all(np.all(later <= earlier) for earlier, later in pairwise(best))


def test_failed_models_never_stay_while_there_are_others():
    def failing(genes):
        evaluation = zdt1(genes)
        evaluation.objectives[genes[:, 0] > 30000] = np.nan
        return evaluation

    settings = replace(PAPER, population=40, generations=20, reinsertion="fitness")
    last = run(failing, settings=settings)[-1]
    assert np.all(np.isfinite(last.objectives))
    assert np.all(np.isfinite(last.front_objectives.min(axis=0)))


def test_a_search_in_which_everything_fails_still_ends():
    last = run(lambda genes: Evaluation(genes, np.full((len(genes), 2), np.nan)))[-1]
    assert np.all(np.isinf(last.objectives))
    assert len(last.front_genes) == 1


def test_a_copied_state_continues_as_the_original():
    state = start(zdt1, 6, SETTINGS, np.random.default_rng(4))
    for _ in range(4):
        state = step(state, zdt1, SETTINGS)
    kept = copy.deepcopy(state)
    for _ in range(4):
        state, kept = step(state, zdt1, SETTINGS), step(kept, zdt1, SETTINGS)
    np.testing.assert_array_equal(state.genes, kept.genes)
    assert state.report().evaluations == kept.report().evaluations


def test_the_initial_chromosomes_come_first():
    initial = np.arange(12).reshape(2, 6)
    first = next(evolve(zdt1, 6, SETTINGS, np.random.default_rng(5), initial))
    np.testing.assert_array_equal(first.genes[:2], initial)
    assert first.evaluations == 23


@pytest.mark.parametrize("initial", [np.zeros((24, 6), dtype=int), np.zeros((2, 5), dtype=int), np.full((2, 6), 65536)])
def test_initial_chromosomes_that_do_not_fit_are_refused(initial):
    with pytest.raises(ComputationError, match="initial: expected"):
        run(zdt1, initial=initial)


def test_refined_genes_out_of_range_are_refused():
    with pytest.raises(ComputationError, match=r"evaluation\.genes: expected genes from 0 to 65535"):
        run(lambda genes: Evaluation(genes - 65536, zdt1(genes).objectives))
