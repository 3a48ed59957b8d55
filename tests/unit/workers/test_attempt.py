import pickle

import pytest

from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.workers.attempt import attempt, result_of
from cpfls_cli.workers.worker_error import WorkerError


def failing(error):
    def work():
        raise error

    return attempt(work)


def test_a_result_passes():
    assert result_of(attempt(lambda: 3)) == 3


@pytest.mark.parametrize("kind", [ComputationError, InputError])
def test_an_error_of_the_domain_keeps_its_message(kind):
    with pytest.raises(ComputationError) as caught:
        result_of(failing(kind("flight.h5: gravity_m_s2 = 0: take the Earth's")))
    assert str(caught.value) == "flight.h5: gravity_m_s2 = 0: take the Earth's"
    assert not hasattr(caught.value, "__notes__")
    assert not isinstance(caught.value, WorkerError)


def test_too_little_memory_has_a_remedy():
    with pytest.raises(WorkerError, match="ran out of memory: take fewer workers"):
        result_of(failing(MemoryError()))


def test_any_other_error_is_named_and_its_origin_is_a_note():
    with pytest.raises(WorkerError, match="ZeroDivisionError: by nothing") as caught:
        result_of(failing(ZeroDivisionError("by nothing")))
    assert "test_attempt.py" in caught.value.__notes__[0]


def test_a_failure_survives_being_pickled():
    failure = failing(ZeroDivisionError("by nothing"))
    assert pickle.loads(pickle.dumps(failure)) == failure
