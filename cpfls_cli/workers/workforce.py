"""Who evaluates: this process, others on this machine, or a scheduler's; and how they are employed.

Processes: one pipe for each process in place of the standard library's pool: a process whose parent was killed sees its
pipe close and ends, where a pool's would wait forever; and one that vanishes is known by its exit code.
"""

from __future__ import annotations

import multiprocessing
import pickle
import signal
import sys
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from typing import TypeVar
from urllib.parse import urlsplit

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.errors import ComputationError, CpflsError, InputError, install_command
from cpfls_cli.evolution.archive import Evaluate, Evaluation

_CHUNKS_PER_WORKER = 4
_Result = TypeVar("_Result")


class Workforce(ABC):
    """Evaluate chromosomes, and yield each part as soon as it is finished.

    The evaluator must treat each chromosome by itself, whatever others it is given with. Then the result does not
    depend on the number or the kind of workers.
    """

    @abstractmethod
    def stream(self, genes: IntArray) -> Iterator[tuple[IntArray, Evaluation]]:
        """Evaluate chromosomes and hand out each part as soon as it is finished, in any order.

        Whoever stops iterating and closes the iterator gives up the rest: what has not begun is never begun, and
        what is under way is thrown away.

        Parameters
        ----------
        genes : array of int, shape (individuals, genes)

        Yields
        ------
        rows : array of int, shape (part,)
            Rows of `genes`; each appears once over all parts.
        evaluation : Evaluation
            Of these rows, in their order.

        Raises
        ------
        WorkerError
            If a worker vanishes or fails.
        ComputationError
            If the evaluator refuses its data.
        """

    def __call__(self, genes: IntArray) -> Evaluation:
        """Evaluate chromosomes and wait for all of them; the interface of an evaluator."""
        return gathered(list(self.stream(genes)))[1]


def gathered(parts: Sequence[tuple[IntArray, Evaluation]]) -> tuple[IntArray, Evaluation]:
    """Put evaluations in the order of their rows, whatever the order they came in.

    Parameters
    ----------
    parts : sequence of (array of int, Evaluation)
        Rows and their evaluation, at least one part; no row twice.

    Returns
    -------
    rows : array of int, shape (evaluations,)
        Ascending.
    evaluation : Evaluation
        In their order.
    """
    rows = np.concatenate([rows for rows, _ in parts])
    order = np.argsort(rows)
    genes = np.concatenate([evaluation.genes for _, evaluation in parts])
    objectives = np.concatenate([evaluation.objectives for _, evaluation in parts])
    return rows[order], Evaluation(genes[order], objectives[order])


