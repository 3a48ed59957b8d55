"""The selection against a brute-force greedy that evaluates every sample from its definition."""

import numpy as np
import pytest

from cpfls_cli.errors import SettingError
from cpfls_cli.reduction.settings import ReductionSettings
from tests.builders.reductions import reduce


def problem(seed, samples=40, columns=8):
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((samples, 3, columns)) * rng.uniform(0.3, 2.0, (samples, 1, 1))
    return rows * np.geomspace(1.0, 0.02, columns)


def rows_of(Q, indices):
    return Q[indices].reshape(-1, Q.shape[2])


def start_score(Q, chosen, index):
    span = rows_of(Q, chosen) if chosen else np.zeros((1, Q.shape[2]))
    residual = Q[index] - Q[index] @ np.linalg.pinv(span) @ span
    missing = Q.shape[2] - np.linalg.matrix_rank(span)
    return np.linalg.svd(residual, compute_uv=False)[min(3, missing) - 1]


def score(criterion, Q, chosen, index):
    values = np.linalg.svd(rows_of(Q, [*chosen, index]), compute_uv=False)
    if criterion == "sigma_min":
        return values[-1]
    return -np.sum(values**-2.0) if criterion == "A" else np.sum(np.log(values))


def brute_force(Q, size, criterion):
    chosen = []
    while len(chosen) < size:
        left = [i for i in range(len(Q)) if i not in chosen]
        ranked = chosen and np.linalg.matrix_rank(rows_of(Q, chosen)) == Q.shape[2]
        scores = [score(criterion, Q, chosen, i) if ranked else start_score(Q, chosen, i) for i in left]
        chosen.append(left[int(np.argmax(scores))])
    return chosen


def printed_brute_force(Q, size):
    chosen = []
    while len(chosen) < size:
        left = [i for i in range(len(Q)) if i not in chosen]
        thin = np.array([np.linalg.svd(rows_of(Q, [*chosen, i]), compute_uv=False) for i in left])
        now = np.linalg.svd(rows_of(Q, chosen), compute_uv=False)[-1] if 3 * len(chosen) >= Q.shape[2] else 0.0
        rises = thin[:, -1].max() > max(now * (1 + 1e-9), 1e-6)
        chosen.append(left[int(np.argmax(thin[:, -1] if rises else thin[:, 0]))])
    return chosen


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("criterion", ["sigma_min", "A", "D"])
def test_chooses_what_brute_force_chooses(criterion, seed):
    Q = problem(seed)
    selection = reduce(Q, ReductionSettings(criterion=criterion, size=25))
    assert selection.indices.tolist() == brute_force(Q, 25, criterion)


@pytest.mark.parametrize("columns", [1, 2, 3, 4])
@pytest.mark.parametrize("criterion", ["sigma_min", "A", "D"])
def test_few_parameters(criterion, columns):
    Q = problem(11, samples=12, columns=columns)
    selection = reduce(Q, ReductionSettings(criterion=criterion, size=8))
    assert selection.indices.tolist() == brute_force(Q, 8, criterion)


@pytest.mark.parametrize("seed", range(4))
def test_printed_rule_chooses_what_brute_force_chooses(seed):
    Q = problem(seed, samples=25, columns=11)
    selection = reduce(Q, ReductionSettings(criterion="paper-literal", size=16))
    assert selection.indices.tolist() == printed_brute_force(Q, 16)


def test_every_nth_sample():
    Q = problem(1, samples=40, columns=5)
    selection = reduce(Q, ReductionSettings(criterion="even", size=16))
    assert selection.indices.tolist() == [0, 2, 5, 7, 10, 12, 15, 17, 20, 22, 25, 27, 30, 32, 35, 37]
    with pytest.raises(SettingError, match="even needs a size and no condition_number"):
        ReductionSettings(criterion="even", size=16, condition_number=5.0)


