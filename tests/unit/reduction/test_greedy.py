"""Greedy selection, exchanges, and flights that do not determine all."""

from itertools import combinations

import numpy as np
import pytest

from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.reduction.settings import ReductionSettings
from cpfls_cli.reduction.training_set import check_space
from tests.builders.reductions import random_selections, reduce, row_space

FEW = [((11, 12, columns), 8) for columns in (1, 2, 3, 4)]
REGRESSOR = np.random.default_rng(0).standard_normal((20, 3, 10))


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


@pytest.mark.parametrize(("given", "size"), [*(((seed,), 25) for seed in range(4)), *FEW])
@pytest.mark.parametrize("criterion", ["sigma_min", "A", "D"])
def test_chooses_what_brute_force_chooses_of_few_parameters_too(criterion, given, size):
    Q = problem(*given)
    selection = reduce(Q, ReductionSettings(criterion=criterion, size=size))
    assert selection.indices.tolist() == brute_force(Q, size, criterion)


@pytest.mark.parametrize("seed", range(4))
def test_printed_rule_chooses_what_brute_force_chooses(seed):
    Q = problem(seed, samples=25, columns=11)
    selection = reduce(Q, ReductionSettings(criterion="paper-literal", size=16))
    assert selection.indices.tolist() == printed_brute_force(Q, 16)


def test_every_nth_sample():
    selection = reduce(problem(1, samples=40, columns=5), ReductionSettings(criterion="even", size=16))
    assert selection.indices.tolist() == [0, 2, 5, 7, 10, 12, 15, 17, 20, 22, 25, 27, 30, 32, 35, 37]
    with pytest.raises(SettingError, match="even needs a size and no condition_number"):
        ReductionSettings(criterion="even", size=16, condition_number=5.0)


def test_long_selection_stays_exact_across_refreshes():
    Q = problem(5, samples=260, columns=6)
    chosen = reduce(Q, ReductionSettings(criterion="A", size=230)).indices.tolist()
    for step in (99, 100, 101, 150, 229):
        left = [i for i in range(len(Q)) if i not in chosen[:step]]
        assert chosen[step] == left[int(np.argmax([score("A", Q, chosen[:step], i) for i in left]))]


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
    selection = reduce(problem(2), ReductionSettings(criterion=criterion, size=None, condition_number=1.01))
    assert (selection.stop_reason, sorted(selection.indices)) == ("all-samples", list(range(40)))


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


def condition_number(Q, indices):
    return np.linalg.cond(Q[list(indices)].reshape(-1, Q.shape[2]))


def compound(Q, indices):
    """The criterion in the limit of a high power, from its definition."""
    values = np.linalg.svd(Q[list(indices)].reshape(-1, Q.shape[2]), compute_uv=False)
    return 2 * np.log(values[0] / values[-1]) - 2.0 * np.mean(2 * np.log(values))


def exchanged(Q, size, criterion="K-exchange", **limits):
    return reduce(Q, ReductionSettings(criterion=criterion, size=size, **limits))


@pytest.mark.parametrize("seed", range(6))
def test_close_to_the_best_of_all_subsets(seed):
    Q = problem(seed, samples=14, columns=5)
    every = [condition_number(Q, subset) for subset in combinations(range(14), 5)]
    found = exchanged(Q, 5).condition_number
    assert found <= np.quantile(every, 0.01)
    assert found <= 1.15 * min(every)


@pytest.mark.parametrize("seed", range(4))
def test_information_counts_where_it_is_asked_for(seed):
    Q = problem(seed, samples=14, columns=5)
    every = [compound(Q, subset) for subset in combinations(range(14), 5)]
    assert compound(Q, exchanged(Q, 5, "KD-exchange").indices) <= np.quantile(every, 0.01)


@pytest.mark.parametrize("seed", range(4))
def test_better_conditioned_than_any_greedy_choice(seed):
    Q = problem(seed, samples=200)
    greedy = [
        reduce(Q, ReductionSettings(criterion=rule, size=30)).condition_number for rule in ("sigma_min", "A", "D")
    ]
    selection = exchanged(Q, 30)
    assert selection.exchanges > 0
    assert selection.condition_number == pytest.approx(condition_number(Q, selection.indices), rel=1e-9)
    assert selection.condition_number < 0.9 * min(greedy)


