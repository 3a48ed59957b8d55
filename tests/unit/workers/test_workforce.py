import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.workers.workforce import WorkerError, Workforce, attempt, chunks, result_of

GENES = np.arange(12).reshape(6, 2)


class Backwards(Workforce):
    """Finish the last part first, and rows of a part in no order."""

    def stream(self, genes):
        for rows in (np.array([5, 3]), np.array([4]), np.array([1, 0, 2])):
            yield rows, Evaluation(genes[rows] + 100, genes[rows] / 7)


def test_rows_come_back_where_they_were_whatever_finished_first():
    evaluation = Backwards()(GENES)
    assert evaluation.genes.tolist() == (GENES + 100).tolist()
    assert evaluation.objectives.tobytes() == (GENES / 7).tobytes()


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


def failing(error):
    def work():
        raise error

    return attempt(work)


@pytest.mark.parametrize("kind", [ComputationError, InputError])
def test_an_error_of_the_domain_keeps_its_message(kind):
    with pytest.raises(ComputationError) as caught:
        result_of(failing(kind("flight.h5: gravity_m_s2 = 0: take the Earth's")))
    assert str(caught.value) == "flight.h5: gravity_m_s2 = 0: take the Earth's"
    assert not hasattr(caught.value, "__notes__")
    assert not isinstance(caught.value, WorkerError)


def test_too_little_memory_has_a_remedy():
    with pytest.raises(WorkerError, match="ran out of memory: use fewer workers"):
        result_of(failing(MemoryError()))


def test_any_other_error_is_named_and_its_origin_is_a_note():
    with pytest.raises(WorkerError, match="ZeroDivisionError: by nothing") as caught:
        result_of(failing(ZeroDivisionError("by nothing")))
    assert "test_workforce.py" in caught.value.__notes__[0]


def test_a_failure_survives_being_pickled():
    failure = failing(ZeroDivisionError("by nothing"))
    assert pickle.loads(pickle.dumps(failure)) == failure