def chunks(rows: int, workers: int) -> list[IntArray]:
    """Cut rows into chunks that shrink towards the end, down to a single row; one empty chunk where there are none.

    Each chunk takes a fixed share of what is left, so there are few of them, and yet nobody waits long for the last
    one, however uneven the rows are. Polychronopoulos and Kuck, Guided self-scheduling, IEEE Transactions on Computers
    C-36(12), 1987.
    """
    bounds = [0]
    while bounds[-1] < rows:
        remaining = rows - bounds[-1]
        bounds.append(bounds[-1] - (-remaining // (_CHUNKS_PER_WORKER * workers)))
    return np.split(np.arange(rows), bounds[1:-1])


class WorkerError(ComputationError):
    """Workers cannot be had, vanished, or failed for a reason that is not in the data."""


@dataclass(frozen=True)
class Failure:
    """Failure of a worker, as plain text for the user.

    `origin`: traceback in the worker, for whoever looks for a fault of the program, empty where the message says all;
    `of_data`: whether it is the data that cannot be worked on, whoever works.
    """

    message: str
    origin: str = ""
    of_data: bool = False


def attempt(work: Callable[[], _Result]) -> _Result | Failure:
    """Do some work and return its result, or else its failure.

    Failures travel as plain text, because not every exception survives being pickled.
    """
    try:
        return work()
    except CpflsError as error:
        return Failure(str(error), of_data=True)
    except MemoryError:
        return Failure("a worker ran out of memory: use fewer workers, or add memory")
    except Exception as error:
        kind = type(error).__name__
        message = f"a worker failed with {kind}: {error}; use one worker without a scheduler to see more"
        return Failure(message, traceback.format_exc())


def result_of(outcome: _Result | Failure) -> _Result:
    """Return the result of an attempt, or raise its failure: one in the data as `ComputationError`.

    Any other is a `WorkerError`, with the worker's traceback as a note.
    """
    if isinstance(outcome, Failure):
        error = ComputationError(outcome.message) if outcome.of_data else WorkerError(outcome.message)
        if outcome.origin:
            error.add_note(outcome.origin)
        raise error
    return outcome


_LONGEST_FAREWELL_S = 5.0


class _Process:
    """A started process and our end of its pipe."""

    def __init__(self) -> None:
        # A forked process would inherit locks that other threads hold; a spawned one starts clean.
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self._process = context.Process(target=work, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()
        self.busy = False

    def load(self, evaluator: bytes) -> None:
        """Send the pickled evaluator; the answer is None."""
        with self._alive():
            self.connection.send_bytes(evaluator)
            self.busy = True

    def give(self, genes: IntArray) -> None:
        """Send chromosomes; the answer is their evaluation."""
        with self._alive():
            self.connection.send(genes)
            self.busy = True

    def answer(self) -> Evaluation | None:
        """Receive what the process answers."""
        with self._alive():
            outcome: Evaluation | Failure | None = self.connection.recv()
            self.busy = False
            return result_of(outcome)

    def end(self) -> None:
        """End the process, whatever it is doing."""
        self.connection.close()
        self._process.kill()
        self._process.join()
        self._process.close()

    @contextmanager
    def _alive(self) -> Iterator[None]:
        try:
            yield
        except (EOFError, OSError) as error:
            self._process.join(_LONGEST_FAREWELL_S)
            raise WorkerError(
                f"a worker process ended unexpectedly ({_ending(self._process.exitcode)}); if the machine ran "
                "out of memory, use fewer workers or less data, or add memory"
            ) from error


class Processes(Workforce):
    """Processes on this machine, each with its own copy of the evaluator on its way."""

    def __init__(self, processes: list[_Process]) -> None:
        self._processes = processes

    def stream(self, genes: IntArray) -> Iterator[tuple[IntArray, Evaluation]]:
        """Evaluate chromosomes; parameters are those of `Workforce.stream`."""
        waiting = chunks(len(genes), len(self._processes))
        given: dict[_Process, IntArray] = {}
        self._hand_out(genes, waiting, given)
        while waiting or given:
            ready = wait([process.connection for process in self._processes if process.busy])
            for process in [each for each in self._processes if each.connection in ready]:
                answer, rows = process.answer(), given.pop(process, None)
                self._hand_out(genes, waiting, given)
                # Whatever was not given here answers to loading, or to a stream that was given up.
                if rows is not None and answer is not None:
                    yield rows, answer

    def _hand_out(self, genes: IntArray, waiting: list[IntArray], given: dict[_Process, IntArray]) -> None:
        for process in self._processes:
            if waiting and not process.busy:
                given[process] = waiting.pop(0)
                process.give(genes[given[process]])


@contextmanager
def processes(evaluate: Evaluate, count: int) -> Iterator[Processes]:
    """Start processes and end them afterwards, whatever they are doing; `WorkerError` where that cannot be.

    Linear algebra takes as many threads in them as the environment of this process says. The evaluator, which can be
    pickled, is sent to each process once.
    """
    evaluator = pickle.dumps(evaluate, protocol=pickle.HIGHEST_PROTOCOL)
    started: list[_Process] = []
    try:
        with _interrupts_held_back():
            _start(started, count)
        for process in started:
            process.load(evaluator)
        yield Processes(started)
    finally:
        for process in started:
            process.end()


def _start(started: list[_Process], count: int) -> None:
    try:
        for _ in range(count):
            started.append(_Process())  # noqa: PERF401 - kept one by one, to be ended when a later one fails
    except OSError as error:
        raise WorkerError(f"worker {len(started) + 1} of {count} cannot start ({error}): use fewer") from error


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Block signals, also in the processes started meanwhile, which would take them before they run our code."""
    # The first tells the type checker what the second tells the interpreter.
    if sys.platform == "win32" or not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # The resource tracker starts with the first process, and would let signals through again.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _ending(exit_code: int | None) -> str:
    if exit_code is None:
        return "its pipe closed"
    if exit_code < 0:
        return f"killed by {signal.Signals(-exit_code).name}"
    return f"exit code {exit_code}"


def work(connection: Connection) -> None:
    """Serve one pipe until it closes, which it also does when the other side is killed.

    It brings the pickled evaluator first, and then chromosomes; takes None when the evaluator is loaded, then one
    Evaluation or Failure for each array of chromosomes.
    """
    # An interrupt from the keyboard reaches the whole group of processes; the parent decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        _serve(connection)
    except (EOFError, ConnectionError):
        return


def _serve(connection: Connection) -> None:
    evaluate: Evaluate | Failure = attempt(partial(pickle.loads, connection.recv_bytes()))
    if isinstance(evaluate, Failure):
        connection.send(evaluate)
        return
    connection.send(None)
    while True:
        connection.send(attempt(partial(evaluate, connection.recv())))


_SCHEMES = ("tcp", "tls")


def employ(evaluate: Evaluate, *, count: int = 1, scheduler: str | None = None) -> AbstractContextManager[Workforce]:
    """Employ workers to evaluate chromosomes; the result is the same for all kinds.

    Parameters
    ----------
    evaluate : callable
        Evaluator of chromosomes that treats each by itself. Pickled, unless one worker evaluates here.
    count : int
        Processes on this machine; 1 evaluates in this one. Not used with a scheduler, which knows its own workers.
    scheduler : str, optional
        Address of a Dask scheduler, `tcp://host:port`.

    Returns
    -------
    context manager of Workforce
        Leaving it ends the processes, or the connection; not to be used again after an interrupt.

    Raises
    ------
    InputError
        If the address of the scheduler is none.
    WorkerError
        If Dask is not installed; on entry, if the workers cannot be had; in use, if one vanishes or fails.
    ComputationError
        In use, if the evaluator refuses its data.
    """
    if scheduler is not None:
        return _cluster(evaluate, scheduler)
    if count > 1:
        return processes(evaluate, count)
    return nullcontext(Serial(evaluate))


def _cluster(evaluate: Evaluate, address: str) -> AbstractContextManager[Workforce]:
    require_address(address)
    try:
        from cpfls_cli.workers.cluster import cluster
    except ModuleNotFoundError as error:
        raise WorkerError(
            f"a scheduler needs Dask, which is not installed here ({error}): {install_command('dask')}"
        ) from error
    return cluster(evaluate, address)


class Serial(Workforce):
    """The evaluator itself, row by row, so that it can be stopped between any two."""

    def __init__(self, evaluate: Evaluate) -> None:
        self._evaluate = evaluate

    def stream(self, genes: IntArray) -> Iterator[tuple[IntArray, Evaluation]]:
        """Evaluate chromosomes in order; parameters are those of `Workforce.stream`."""
        for rows in chunks(len(genes), max(len(genes), 1)):
            yield rows, self._evaluate(genes[rows])


def require_address(address: str) -> None:
    """Require that a text is an address; InputError if it is not of the form tcp://host:port, or tls://host:port."""
    try:
        parts = urlsplit(address)
        complete = parts.scheme in _SCHEMES and bool(parts.hostname) and bool(parts.port)
    except ValueError:
        complete = False
    if not complete:
        raise InputError(
            f"scheduler = {address}: not an address; expected tcp://host:port, such as tcp://10.0.0.1:8786"
        )
