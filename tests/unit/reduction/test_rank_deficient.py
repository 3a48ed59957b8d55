"""Training sets whose regressor has dependent columns, and samples whose rows are dependent."""

import numpy as np
import pytest

from cpfls_cli.errors import SettingError
from cpfls_cli.reduction.settings import ReductionSettings
from tests.builders.reductions import random_selections, reduce


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
    rng = np.random.default_rng(4)
    Q = rng.standard_normal((30, 1, 6)) * np.array([1.0, 0.5, -2.0])[:, None]
    selection = reduce(Q, ReductionSettings(size=12))
    assert selection.rank_trace[:6].tolist() == [1, 2, 3, 4, 5, 6]
    with pytest.raises(SettingError, match="has rank 6, which takes 6 samples"):
        reduce(Q, ReductionSettings(size=4))


def test_mixed_blocks_prefer_the_sample_that_adds_most_rank():
    strong_line = np.zeros((3, 6))
    strong_line[0, 5] = 100.0
    blocks = np.stack([strong_line, np.eye(6)[:3] * 0.1, np.eye(6)[3:] * 0.1])
    selection = reduce(blocks, ReductionSettings(size=3))
    assert selection.indices.tolist() == [1, 2, 0]


def test_badly_scaled_full_set_keeps_its_small_singular_values():
    rng = np.random.default_rng(9)
    Q = rng.standard_normal((50, 3, 6)) * np.geomspace(1.0, 1e-9, 6)
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
    assert len({tuple(subset.indices) for subset in subsets}) == 4
    for subset in subsets:
        assert len(set(subset.indices.tolist())) == 25
        assert subset.condition_number == pytest.approx(kept_condition_number(Q, subset.indices, 16), rel=1e-9)
    (few,) = random_selections(Q, 3, 1, np.random.default_rng(0))
    assert (few.rank, few.full_rank, few.condition_number) == (9, False, np.inf)
