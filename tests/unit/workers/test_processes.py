"""Work shared among processes."""

import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.workers.workforce import WorkerError, Workforce, attempt, chunks, employ, result_of
from tests.builders.evaluators import DEADLY_POISON, POISON, Failing, Loading, Logging, Reporting, Uneven, Unloadable
from tests.builders.studies import put_file

ROOT = Path(__file__).parents[3]
GENES = np.random.default_rng(5).integers(0, 32768, (40, 6))
ROWS = np.arange(12).reshape(6, 2)


def column(*values):
    return np.array(values)[:, np.newaxis]


@pytest.fixture(scope="module")
def two():
    with employ(Uneven(np.linspace(0, 1, 50)), count=2) as workers:
        yield workers


def test_two_processes_give_the_same_bytes_as_the_evaluator_itself(two):
    here = Uneven(np.linspace(0, 1, 50))(GENES)
    there = two(GENES)
    assert there.genes.tobytes() == here.genes.tobytes()
    assert there.objectives.tobytes() == here.objectives.tobytes()


def test_one_worker_is_this_process():
    with employ(Reporting()) as workers:
        assert set(workers(GENES).objectives[:, 0]) == {os.getpid()}


def test_parts_say_which_rows_they_are(two):
    seen = []
    for rows, part in two.stream(GENES):
        assert part.genes.tolist() == (GENES[rows, ::-1] + 1).tolist()
        seen.extend(rows.tolist())
    assert sorted(seen) == list(range(len(GENES)))


def test_streams_follow_each_other_and_one_that_is_given_up_leaves_nothing(two):
    for count in (1, 3, 40):
        assert two(GENES[:count]).genes.tolist() == (GENES[:count, ::-1] + 1).tolist()
    stream = two.stream(GENES)
    next(stream)
    stream.close()
    assert two(GENES[:5] + 1).genes.tolist() == (GENES[:5, ::-1] + 2).tolist()


def test_what_is_given_up_before_it_begins_is_never_evaluated_here(tmp_path):
    with employ(Logging(tmp_path)) as workers:
        stream = workers.stream(column(*range(100)))
        next(stream)
        stream.close()
    assert [path.name for path in tmp_path.iterdir()] == ["0"]


def test_what_is_given_up_before_it_begins_is_never_evaluated_in_processes(tmp_path):
    with employ(Logging(tmp_path), count=2) as workers:
        stream = workers.stream(column(*range(100)))
        next(stream)
        stream.close()
    assert 0 < len(list(tmp_path.iterdir())) < 60


def test_the_evaluator_is_loaded_once_by_each_process_and_an_idle_one_that_was_killed_is_noticed(tmp_path):
    with employ(Loading(tmp_path), count=2) as workers:
        for _ in range(3):
            workers(GENES)
        loaded = [int(path.name.split("-")[0]) for path in tmp_path.iterdir()]
        assert 1 <= len(set(loaded)) == len(loaded) <= 2
        assert os.getpid() not in loaded
        os.kill(loaded[0], signal.SIGKILL)
        with pytest.raises(ComputationError, match="ended unexpectedly"):
            workers(GENES)


def test_failing_and_killed_workers_are_errors_in_words_and_leave_no_process():
    before = set(multiprocessing.active_children())
    with employ(Failing(), count=2) as workers:
        with pytest.raises(ComputationError, match="SettingError: cannot be unpickled") as caught:
            workers(column(*range(POISON + 5)))
        assert "evaluators.py" in caught.value.__notes__[0]
        with pytest.raises(ComputationError, match=r"ended unexpectedly \(killed by SIGKILL\).*use fewer workers"):
            workers(column(*range(DEADLY_POISON - 5, DEADLY_POISON + 5)))
    assert set(multiprocessing.active_children()) <= before


def test_an_evaluator_that_cannot_be_loaded_is_an_error_in_words():
    with (
        pytest.raises(ComputationError, match="ModuleNotFoundError: No module named 'compiled_kernel'"),
        employ(Unloadable(), count=2) as workers,
    ):
        workers(GENES)


PARENT = """
import sys
import time
from cpfls_cli.cli.main import use_one_thread
if __name__ == "__main__":
    use_one_thread()
    import numpy as np
    from cpfls_cli.workers.workforce import employ
    from tests.builders.evaluators import Reporting
    with employ(Reporting(), count=2) as workers:
        seen = workers(np.ones((40, 2), dtype=int)).objectives
        print(*sorted({int(process) for process in seen[:, 0]}), flush=True)
        print(seen[:, 1].max(), seen[:, 2].min(), flush=True)
        sys.stdin.read()
"""


@pytest.fixture
def parent(tmp_path):
    script = put_file(tmp_path / "parent.py", PARENT)
    free = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    with subprocess.Popen(
        [sys.executable, script],
        env=free | {"PYTHONPATH": str(ROOT)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        yield process
        process.kill()


def exists(process):
    """Whether a process runs; one that ended and was not yet collected by its parent does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_workers_are_closed_to_interrupts_take_one_thread_and_end_when_their_parent_is_killed(parent):
    processes = [int(text) for text in parent.stdout.readline().split()]
    most_threads, closed = parent.stdout.readline().split()
    assert (float(most_threads), float(closed)) == (1.0, 1.0)
    assert all(exists(process) for process in processes)
    parent.kill()
    deadline = time.monotonic() + 10.0
    while any(exists(process) for process in processes) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not any(exists(process) for process in processes)
    assert parent.stderr.read() == ""


def test_an_interrupt_of_the_whole_group_reaches_only_the_parent(parent):
    parent.stdout.readline()
    os.killpg(parent.pid, signal.SIGINT)
    errors = parent.communicate()[1]
    assert errors.count("Traceback") == 1
    assert errors.strip().endswith("KeyboardInterrupt")


class Backwards(Workforce):
    """Finish the last part first, and rows of a part in no order."""

    def stream(self, genes):
        for rows in (np.array([5, 3]), np.array([4]), np.array([1, 0, 2])):
            yield rows, Evaluation(genes[rows] + 100, genes[rows] / 7)


def test_rows_come_back_where_they_were_whatever_finished_first():
    evaluation = Backwards()(ROWS)
    assert evaluation.genes.tolist() == (ROWS + 100).tolist()
    assert evaluation.objectives.tobytes() == (ROWS / 7).tobytes()


@given(st.integers(1, 500), st.integers(1, 70))
def test_each_row_is_in_one_chunk_and_chunks_shrink_to_one_row(rows, workers):
    parts = chunks(rows, workers)
    lengths = [len(part) for part in parts]
    assert np.concatenate(parts).tolist() == list(range(rows))
    assert (lengths, lengths[-1]) == (sorted(lengths, reverse=True), 1)
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


def test_failures_have_a_remedy_or_their_origin_and_survive_being_pickled():
    with pytest.raises(WorkerError, match="ran out of memory: use fewer workers"):
        result_of(failing(MemoryError()))
    with pytest.raises(WorkerError, match="ZeroDivisionError: by nothing") as caught:
        result_of(failing(ZeroDivisionError("by nothing")))
    assert "test_processes.py" in caught.value.__notes__[0]
    failure = failing(ZeroDivisionError("by nothing"))
    assert pickle.loads(pickle.dumps(failure)) == failure
