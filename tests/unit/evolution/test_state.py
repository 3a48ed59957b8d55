import numpy as np
import pytest

from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.evolution.engine import History, ended, evolve, stalled, start, step
from cpfls_cli.evolution.settings import EvolutionSettings


def course(*best):
    rows = np.arange(len(best))
    return History(rows, np.array(best, dtype=float), rows)


def sphere(genes):
    x = genes / 65535
    return Evaluation(genes, np.column_stack([np.sum(x**2, axis=1), np.sum((x - 1) ** 2, axis=1)]))


@pytest.mark.parametrize(
    ("best", "expected"),
    [
        ([[8, 4], [8, 4], [8, 4]], True),
        ([[8, 4], [7.3, 4], [7.2, 4]], True),
        ([[8, 4], [7.3, 4], [7.1, 4]], False),
        ([[8, 4], [8, 3.9], [8, 3.5]], False),
        ([[9, 4], [8, 4], [8, 4], [8, 4]], True),
        ([[8, 4], [8, 4]], False),
        ([[np.inf, 4], [np.inf, 4], [8, 4]], False),
        ([[np.inf, 4], [np.inf, 4], [np.inf, 4]], True),
        ([[-8, 4], [-8, 4], [-8.9, 4]], False),
        ([[-8, 4], [-8, 4], [-8.7, 4]], True),
        ([[0, 0], [0, 0], [0, 0]], True),
    ],
)
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
