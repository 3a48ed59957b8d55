"""The engine of the evolution, its state, ranking and archive."""

import copy
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import rankdata

from cpfls_cli.errors import ComputationError
from cpfls_cli.evolution.archive import Archive, Evaluation, positions, rank
from cpfls_cli.evolution.engine import History, ended, stalled, start, step
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


def evolve(*given):
    """Give each generation of a search, with what was evaluated by then."""
    state = start(*given)
    while True:
        front = state.archive.front
        known = {"evaluations": len(state.archive), "front_genes": front.genes, "front_objectives": front.objectives}
        yield SimpleNamespace(**vars(state), **known)
        if ended(state, given[2]) is not None:
            return
        state = step(state, given[0], given[2])


def run(evaluate, seed=1, settings=SETTINGS, gene_count=6, initial=None):
    return list(evolve(evaluate, gene_count, settings, np.random.default_rng(seed), initial))


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
    # Every gene shows its subpopulation; without mutation only migration brings another value.
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

    last = run(failing, settings=replace(PAPER, population=40, generations=20, reinsertion="fitness"))[-1]
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
    assert len(state.archive) == len(kept.archive)


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


def course(*best):
    rows = np.arange(len(best))
    return History(rows, np.array(best, dtype=float), rows)


def sphere(genes):
    x = genes / 65535
    return Evaluation(genes, np.column_stack([np.sum(x**2, axis=1), np.sum((x - 1) ** 2, axis=1)]))


@pytest.mark.parametrize(
    ("best", "expected"),
    [
        ([[8, 4], [8, 4], [8, 4]], True), ([[8, 4], [7.3, 4], [7.2, 4]], True), ([[8, 4], [7.3, 4], [7.1, 4]], False),
        ([[8, 4], [8, 3.9], [8, 3.5]], False), ([[9, 4], [8, 4], [8, 4], [8, 4]], True), ([[8, 4], [8, 4]], False),
        ([[np.inf, 4], [np.inf, 4], [8, 4]], False), ([[np.inf, 4], [np.inf, 4], [np.inf, 4]], True),
        ([[-8, 4], [-8, 4], [-8.9, 4]], False), ([[-8, 4], [-8, 4], [-8.7, 4]], True),
        ([[0, 0], [0, 0], [0, 0]], True),
    ],
)  # fmt: skip
def test_stalled_looks_back_two_generations_for_ten_per_cent(best, expected):
    assert stalled(course(*best), 2, 0.1) is expected


def test_nothing_stalls_by_default():
    assert not stalled(course(*[[1, 1]] * 1000), EvolutionSettings().stall_generations, 0.1)


def test_evolution_ends_in_the_first_generation_that_stalls():
    settings = EvolutionSettings(population=20, generations=400, stall_generations=5, stall_improvement=0.02)
    generations = list(evolve(sphere, 4, settings, np.random.default_rng(1)))
    best = np.array([generation.front_objectives.min(axis=0) for generation in generations])
    improved = np.any(best[5:] < best[:-5] * (1 - 0.02), axis=1)
    assert improved[:-1].all()
    assert not improved[-1]
    assert 5 < len(generations) < 401


def test_reason_of_the_end():
    settings = EvolutionSettings(population=10, generations=2, stall_generations=1, stall_improvement=0.999)
    state = start(sphere, 4, settings, np.random.default_rng(1))
    assert ended(state, settings) is None
    state = step(state, sphere, settings)
    assert ended(state, settings) == "converged"
    assert ended(step(state, sphere, settings), settings) == "generations"


def test_history_has_a_row_for_each_generation():
    settings = EvolutionSettings(population=10, generations=4)
    reports = list(evolve(sphere, 4, settings, np.random.default_rng(2)))
    state = start(sphere, 4, settings, np.random.default_rng(2))
    while ended(state, settings) is None:
        state = step(state, sphere, settings)
    np.testing.assert_array_equal(state.history.evaluations, [report.evaluations for report in reports])
    np.testing.assert_array_equal(state.history.front_size, [len(report.front_genes) for report in reports])
    np.testing.assert_array_equal(state.history.best, [report.front_objectives.min(axis=0) for report in reports])


