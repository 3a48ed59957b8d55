"""Inputs that cannot be reduced are refused with the reason."""

import numpy as np
import pytest

from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.reduction.settings import ReductionSettings
from cpfls_cli.reduction.training_set import check_space
from tests.builders.reductions import random_selections, reduce, row_space

REGRESSOR = np.random.default_rng(0).standard_normal((20, 3, 10))


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
