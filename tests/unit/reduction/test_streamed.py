"""A regressor read in chunks is reduced as one held in memory, or from a pool that stands for it."""

from dataclasses import fields, replace

import numpy as np
import pytest

from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.reduction.settings import ReductionSettings
from cpfls_cli.reduction.survey import survey
from cpfls_cli.reduction.training_set import check_streamed, draw_pool, random_streamed, reduce_streamed
from tests.builders.reductions import beginning, random_selections, reduce, row_space


def regressor(samples=3000, columns=7, seed=0):
    return np.random.default_rng(seed).standard_normal((samples, 3, columns)) * np.geomspace(1.0, 0.02, columns)


def chunked(Q, size):
    return lambda: (Q[first : first + size] for first in range(0, len(Q), size))


def generator():
    return np.random.default_rng(5)


@pytest.mark.parametrize("size", [1, 313, 1024, 5000])
def test_survey_knows_the_row_space_of_all_samples(size):
    Q = regressor()
    values = np.linalg.svd(Q.reshape(-1, 7), compute_uv=False)
    surveyed = survey(chunked(Q, size), 1e-10)
    assert (surveyed.samples, len(surveyed.basis), surveyed.rank) == (3000, 7, 7)
    assert np.allclose(surveyed.singular_values, values, rtol=1e-12)
    assert np.array_equal(surveyed.singular_values, survey(lambda: [Q], 1e-10).singular_values)


@pytest.mark.parametrize("criterion", ["sigma_min", "A", "D"])
def test_what_fits_in_the_pool_is_reduced_as_in_memory(criterion):
    Q, settings = regressor(), ReductionSettings(criterion=criterion, size=30, pool=3000)
    streamed = reduce_streamed(survey(chunked(Q, 700), 1e-10), settings, generator())
    held = reduce(Q, settings)
    assert streamed.indices.tolist() == held.indices.tolist()
    assert np.array_equal(streamed.condition_number_trace, held.condition_number_trace)
    assert streamed.stop_reason == held.stop_reason == "size"


@pytest.mark.parametrize("criterion", ["sigma_min", "A", "D", "paper-literal"])
@pytest.mark.parametrize("pool", [200, 3000])
def test_a_smaller_size_is_the_beginning_of_a_larger_one(criterion, pool):
    surveyed, settings = (
        survey(chunked(regressor(), 700), 1e-10),
        ReductionSettings(criterion=criterion, size=30, pool=pool),
    )
    larger = reduce_streamed(surveyed, settings, generator())
    smaller, begun = reduce_streamed(surveyed, replace(settings, size=12), generator()), beginning(larger, 12)
    assert begun is not None
    for field in fields(smaller):
        assert np.array_equal(getattr(begun, field.name), getattr(smaller, field.name)), field.name
    assert beginning(larger, 31) is None
    assert beginning(larger, 2) is None


@pytest.mark.parametrize("criterion", ["KD-exchange", "K-exchange", "even"])
def test_what_knows_its_size_from_the_start_has_no_beginning(criterion):
    settings = ReductionSettings(criterion=criterion, size=30)
    assert beginning(reduce_streamed(survey(chunked(regressor(), 700), 1e-10), settings, generator()), 12) is None


@pytest.mark.parametrize("size", [100, 999, 3000])
def test_the_choice_from_a_pool_does_not_depend_on_the_chunks(size):
    Q, settings = regressor(), ReductionSettings(size=30, pool=200)
    expected = reduce_streamed(survey(chunked(Q, 1), 1e-10), settings, generator())
    selection = reduce_streamed(survey(chunked(Q, size), 1e-10), settings, generator())
    assert selection.indices.tolist() == expected.indices.tolist()
    rows = Q[selection.indices].reshape(-1, 7)
    assert selection.condition_number == pytest.approx(np.linalg.cond(rows), rel=1e-9)
    assert selection.condition_number_full == pytest.approx(np.linalg.cond(Q.reshape(-1, 7)), rel=1e-9)


