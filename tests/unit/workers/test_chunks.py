import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli.workers.chunks import chunks


@given(st.integers(1, 500), st.integers(1, 70))
def test_each_row_is_in_one_chunk_and_chunks_shrink_to_one_row(rows, workers):
    parts = chunks(rows, workers)
    lengths = [len(part) for part in parts]
    assert np.concatenate(parts).tolist() == list(range(rows))
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[-1] == 1
    assert lengths[0] <= -(-rows // (4 * workers))


@pytest.mark.parametrize("workers", [1, 2, 8])
def test_there_are_far_fewer_chunks_than_rows(workers):
    assert len(chunks(1000, workers)) < 200


def test_no_rows_are_one_empty_chunk():
    assert [part.tolist() for part in chunks(0, 3)] == [[]]


def test_as_many_workers_as_rows_take_single_rows():
    assert [part.tolist() for part in chunks(3, 3)] == [[0], [1], [2]]