def test_long_selection_stays_exact_across_refreshes():
    Q = problem(5, samples=260, columns=6)
    selection = reduce(Q, ReductionSettings(criterion="A", size=230))
    chosen = selection.indices.tolist()
    for step in (99, 100, 101, 150, 229):
        left = [i for i in range(len(Q)) if i not in chosen[:step]]
        best = left[int(np.argmax([score("A", Q, chosen[:step], i) for i in left]))]
        assert chosen[step] == best


@pytest.mark.parametrize("criterion", ["KD-exchange", "K-exchange", "sigma_min", "A", "D", "even", "paper-literal"])
def test_trace_is_recomputed_condition_number(criterion):
    Q = problem(3)
    selection = reduce(Q, ReductionSettings(criterion=criterion, size=20))
    assert selection.full_rank
    for count in range(1, 21):
        values = np.linalg.svd(rows_of(Q, selection.indices[:count]), compute_uv=False)
        full = np.linalg.matrix_rank(rows_of(Q, selection.indices[:count])) == Q.shape[2]
        expected = np.linalg.cond(rows_of(Q, selection.indices[:count])) if full else np.inf
        assert selection.condition_number_trace[count - 1] == pytest.approx(expected, rel=1e-9)
        assert selection.singular_value_min_trace[count - 1] == pytest.approx(values[-1] if full else 0.0, rel=1e-9)
        assert selection.singular_value_max_trace[count - 1] == pytest.approx(values[0], rel=1e-9)
    assert selection.condition_number == selection.condition_number_trace[-1]
    assert selection.condition_number_full == pytest.approx(np.linalg.cond(Q.reshape(-1, Q.shape[2])))


def test_equal_samples_are_taken_lowest_index_first():
    Q = problem(8, samples=15)
    doubled = np.concatenate([Q, Q])
    for criterion in ("sigma_min", "A", "D", "paper-literal"):
        order = reduce(doubled, ReductionSettings(criterion=criterion, size=24)).indices.tolist()
        assert all(order.index(i - 15) < order.index(i) for i in order if i >= 15)


def test_condition_number_stops_as_soon_as_it_is_reached():
    Q = problem(2)
    trace = reduce(Q, ReductionSettings(criterion="sigma_min", size=40)).condition_number_trace
    target = float(trace[12]) * 1.001
    selection = reduce(Q, ReductionSettings(criterion="sigma_min", size=None, condition_number=target))
    assert selection.stop_reason == "condition-number"
    assert len(selection.indices) == np.flatnonzero(trace <= target)[0] + 1


@pytest.mark.parametrize("criterion", ["KD-exchange", "K-exchange", "sigma_min", "A", "D"])
def test_unreachable_condition_number_takes_all_samples(criterion):
    Q = problem(2)
    selection = reduce(Q, ReductionSettings(criterion=criterion, size=None, condition_number=1.01))
    assert selection.stop_reason == "all-samples"
    assert sorted(selection.indices) == list(range(40))


def test_progress_counts_to_the_size():
    calls = []
    reduce(problem(1), ReductionSettings(size=10), lambda done, total: calls.append((done, total)))
    assert calls == [(count, 10) for count in range(1, 11)]


@pytest.mark.parametrize("seed", range(5))
def test_nearly_equal_small_eigenvalues_do_not_hide_the_best_sample(seed):
    columns = 30
    blocks = np.diag(1 + 1e-9 * np.arange(columns)).reshape(10, 3, columns)
    blocks[2:] *= 1.5
    faint = np.random.default_rng(seed).standard_normal((150, 3, columns)) * 1e-2
    Q = np.concatenate([blocks, faint * np.geomspace(1, 1e-3, 150)[:, None, None]])
    chosen = reduce(Q, ReductionSettings(criterion="sigma_min", size=16)).indices.tolist()
    for step in range(10, 16):
        scores = {i: score("sigma_min", Q, chosen[:step], i) for i in range(160) if i not in chosen[:step]}
        assert scores[chosen[step]] >= max(scores.values()) * (1 - 1e-11)
