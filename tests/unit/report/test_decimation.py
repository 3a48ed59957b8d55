import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli.report.decimation import kept_samples, runs


@given(samples=st.integers(2, 6000), largest=st.integers(4, 1500), seed=st.integers(0, 1000))
def test_thinning_keeps_extremes_and_ends_and_is_short(samples, largest, seed):
    values = np.random.default_rng(seed).standard_normal(samples)
    kept = kept_samples(values, largest)
    assert len(kept) <= max(largest, 2) + 2
    assert np.all(np.diff(kept) > 0)
    assert {0, samples - 1, int(np.argmin(values)), int(np.argmax(values))} <= set(kept.tolist())


def test_a_lone_spike_survives():
    values = np.sin(np.linspace(0, 20, 100_000))
    values[54_321] = 9.0
    assert 54_321 in kept_samples(values)


@given(st.lists(st.booleans(), max_size=60))
def test_runs_cover_exactly_what_is_marked(marked):
    covered = [index for first, last in runs(np.array(marked)) for index in range(first, last + 1)]
    assert covered == [index for index, value in enumerate(marked) if value]