def test_keeping_information_predicts_better():
    """A condition number is also lowered by dropping the samples that say most; predictions pay for that."""
    Q = problem(1, samples=300)

    def worst_variance(selection):
        kept = Q[selection.indices].reshape(-1, 8)
        return np.einsum("nij,jk,nik->ni", Q, np.linalg.inv(kept.T @ kept), Q).max()

    assert worst_variance(exchanged(Q, 40, "KD-exchange")) < 0.5 * worst_variance(exchanged(Q, 40))


@pytest.mark.parametrize("criterion", ["K-exchange", "KD-exchange"])
def test_stops_at_the_first_size_that_reaches_the_target(criterion):
    Q = problem(2, samples=200)
    target = 1.1 * exchanged(Q, 24, criterion).condition_number
    selection = exchanged(Q, None, criterion, condition_number=target)
    assert selection.stop_reason == "condition-number"
    assert selection.condition_number <= target
    assert np.all(selection.condition_number_trace[:-1] > target)
    assert len(selection.indices) <= 30


def test_a_target_out_of_reach_of_the_size_ends_at_the_size():
    selection = exchanged(problem(2), 12, condition_number=1.001)
    assert (selection.stop_reason, len(selection.indices)) == ("size", 12)


@pytest.mark.parametrize("size", [3, 40])
def test_the_smallest_and_the_largest_set(size):
    selection = exchanged(problem(3), size)
    assert (selection.rank, len(set(selection.indices.tolist()))) == (8, size)


def test_badly_scaled_samples_are_exchanged_without_squaring_the_condition_number():
    Q = np.random.default_rng(0).standard_normal((80, 3, 6)) * np.geomspace(1.0, 1e-8, 6)
    selection = exchanged(Q, 20)
    greedy = reduce(Q, ReductionSettings(criterion="sigma_min", size=20))
    assert selection.rank == 6
    assert selection.exchanges > 0
    assert selection.condition_number < greedy.condition_number


def test_one_parameter_has_nothing_to_exchange():
    assert exchanged(np.random.default_rng(0).standard_normal((20, 3, 1)), 5).condition_number == pytest.approx(1.0)


def deficient(rank=7, columns=16, samples=60, seed=0):
    rng = np.random.default_rng(seed)
    basis = np.linalg.qr(rng.standard_normal((columns, rank)))[0].T
    return rng.standard_normal((samples, 3, rank)) * np.geomspace(1, 0.05, rank) @ basis


def kept_condition_number(Q, indices, rank):
    values = np.linalg.svd(Q[indices].reshape(-1, Q.shape[2]), compute_uv=False)
    return values[0] / values[rank - 1]


@pytest.mark.parametrize("criterion", ["KD-exchange", "K-exchange", "sigma_min", "A", "D"])
def test_works_in_the_row_space(criterion):
    Q = deficient()
    selection = reduce(Q, ReductionSettings(criterion=criterion, size=20))
    assert (selection.rank, selection.rank_full) == (7, 7)
    assert selection.rank_trace.tolist()[:3] == [3, 6, 7]
    assert not selection.stalled
    assert selection.condition_number == pytest.approx(kept_condition_number(Q, selection.indices, 7), rel=1e-8)
    assert selection.condition_number_full == pytest.approx(kept_condition_number(Q, np.arange(60), 7), rel=1e-8)


def test_same_choice_as_in_coordinates_of_full_rank():
    Q = deficient()
    reduced = Q @ np.linalg.svd(Q.reshape(-1, 16))[2][:7].T
    for criterion in ("KD-exchange", "sigma_min", "A", "D"):
        settings = ReductionSettings(criterion=criterion, size=20)
        assert reduce(Q, settings).indices.tolist() == reduce(reduced, settings).indices.tolist()


def test_samples_of_dependent_rows_reach_the_rank_one_by_one():
    Q = np.random.default_rng(4).standard_normal((30, 1, 6)) * np.array([1.0, 0.5, -2.0])[:, None]
    assert reduce(Q, ReductionSettings(size=12)).rank_trace[:6].tolist() == [1, 2, 3, 4, 5, 6]
    with pytest.raises(SettingError, match="has rank 6, which takes 6 samples"):
        reduce(Q, ReductionSettings(size=4))