def test_pool_holds_each_sample_once_and_in_order():
    Q = regressor()
    surveyed = survey(chunked(Q, 500), 1e-10)
    pool = draw_pool(surveyed, 1500, generator())
    assert np.all(np.diff(pool.indices) > 0)
    assert len(pool.indices) == 1500
    assert np.allclose(pool.space.rows, Q[pool.indices] @ surveyed.basis, rtol=1e-12, atol=1e-14)


def test_pool_prefers_leverage_in_proportion():
    """With few drawn of many, a sample of four times the leverage is drawn four times as often."""
    Q = regressor(samples=2000)
    Q[::2] *= 2.0
    surveyed = survey(lambda: [Q], 1e-10)
    draws = np.concatenate([draw_pool(surveyed, 20, np.random.default_rng(seed)).indices for seed in range(100)])
    assert np.mean(draws % 2 == 0) == pytest.approx(0.8, abs=0.03)


def test_a_direction_that_one_sample_determines_is_in_the_pool():
    Q = regressor(samples=2500)
    Q[:, :, 6] = 0.0
    Q[1234, 0, 6] = 1e-3
    surveyed = survey(chunked(Q, 400), 1e-10)
    for seed in range(20):
        assert 1234 in draw_pool(surveyed, 100, np.random.default_rng(seed)).indices


def test_samples_without_leverage_fill_a_pool_last():
    Q = regressor(samples=300)
    Q[:250] = 0.0
    pool = draw_pool(survey(chunked(Q, 64), 1e-10), 280, generator())
    assert np.all(np.isin(np.arange(250, 300), pool.indices))
    assert len(set(pool.indices.tolist())) == 280


def test_a_pool_too_small_for_the_rank_is_refused():
    surveyed = survey(lambda: [regressor()], 1e-10)
    settings = ReductionSettings(size=2, pool=2)
    for refuse in (reduce_streamed, check_streamed):
        with pytest.raises(ComputationError, match=r"reduction.pool = 2: samples drawn have rank 6, all samples 7"):
            refuse(surveyed, settings, generator())


def test_size_must_fit_the_pool_and_a_target_that_it_does_not_reach_is_said():
    with pytest.raises(SettingError, match="at least size = 30") as caught:
        ReductionSettings(size=30, pool=20)
    assert caught.value.key == "pool"
    surveyed = survey(lambda: [regressor(samples=200)], 1e-10)
    settings = ReductionSettings(criterion="D", size=None, condition_number=1.001, pool=50)
    selection = reduce_streamed(surveyed, settings, generator())
    assert (selection.stop_reason, len(selection.indices)) == ("pool", 50)


@pytest.mark.parametrize("size", [40, 2900])
def test_random_choices_are_those_made_in_memory(size):
    Q = regressor()
    surveyed = survey(chunked(Q, 333), 1e-10)
    assert surveyed.condition_number == row_space(Q, 1e-10).condition_number
    streamed = random_streamed(surveyed, size, 3, generator())
    for (one, factor), (other, _) in zip(streamed, random_selections(Q, size, 3, generator()), strict=True):
        assert one.tolist() == other.tolist()
        assert factor.condition_number == pytest.approx(np.linalg.cond(Q[one].reshape(-1, 7)), rel=1e-9)


def test_broken_chunks_are_located_in_the_whole():
    Q = regressor(samples=90)
    Q[70, 2, 1] = np.nan
    with pytest.raises(ComputationError, match=r"sample 70 is not finite \(1 of 90"):
        survey(chunked(Q, 40), 1e-10)
    with pytest.raises(ComputationError, match="no sample"):
        survey(list, 1e-10)
    with pytest.raises(ComputationError, match=r"expected shape \(samples, 3, 7\), got \(5, 3, 6\)"):
        survey(lambda: [Q[:5], Q[:5, :, :6]], 1e-10)
