"""What every selection satisfies."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cpfls_cli.reduction.settings import ReductionSettings
from tests.builders.reductions import reduce

seeds = st.integers(0, 2**32 - 1)
criteria = st.sampled_from(["KD-exchange", "K-exchange", "sigma_min", "A", "D", "paper-literal"])


def regressor(seed):
    rng = np.random.default_rng(seed)
    return rng.standard_normal((20, 3, 5)) * rng.uniform(0.2, 2.0, (20, 1, 1))


@settings(deadline=None, max_examples=40)
@given(seeds, criteria, st.integers(2, 20))
def test_singular_values_only_grow_and_no_sample_repeats(seed, criterion, size):
    selection = reduce(regressor(seed), ReductionSettings(criterion=criterion, size=size))
    assert len(set(selection.indices.tolist())) == len(selection.indices) == size
    for trace in (selection.singular_value_min_trace, selection.singular_value_max_trace, selection.rank_trace):
        assert np.all(np.diff(trace) >= -1e-12 * np.max(trace))


@settings(deadline=None, max_examples=40)
@given(seeds, criteria, st.integers(-20, 20))
def test_units_and_orthogonal_coordinates_do_not_matter(seed, criterion, exponent):
    Q, rotation = regressor(seed), np.linalg.qr(np.random.default_rng(seed).standard_normal((5, 5)))[0]
    chosen = reduce(Q, ReductionSettings(criterion=criterion, size=12))
    moved = reduce(2.0**exponent * Q @ rotation, ReductionSettings(criterion=criterion, size=12))
    assert chosen.indices.tolist() == moved.indices.tolist()
    assert np.isclose(chosen.condition_number, moved.condition_number, rtol=1e-9)


@settings(deadline=None, max_examples=30)
@given(seeds, criteria)
def test_order_of_samples_does_not_matter(seed, criterion):
    Q, order = regressor(seed), np.random.default_rng(seed).permutation(20)
    chosen = reduce(Q, ReductionSettings(criterion=criterion, size=12)).indices
    shuffled = reduce(Q[order], ReductionSettings(criterion=criterion, size=12)).indices
    assert order[shuffled].tolist() == chosen.tolist()