def test_mixed_blocks_prefer_the_sample_that_adds_most_rank():
    strong_line = np.zeros((3, 6))
    strong_line[0, 5] = 100.0
    selection = reduce(np.stack([strong_line, np.eye(6)[:3] * 0.1, np.eye(6)[3:] * 0.1]), ReductionSettings(size=3))
    assert selection.indices.tolist() == [1, 2, 0]


def test_badly_scaled_full_set_keeps_its_small_singular_values():
    Q = np.random.default_rng(9).standard_normal((50, 3, 6)) * np.geomspace(1.0, 1e-9, 6)
    selection = reduce(Q, ReductionSettings(size=20))
    assert selection.rank == 6
    values = [np.linalg.svd(Q[selection.indices[:n]].reshape(-1, 6), compute_uv=False)[-1] for n in range(2, 21)]
    assert np.allclose(selection.singular_value_min_trace[1:], values, rtol=1e-5)


def test_printed_rule_stalls_and_says_so():
    # Three equal rows a sample: the smallest singular value is zero whatever is taken, so the loudest are.
    Q = np.zeros((40, 3, 9))
    Q[:30, :, :3] = np.random.default_rng(1).standard_normal((30, 1, 3)) * 10.0
    Q[30:, :, 3:] = np.random.default_rng(2).standard_normal((10, 1, 6))
    selection = reduce(Q, ReductionSettings(criterion="paper-literal", size=20))
    assert (selection.rank, selection.rank_full, selection.stalled) == (3, 9, True)
    assert np.isinf(selection.condition_number)
    assert not np.any(selection.singular_value_min_trace)
    assert reduce(Q, ReductionSettings(size=20)).rank == 9


def test_random_selection_has_the_condition_number_of_its_rows():
    Q = deficient(rank=16)
    subsets = random_selections(Q, 25, 4, np.random.default_rng(0))
    assert len({tuple(indices) for indices, _ in subsets}) == 4
    for indices, factor in subsets:
        assert len(set(indices.tolist())) == 25
        assert factor.condition_number == pytest.approx(kept_condition_number(Q, indices, 16), rel=1e-9)
    ((_, few),) = random_selections(Q, 3, 1, np.random.default_rng(0))
    assert (few.rank, few.full_rank, few.condition_number) == (9, False, np.inf)


def check_reducible(Q, settings):
    check_space(row_space(Q, settings.rank_tolerance), settings)


def test_something_must_stop_the_reduction():
    with pytest.raises(SettingError) as caught:
        ReductionSettings(size=None)
    assert caught.value.key == "size"


@pytest.mark.parametrize("refuse", [reduce, check_reducible])
@pytest.mark.parametrize(("size", "message"), [(21, "has only 20 samples"), (3, "rank 10, which takes 4 samples")])
def test_size_must_fit_the_samples_and_the_rank(refuse, size, message):
    with pytest.raises(SettingError, match=message) as caught:
        refuse(REGRESSOR, ReductionSettings(size=size))
    assert caught.value.key == "size"


@pytest.mark.parametrize("size", [4, 20])
def test_the_smallest_and_the_largest_size_are_taken(size):
    check_reducible(REGRESSOR, ReductionSettings(size=size))
    assert reduce(REGRESSOR, ReductionSettings(size=size)).rank == 10


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_value_that_is_not_finite_is_located(value):
    broken = REGRESSOR.copy()
    broken[[7, 9], 1, 4] = value
    with pytest.raises(ComputationError, match=r"sample 7 is not finite \(2 of 20"):
        reduce(broken, ReductionSettings(size=10))


@pytest.mark.parametrize("shape", [(20, 10), (20, 2, 10), (0, 3, 10), (20, 3, 0)])
def test_wrong_shape(shape):
    with pytest.raises(ComputationError, match=r"expected shape \(samples, 3, parameters\)"):
        reduce(np.ones(shape), ReductionSettings(size=10))


def test_no_excitation():
    with pytest.raises(ComputationError, match="every value is zero"):
        reduce(np.zeros((20, 3, 10)), ReductionSettings(size=10))


@pytest.mark.parametrize("size", [0, 21])
def test_random_selection_of_an_impossible_size(size):
    with pytest.raises(ComputationError, match="expected 1 to 20"):
        random_selections(REGRESSOR, size, 1, np.random.default_rng(0))
