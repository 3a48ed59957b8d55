"""Blocks and splits are contiguous parts, and nothing within the embargo of what is judged trains."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli.errors import SettingError
from cpfls_cli.identification.data import split_flight
from cpfls_cli.identification.solver import contiguous_blocks

times = st.lists(st.floats(1e-3, 0.5), min_size=1, max_size=60).map(np.cumsum)
embargoes = st.floats(0, 2)


@given(times, st.integers(1, 20), embargoes)
def test_blocks(time, folds, embargo):
    try:
        blocks = contiguous_blocks(time, time, folds, embargo)
    except SettingError:
        # Refused only where some block with its embargo covers all samples.
        label = np.arange(len(time)) * min(folds, len(time)) // len(time)
        parts = [time[label == fold] for fold in range(label[-1] + 1)]
        assert any(p[0] - embargo <= time[0] + 1e-9 and time[-1] - 1e-9 <= p[-1] + embargo for p in parts)
        return
    sizes = blocks.validation.sum(axis=1)
    assert len(sizes) == min(folds, len(time))
    assert sizes.max() - sizes.min() <= 1
    np.testing.assert_array_equal(blocks.validation.sum(axis=0), 1)
    for validation, left_out in zip(blocks.validation, blocks.left_out, strict=True):
        assert np.all(np.diff(np.flatnonzero(validation)) == 1)
        distance = np.abs(time[:, None] - time[validation]).min(axis=1)
        inside = (time >= time[validation][0]) & (time <= time[validation][-1])
        assert np.all(left_out[inside | (distance <= embargo - 1e-9)])
        assert not np.any(left_out[~inside & (distance > embargo + 1e-9)])


@given(times, st.floats(0.01, 1), embargoes)
def test_split(time, share, embargo):
    split = split_flight(time, share, embargo)
    training, held_out = time[split.training], time[split.held_out]
    assert split.training.start == 0
    assert len(training) == max(round(share * len(time)), 1)
    assert split.held_out.stop == len(time)
    if len(held_out):
        assert held_out[0] > training[-1] + embargo - 1e-9
    dropped = time[split.training.stop : split.held_out.start]
    assert np.all(dropped <= training[-1] + embargo + 1e-9)