class RoundingRecorder:
    """Evaluate to (sum, -sum) of genes that a local search rounds up to a multiple of ten."""

    def __init__(self):
        self.calls = []

    def __call__(self, genes):
        self.calls.append(genes.tolist())
        refined = -(-genes // 10) * 10
        total = refined.sum(axis=1, keepdims=True).astype(float)
        return Evaluation(refined, np.hstack([total, -total]))


def test_unknown_chromosomes_are_evaluated_once_and_known_ones_recall_their_refinement():
    archive, recorder = Archive(), RoundingRecorder()
    archive.evaluate(np.array([[13], [2], [13], [31]]), recorder)
    archive.evaluate(np.array([[5], [2], [5], [31]]), recorder)
    assert recorder.calls == [[[13], [2], [31]], [[5]]]
    assert len(archive) == 4
    archive, recorder = Archive(), RoundingRecorder()
    first = archive.evaluate(np.array([[13, 4]]), recorder)
    again = archive.evaluate(np.array([[20, 10], [13, 4]]), recorder)
    assert len(recorder.calls) == 1
    assert first.genes.tolist() == [[20, 10]]
    assert (again.genes.tolist(), again.objectives.tolist()) == ([[20, 10], [20, 10]], [[30.0, -30.0]] * 2)
    archive = Archive()
    archive.store(np.array([[1], [2]]), Evaluation(np.array([[1], [2]]), np.array([[np.nan, -np.inf], [1, 2]])))
    assert archive.results.objectives.tolist() == [[np.inf, np.inf], [1.0, 2.0]]
    assert archive.front.genes.tolist() == [[2]]


def test_the_front_grows_and_forgets_the_dominated():
    archive = Archive()
    genes = np.arange(5)[:, np.newaxis]
    objectives = np.array([[3.0, 3.0], [1.0, 5.0], [2.0, 2.0], [2.0, 2.0], [5.0, 1.0]])
    fronts = []
    for row in range(5):
        archive.store(genes[[row]], Evaluation(genes[[row]], objectives[[row]]))
        fronts.append(archive.front.genes[:, 0].tolist())
    assert fronts == [[0], [0, 1], [1, 2], [1, 2], [1, 2, 4]]


@pytest.mark.parametrize(
    ("genes", "objectives", "name"),
    [
        (np.zeros((2, 2), dtype=int), np.zeros((3, 1)), "genes"),
        (np.zeros((3, 2)), np.zeros((3, 1)), "genes"),
        (np.zeros((3, 2), dtype=int), np.zeros((2, 1)), "objectives"),
        (np.zeros((3, 2), dtype=int), np.zeros(3), "objectives"),
    ],
)
def test_an_evaluation_that_does_not_fit_is_refused(genes, objectives, name):
    with pytest.raises(ComputationError, match=f"evaluation.{name}: expected"):
        Archive().evaluate(np.arange(6).reshape(3, 2), lambda _: Evaluation(genes, objectives))


def test_rebuilt_archive_knows_counts_and_gives_the_same():
    rng = np.random.default_rng(8)

    def evaluate(genes):
        # Refined to even genes: what one chromosome becomes, another one is, and equal objectives are common.
        refined = genes // 2 * 2
        objectives = np.column_stack([refined.sum(axis=1) % 5, refined[:, 0] % 7]).astype(float)
        objectives[refined[:, 1] > 12] = np.nan
        return Evaluation(refined, objectives)

    archive = Archive()
    for _ in range(8):
        archive.evaluate(rng.integers(0, 16, (12, 2)), evaluate)
    rebuilt = Archive.of(archive.submitted, archive.results)
    assert len(rebuilt) == len(archive)
    asked = np.stack(np.meshgrid(np.arange(16), np.arange(16)), axis=-1).reshape(-1, 2)
    for one, other in ((archive.front, rebuilt.front), *[[a.evaluate(asked, evaluate) for a in (archive, rebuilt)]]):
        np.testing.assert_array_equal(one.genes, other.genes)
        np.testing.assert_array_equal(one.objectives, other.objectives)
    np.testing.assert_array_equal(archive.submitted, rebuilt.submitted)


# a, b and c do not dominate one another; d is dominated by b; e by all four.
HAND_WORKED = np.array([[1.0, 4.0], [2.0, 2.0], [4.0, 1.0], [3.0, 3.0], [4.0, 4.0]])


@pytest.mark.parametrize("method", ["quantity-dominance", "pareto-count", "pareto-fronts"])
def test_a_failed_individual_ranks_last_and_failures_tie(method):
    ranks = rank(np.vstack([HAND_WORKED, [[np.nan, np.nan], [np.inf, -np.inf], [np.nan, np.inf]]]), method)
    assert len(set(ranks[5:].tolist())) == 1
    assert ranks[5] > ranks[:5].max()


def test_a_weight_counts_the_first_objective_so_many_times():
    # first objective: smaller minus larger is -4 -2 3 0 3, ten times; second: 3 -2 -4 0 3
    assert rank(HAND_WORKED, "quantity-dominance", 10).tolist() == [-37, -22, 26, 0, 33]


@pytest.mark.parametrize("method", ["pareto-count", "pareto-fronts"])
def test_pareto_rankings_know_no_weight(method):
    np.testing.assert_array_equal(rank(HAND_WORKED, method, 10), rank(HAND_WORKED, method))


@pytest.mark.parametrize("values", [[3, 1, 2], [1, 1, 2, 1], [np.inf, 0.5, np.inf, -1.0, 0.5], [7]])
def test_positions_are_ranks_with_ties_averaged(values):
    np.testing.assert_array_equal(positions(np.array(values)), rankdata(values, method="average"))
